//! ROS 1 bags: the sample, written files, and damage.

use crate::ros::{assert_sample, expected, read_all};
use crate::sample;

#[test]
fn sample_has_the_stated_messages() {
    let Some(expected) = expected() else { return };
    let (all, summary) = read_all(&sample::file("otter_ros1.bag").expect("a sample")).expect("read");
    assert_sample(&all, &expected, true);
    assert_eq!(all.topics.len(), 5);
    assert_eq!(summary.losses, []);
    assert_eq!(summary.notes, [""; 0]);
}
