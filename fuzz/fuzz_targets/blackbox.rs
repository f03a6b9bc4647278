//! A black box on arbitrary bytes: `cargo +nightly fuzz run blackbox`. Whatever is read can be shown.
#![no_main]

use hydroid_live::black_box::BlackBox;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(black_box) = BlackBox::decode(bytes) else { return };
    let summary = black_box.summary();
    assert_eq!(summary.samples, black_box.steps().filter(|step| step.is_sample()).count());
    for step in black_box.steps() {
        assert!(step.json().is_object());
    }
});
