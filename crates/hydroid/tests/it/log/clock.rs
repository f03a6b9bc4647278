//! The usual step of a clock, and its regularity.

use hydroid::log::Clock;

fn clock(t: &[f64]) -> Clock {
    Clock::of(t, 1.0).unwrap()
}

fn even(rows: u32, start: f64, step: f64) -> Vec<f64> {
    (0..rows).map(|k| start + f64::from(k) * step).collect()
}

#[test]
fn even_clocks_are_regular_and_round_steps_are_recognized() {
    for (step, expected) in [(0.1, 0.1), (0.100_000_000_000_23, 0.1), (0.05, 0.05), (0.109_5, 0.1095)] {
        let clock = clock(&even(100, 0.0, step));
        assert!(clock.regular && clock.step_s == expected, "{step}: {clock:?}");
    }
    for (t, step, tolerance) in [
        (even(100, 1.7e9, 0.1), 0.1, 1e-8),
        (even(100, 0.0, 0.033_333_333), 0.033_333_333, 1e-15),
        // Stamps rounded to milliseconds.
        (
            even(300, 0.0, 1.0 / 30.0).iter().map(|t| (t * 1000.0).round() / 1000.0).collect(),
            1.0 / 30.0,
            1e-5,
        ),
    ] {
        let clock = clock(&t);
        assert!(clock.regular && (clock.step_s - step).abs() < tolerance, "{clock:?}");
    }
    assert!(Clock::of(&[1.0], 1.0).is_none());
}

#[test]
fn missing_rows_leave_a_clock_regular_and_jitter_does_not() {
    assert!(clock(&[0.0, 0.1, 0.2, 0.4, 0.5, 0.6, 0.7]).regular);
    assert!(!clock(&[0.0, 0.1, 0.22, 0.3, 0.41, 0.5, 0.62]).regular);
    assert!(clock(&[0.0, 0.1, 0.2, 70.03, 70.13, 70.23]).regular);
}
