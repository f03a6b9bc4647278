//! Vessel files.

use hydroid::model::{encode, read};

use crate::{exercise, scratch};

/// What is read as a vessel is used; a written file is read, and written to the same bytes.
pub fn vessel_file(bytes: &[u8]) {
    let path = scratch::path("vessel.toml");
    std::fs::write(&path, bytes).expect("the scratch file can be written");
    let Ok(model) = read(&path) else { return };
    let written = encode(&model).expect("a vessel that was read can be written");
    std::fs::write(&path, &written).expect("the scratch file can be written");
    let again = read(&path).unwrap_or_else(|error| {
        panic!("a written vessel is refused: {error}\n{}", String::from_utf8_lossy(&written))
    });
    let rewritten = encode(&again).expect("written again");
    assert_eq!(String::from_utf8_lossy(&rewritten), String::from_utf8_lossy(&written));
    exercise::model(&model);
}
