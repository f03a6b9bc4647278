//! Damage of the same kinds in a small file of each format, which are the seeds of the fuzz target: the readers end,
//! without a panic, and their losses lie in the file. What the damage costs is tested for each format.

use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

use proptest::prelude::*;

use crate::recorder::{flipped, survives};

static SEEDS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/seeds/recording");
    let files = fs::read_dir(folder).expect("the seeds").map(|file| file.expect("a seed").path());
    let seeds: Vec<_> = files.map(|file| fs::read(file).expect("a seed")).collect();
    assert!(seeds.len() >= 9, "a seed for each format");
    seeds
});

/// Places in a file: 100 to 200 of them, or each, if there are fewer.
fn places(bytes: &[u8]) -> impl Iterator<Item = usize> {
    (0..bytes.len()).step_by(1 + bytes.len() / 200)
}

#[test]
fn a_length_may_be_2_to_the_63_at_each_place() {
    let mut read = 0;
    for seed in &*SEEDS {
        read += usize::from(survives(seed).is_some());
        for place in places(seed) {
            for length in [
                (1u64 << 63).to_le_bytes().to_vec(),
                (1u64 << 63).to_be_bytes().to_vec(),
                // Numbers of variable length: 2^64 - 1 and 2^63.
                [&[0xff; 9][..], &[1]].concat(),
                [&[0x80; 9][..], &[1]].concat(),
            ] {
                let mut bytes = seed.clone();
                let end = bytes.len().min(place + length.len());
                bytes[place..end].copy_from_slice(&length[..end - place]);
                survives(&bytes);
            }
        }
    }
    assert_eq!(read, SEEDS.len(), "the seeds are whole");
}

#[test]
fn a_file_may_end_at_each_place() {
    for seed in &*SEEDS {
        for place in places(seed) {
            survives(&seed[..place]);
        }
    }
}

#[test]
fn flipped_bytes_are_survived() {
    for seed in &*SEEDS {
        flipped(seed, 0, ..);
        // The signs of the formats stay.
        flipped(seed, 16, ..);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn any_bytes_may_be_anywhere(bytes in prop::collection::vec(any::<u8>(), 0..4000), place: prop::sample::Index) {
        for seed in &*SEEDS {
            let (before, after) = seed.split_at(place.index(seed.len()));
            survives(&[before, &bytes, after].concat());
            // Behind the signs of the formats, which have these lengths.
            for end in [before.len(), 3, 4, 8, 13, 16] {
                survives(&[&seed[..end], &bytes].concat());
            }
        }
    }
}
