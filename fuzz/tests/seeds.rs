//! Each target runs over its seeds: inputs of every kind, and those of earlier findings.

use std::path::Path;

use hydroid_fuzz::{TARGETS, targets};

fn seeds(target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("seeds").join(target);
    let files = std::fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<_> = files.map(|file| file.unwrap().path()).collect();
    paths.sort();
    paths.into_iter().map(|path| (path.display().to_string(), std::fs::read(&path).unwrap())).collect()
}

#[test]
fn every_target_runs_over_its_seeds() {
    for (name, target) in TARGETS {
        let seeds = seeds(name);
        assert!(!seeds.is_empty(), "{name} has no seeds");
        for (path, bytes) in seeds {
            println!("{path}");
            target(&bytes);
        }
    }
}

/// The repair knows the layout of the format: sums that do not fit would hide the steps from the target.
#[test]
fn recordings_are_replayed_after_the_repair() {
    let seeds = seeds("blackbox");
    let recorded: Vec<_> = seeds.iter().filter(|(path, _)| path.contains("/seed-")).collect();
    assert!(recorded.len() > 2);
    for (path, bytes) in recorded {
        assert!(targets::blackbox::replayed(bytes).unwrap() > 2, "{path}");
    }
}
