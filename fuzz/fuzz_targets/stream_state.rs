//! The state of a stream on arbitrary bytes: `cargo +nightly fuzz run stream_state`. What is read is what would
//! be written.
#![no_main]

use hydroid_live::stream::State;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(state) = State::decode(bytes) else { return };
    let again = state.encode().unwrap();
    assert_eq!(State::decode(&again).unwrap().encode().unwrap(), again);
});
