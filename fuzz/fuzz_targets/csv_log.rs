//! The reader of logs on arbitrary bytes: `cargo +nightly fuzz run csv_log`.
#![no_main]

use hydroid::log::{PrepareOptions, Selection, inspect, prepare, read_from};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(log) = read_from(bytes, "fuzz.csv") else { return };
    let (selection, options) = (Selection::default(), PrepareOptions::default());
    let _ = inspect(&log, &selection, &options);
    let _ = prepare(&[log], &selection, &options);
});
