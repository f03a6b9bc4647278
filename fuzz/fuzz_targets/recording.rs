#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| hydroid_fuzz::recording(bytes));
