//! States of streams.

use hydroid_live::stream::State;
use serde_json::{Value, json};

use crate::live::Live;
use crate::{repair, scratch};

fn settings(variant: &str) -> Value {
    let live = Live::new(variant, false);
    json!({ "learning": variant, "reading": live.model().description.reading })
}

/// The state names its variant in place of the fingerprint of a model. What is read is what would be written; a stream
/// that resumes from it has finite predictions after clean samples.
pub fn stream_state(bytes: &[u8]) {
    let bytes = repair::state(bytes, settings);
    let Ok(state) = State::decode(&bytes) else { return };
    let again = state.encode().expect("a state that was read can be written");
    assert!(State::decode(&again).and_then(|state| state.encode().map_err(|e| e.to_string())) == Ok(again));
    let head = repair::Tensors::read(&bytes).and_then(|tensors| tensors.head("hydroid_stream"));
    let variant = head.and_then(|head| head.get("model")?.as_str().map(str::to_owned)).unwrap_or_default();
    let path = scratch::path("state");
    std::fs::write(&path, &bytes).expect("the scratch file can be written");
    let mut live = Live::new(&variant, false);
    let Ok(resumed) = live.stream().persist_in(&path, variant.clone(), &variant) else { return };
    live.t = resumed.filter(|t| t.abs() < 1e11).unwrap_or(0.0);
    live.begin();
    // Lines that were answered before may be skipped.
    for _ in 0..crate::live::RECOVERY {
        live.clean();
    }
    live.recover();
    live.stream().finish().expect("the state can be saved");
}

/// The state of a variant after some samples.
pub fn seed(variant: &str) -> Vec<u8> {
    let path = scratch::path("seed");
    let _ = std::fs::remove_file(&path);
    let mut live = Live::new(variant, false);
    live.stream().persist_in(&path, variant.to_owned(), &variant).expect("no state yet");
    live.begin();
    live.recover();
    live.stream().finish().expect("the state can be saved");
    std::fs::read(&path).expect("the state was saved")
}
