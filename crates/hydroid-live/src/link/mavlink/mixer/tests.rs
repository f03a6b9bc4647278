//! The inverse of the mixer against the mixer.

use super::*;

fn mixer() -> Mixer {
    let output = |name: &str, place| crate::Axis::new(name, [1100.0, 1900.0], 1500.0).at(place);
    Mixer::new(vec![output("left", 1), output("right", 3)]).unwrap()
}

fn parameters(name: &str) -> Option<f64> {
    let text = "RCMAP_ROLL 1 RCMAP_THROTTLE 3 MOT_SLEWRATE 100 PILOT_STEER_TYPE 0 RC1_MIN 1100 RC1_TRIM 1500 RC1_MAX 1900 RC1_DZ 30
        RC1_REVERSED 1 RC3_MIN 1050 RC3_TRIM 1500 RC3_MAX 1950 RC3_DZ 30 RC3_REVERSED 0 SERVO1_FUNCTION 73 SERVO1_MIN 1100
        SERVO1_TRIM 1490 SERVO1_MAX 1900 SERVO1_REVERSED 0 SERVO3_FUNCTION 74 SERVO3_MIN 1100 SERVO3_TRIM 1500 SERVO3_MAX 1900
        SERVO3_REVERSED 1";
    let mut words = text.split_whitespace();
    words.find(|word| *word == name)?;
    words.next()?.parse().ok()
}

/// The outputs of ArduPilot for pulses of steering and throttle, from its documentation.
fn autopilot([steer, drive]: [f64; 2]) -> [f64; 2] {
    let of = |name: &str| parameters(name).unwrap();
    let stick = |n: u8, pulse: f64| {
        let [low, trim, high, dz] = ["MIN", "TRIM", "MAX", "DZ"].map(|field| of(&format!("RC{n}_{field}")));
        let sign = 1.0 - 2.0 * of(&format!("RC{n}_REVERSED"));
        let value = if pulse > trim + dz {
            (pulse - trim - dz) / (high - trim - dz)
        } else if pulse < trim - dz {
            (pulse - trim + dz) / (trim - dz - low)
        } else {
            0.0
        };
        sign * value.clamp(-1.0, 1.0)
    };
    let (mut steering, mut throttle) = (stick(1, steer), stick(3, drive));
    if throttle < 0.0 {
        steering = -steering;
    }
    let sum = (steering.abs() + throttle.abs()).max(1.0);
    (steering, throttle) = (steering / sum, throttle / sum);
    let output = |n: u8, value: f64| {
        let [low, trim, high] = ["MIN", "TRIM", "MAX"].map(|field| of(&format!("SERVO{n}_{field}")));
        let value = (1.0 - 2.0 * of(&format!("SERVO{n}_REVERSED"))) * value;
        trim + value * if value > 0.0 { high - trim } else { trim - low }
    };
    [output(1, throttle + steering), output(3, throttle - steering)]
}

#[test]
fn the_mixer_gives_what_is_wanted() {
    let mixer = mixer();
    for left in 0..=20 {
        for right in 0..=20 {
            let wanted = [left, right].map(|k| 1100.0 + 40.0 * f64::from(k));
            let sticks = mixer.pulses(&wanted, &parameters).unwrap();
            let found = autopilot(sticks);
            for (found, wanted) in found.into_iter().zip(wanted) {
                assert!((found - wanted).abs() < 1e-6, "{wanted:?} {found:?}");
            }
        }
    }
    // Pulses are whole, and the outputs within the tolerance of the comparison.
    let sticks = mixer.pulses(&[1733.0, 1212.0], &parameters).unwrap().map(f64::round);
    let found = autopilot(sticks);
    assert!(
        (found[0] - 1733.0).abs() < TOLERANCE_US && (found[1] - 1212.0).abs() < TOLERANCE_US,
        "{found:?}"
    );
}

#[test]
fn other_mixers_are_refused() {
    let mixer = mixer();
    assert_eq!(mixer.refusals(&parameters), Vec::<String>::new());
    let with = |name: &'static str, value: f64| {
        move |asked: &str| if asked == name { Some(value) } else { parameters(asked) }
    };
    for (name, value, words) in [
        ("MOT_THST_EXPO", 0.4, "MOT_THST_EXPO is 0.4"),
        ("RCMAP_THROTTLE", 2.0, "it must be 3"),
        ("SERVO3_FUNCTION", 33.0, "SERVO3_FUNCTION is 33"),
    ] {
        let refusals = mixer.refusals(&with(name, value));
        assert!(refusals.iter().any(|refusal| refusal.contains(words)), "{refusals:?}");
    }
    assert_eq!(mixer.refusals(&|_| None), Vec::<String>::new(), "the helm waits for parameters");
    assert!(mixer.pulses(&[1500.0; 2], &|_| None).is_none());
}

#[test]
fn outputs_that_are_not_wanted_end_the_commands() {
    let (mut mixer, second) = (mixer(), 1_000_000_000);
    let reported = |left: f64, right: f64| [left, 0.0, right];
    // From full ahead, at half a second from end to end, to neutral and to the command.
    mixer.report(&reported(1900.0, 1900.0), &parameters, 0);
    mixer.begin(0);
    mixer.want(&[1700.0, 1300.0], &parameters, second / 10);
    mixer.report(&reported(1900.0, 1900.0), &parameters, second);
    mixer.report(&reported(1600.0, 1505.0), &parameters, 2 * second);
    assert_eq!(mixer.unconfirmed(2 * second), None);
    for k in 1..=20 {
        mixer.want(&[1700.0, 1300.0], &parameters, (2 + k) * second);
        mixer.report(&reported(1700.0, 1305.0), &parameters, (2 + k) * second);
        assert_eq!(mixer.unconfirmed((2 + k) * second), None);
    }
    assert!(mixer.wanted.len() < 10);
    // Another mixer.
    mixer.report(&reported(1500.0, 1305.0), &parameters, 23 * second);
    assert_eq!(mixer.unconfirmed(23 * second), None);
    mixer.report(&reported(1500.0, 1305.0), &parameters, 24 * second);
    let reason = mixer.unconfirmed(24 * second).unwrap();
    assert!(reason.contains("'left' is 1500 us"), "{reason}");
}

/// From rest to one side ahead: the throttle is still at zero when the steering has arrived, and the other side is where it was never
/// wanted.
#[test]
fn outputs_on_their_way_are_those_of_a_throttle_that_lags() {
    let (mut mixer, second) = (mixer(), 1_000_000_000);
    let (from, to) = ([1500.0, 1500.0], [1900.0, 1500.0]);
    let sticks = |wanted: &[f64; 2]| mixer.pulses(wanted, &parameters).unwrap();
    let lagging = autopilot([sticks(&to)[0], sticks(&from)[1]]);
    assert!(lagging[1] < 1400.0 || lagging[1] > 1600.0, "{lagging:?}");
    mixer.report(&[from[0], 0.0, from[1]], &parameters, 0);
    mixer.begin(0);
    for k in 1..=15 {
        mixer.want(&to, &parameters, k * second / 10);
        mixer.report(&[lagging[0], 0.0, lagging[1]], &parameters, k * second / 10);
        assert_eq!(mixer.unconfirmed(k * second / 10), None);
    }
    // Much later it is no way any more.
    for k in 30..=60 {
        mixer.want(&to, &parameters, k * second / 10);
        mixer.report(&[lagging[0], 0.0, lagging[1]], &parameters, k * second / 10);
    }
    assert!(mixer.unconfirmed(6 * second).is_some());
}

#[test]
fn outputs_that_are_not_reported_end_the_commands() {
    let (mut mixer, second) = (mixer(), 1_000_000_000);
    assert!(mixer.unseen(0).unwrap().contains("SERVO_OUTPUT_RAW"));
    mixer.report(&[1500.0, 0.0, 1500.0], &parameters, 0);
    assert_eq!(mixer.unseen(second), None);
    mixer.begin(0);
    for k in 1..30 {
        mixer.want(&[1500.0; 2], &parameters, k * second / 10);
        assert_eq!(mixer.unconfirmed(k * second / 10).is_some(), k > 10);
    }
    assert!(mixer.unconfirmed(3 * second).unwrap().contains("does not report"));
}
