//! Logs of other programs: every format of `hydroid-io`.

use std::cell::Cell;

use crate::scratch;

/// A recording has a value for each row, and its losses lie in the file.
pub fn recording(bytes: &[u8]) {
    let path = scratch::path("recording");
    std::fs::write(&path, bytes).expect("the scratch file can be written");
    let path = path.to_string_lossy();
    let calls = Cell::new(0_u64);
    let proceed = |done: u64, total: u64| {
        assert!(done <= total, "{done} of {total} bytes");
        calls.set(calls.get() + 1);
        true
    };
    let Ok(found) = hydroid_io::read(&path, &|_, _| true, &proceed) else { return };
    for topic in &found.topics {
        let rows = topic.stamps_ns.len();
        assert!(rows > 0 && [0, rows].contains(&topic.received_ns.len()), "{}", topic.topic.name);
        assert!(topic.columns.iter().all(|column| column.values.len() == rows), "{}", topic.topic.name);
        assert_eq!(topic.columns.len(), topic.topic.fields.len(), "{}", topic.topic.name);
    }
    let losses = &found.summary.losses;
    assert!(losses.len() as u64 <= found.summary.lost_parts);
    assert!(losses.iter().all(|loss| loss.offset <= bytes.len() as u64), "{losses:?}");
}
