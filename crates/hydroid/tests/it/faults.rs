//! Injected sensor faults.

use hydroid::faults::{FaultError, Faults};
use hydroid::log::{Channel, Table, Trajectory};
use proptest::prelude::*;

fn run() -> Trajectory {
    let channels = vec![Channel::new("u", "m/s"), Channel::new("r", "rad/s")];
    let values = (0..400).map(|k| (0.01 * f64::from(k)).sin()).collect();
    let inputs = Table::new(vec![Channel::new("n", "")], vec![0.0; 200]);
    Trajectory {
        name: "a".into(),
        t0: 0.0,
        dt: 0.1,
        outputs: Table::new(channels, values),
        inputs,
        truth: None,
        heading: None,
    }
}

#[test]
fn faults_are_injected_at_their_place() {
    let clean = run();
    let faults: Faults = "dropout=u:2s@5, stuck=r:1s@10,bias=u:0.25@15".parse().unwrap();
    let mut runs = [run()];
    faults.inject(&mut runs).unwrap();
    let [faulty] = &runs;
    assert_eq!(faulty.truth.as_ref(), Some(&clean.outputs));
    for k in 0..200 {
        let (row, was) = (faulty.outputs.row(k), clean.outputs.row(k));
        match k {
            50..70 => assert!(row[0].is_nan()),
            150.. => assert_eq!(row[0], was[0] + 0.25),
            _ => assert_eq!(row[0], was[0]),
        }
        let stuck = if (100..110).contains(&k) { clean.outputs.row(99)[1] } else { was[1] };
        assert_eq!(row[1], stuck);
    }
}

#[test]
fn spikes_have_the_given_frequency_and_follow_from_the_seed() {
    let faults = Faults { seed: 3, .."spikes=0.1".parse().unwrap() };
    let made = || {
        let mut runs = [run(), run()];
        faults.inject(&mut runs).unwrap();
        runs
    };
    let [first, second] = made();
    let clean = run();
    let hit = |run: &Trajectory| (0..200).filter(|&k| run.outputs.row(k) != clean.outputs.row(k)).count();
    assert!((20..60).contains(&hit(&first)), "{}", hit(&first));
    assert_ne!(first.outputs, second.outputs, "runs have spikes of their own");
    assert_eq!([first, second], made());
}

#[test]
fn wrong_faults_are_refused() {
    for wrong in [
        "",
        "spikes",
        "spikes=2",
        "spikes=nan",
        "dropout=u",
        "stuck=:5s",
        "bias=v:x",
        "leak=u:3",
        "dropout=u:-1s",
    ] {
        assert!(matches!(wrong.parse::<Faults>(), Err(FaultError::Form(_))), "{wrong}");
    }
    let faults: Faults = "bias=w:1".parse().unwrap();
    let told = faults.inject(&mut [run()]).unwrap_err().to_string();
    assert!(told.contains("'w'") && told.contains("u, r"), "{told}");
}

proptest! {
    #[test]
    fn text_never_panics(text in ".{0,40}", kind in "(spikes|dropout|stuck|bias)=[a-z*]{0,2}:?[-0-9.e]{0,8}s?@?[-0-9.]{0,6}") {
        for text in [text, kind] {
            if let Ok(faults) = text.parse::<Faults>() {
                let _ = faults.inject(&mut [run()]);
            }
        }
    }
}
