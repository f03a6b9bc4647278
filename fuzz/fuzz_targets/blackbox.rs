#![no_main]

use hydroid_fuzz::mutate::black_box as change;

libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    hydroid_fuzz::mutate::either(data, size, max_size, seed, change, libfuzzer_sys::fuzzer_mutate)
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| hydroid_fuzz::blackbox(bytes));
