//! MCAP: the samples, written files, and damage.

use crate::ros::{assert_sample, expected, read_all};
use crate::sample;

#[test]
fn samples_have_the_stated_messages() {
    let Some(expected) = expected() else { return };
    for name in ["otter_zstd.mcap", "otter_lz4.mcap"] {
        let (all, summary) = read_all(&sample::file(name).expect("a sample")).expect("read");
        assert_sample(&all, &expected, true);
        assert_eq!(all.topics.len(), 5);
        assert_eq!(summary.losses, []);
        assert_eq!(summary.notes, [""; 0]);
    }
}
