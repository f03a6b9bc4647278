//! The reader of logs on arbitrary bytes: `cargo +nightly fuzz run csv_log`.
#![no_main]

use hydroid::log::{PrepareOptions, Selection, inspect, prepare, read_from};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(log) = read_from(bytes, "fuzz.csv") else { return };
    let _ = inspect(&log, &Selection::default());
    let _ = prepare(&[log], &Selection::default(), &PrepareOptions::default());
});
