//! ROS 2 bags in SQLite: the sample, written files, and damage.

use crate::ros::{assert_sample, expected, read_all};
use crate::sample;

const SAMPLE: &str = "otter_ros2_sqlite/otter_ros2_sqlite.db3";

#[test]
fn sample_has_the_stated_messages() {
    let Some(expected) = expected() else { return };
    let (all, summary) = read_all(&sample::file(SAMPLE).expect("a sample")).expect("read");
    assert_sample(&all, &expected, true);
    assert_eq!(all.topics.len(), 5);
    assert_eq!(summary.losses, []);
    assert_eq!(summary.notes, [""; 0]);
}
