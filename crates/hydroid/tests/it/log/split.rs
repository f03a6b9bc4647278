//! The split of runs into training, validation and test.

use hydroid::log::{Channel, LogError, Split, Table, Trajectory, split_named, split_runs};

fn run(name: &str, samples: usize) -> Trajectory {
    let table = |c: &str| Table::new(vec![Channel::new(c, "")], (0..samples).map(|k| k as f64).collect());
    Trajectory {
        name: name.into(),
        t0: 0.0,
        dt: 0.1,
        outputs: table("u"),
        inputs: table("n"),
        truth: None,
        heading: None,
        position: None,
    }
}

fn sizes(runs: &[(&str, usize)]) -> [Vec<(String, usize)>; 3] {
    let split = split_runs(runs.iter().map(|(n, s)| run(n, *s)).collect()).unwrap();
    assert_eq!(split.notes.len(), 1);
    [split.train, split.validation, split.test]
        .map(|part| part.iter().map(|r| (r.name.clone(), r.len())).collect())
}

fn names(runs: &[(&str, usize)]) -> [String; 3] {
    sizes(runs).map(|part| part.iter().map(|p| p.0.as_str()).collect::<Vec<_>>().join(" "))
}

#[test]
fn whole_runs_or_blocks_of_the_last_ones_are_held_back() {
    for (runs, parts) in [
        (&[("a", 100), ("b", 100), ("c", 100)][..], ["a", "b", "c"]),
        (&[("a", 100), ("b", 100), ("c", 100), ("d", 100)], ["a b", "c", "d"]),
        // A very short run is not a test.
        (&[("a", 100), ("b", 100), ("c", 100), ("d", 3)], ["a d", "b", "c"]),
        (&[("x", 3), ("a", 100), ("y", 3)], ["x a[0..60] y", "a[60..80]", "a[80..100]"]),
        (&[("a", 100), ("b", 80)], ["a[0..75]", "a[75..100]", "b"]),
        (&[("a", 3), ("b", 100)], ["a b[0..60]", "b[60..80]", "b[80..100]"]),
    ] {
        assert_eq!(names(runs), parts);
    }
    assert_eq!(
        sizes(&[("a", 100)]).map(|p| p[0].clone()),
        [("a[0..60]".into(), 60), ("a[60..80]".into(), 20), ("a[80..100]".into(), 20)]
    );
}

#[test]
fn named_runs_are_kept_and_a_missing_validation_is_taken_from_training() {
    let named = |train: &[(&str, usize)], validation: &[(&str, usize)], test: &[(&str, usize)]| {
        let runs = |part: &[(&str, usize)]| part.iter().map(|(n, s)| run(n, *s)).collect();
        split_named(runs(train), runs(validation), runs(test))
    };
    let names = |split: Split| {
        [split.train, split.validation, split.test]
            .map(|part| part.iter().map(|r| r.name.clone()).collect::<Vec<_>>().join(" "))
    };
    let all = named(&[("a", 100), ("b", 50)], &[("c", 10)], &[("d", 10)]).unwrap();
    assert_eq!(names(all), ["a b", "c", "d"]);
    let no_validation = named(&[("a", 50), ("b", 100)], &[], &[("d", 10)]).unwrap();
    assert_eq!(names(no_validation), ["a b[0..75]", "b[75..100]", "d"]);
    assert!(matches!(named(&[("a", 100)], &[("c", 10)], &[]), Err(LogError::NoTest)));
    let guessed = named(&[("a", 100), ("b", 100), ("c", 100)], &[], &[]).unwrap();
    assert_eq!(names(guessed), ["a", "b", "c"]);
}

#[test]
fn too_little_is_an_error() {
    assert!(matches!(split_runs(vec![]), Err(LogError::NoFiles)));
    assert!(matches!(split_runs(vec![run("a", 9)]), Err(LogError::TooShort { .. })));
    assert!(split_runs(vec![run("a", 3), run("b", 3)]).is_err());
}
