//! Sensors with known faults.

use alloc::vec::Vec;

use super::*;

/// Noise and its usual deviation from a line.
const NOISE: f64 = 0.01;

/// Motion per sample that the model predicts too much.
const DRIFT: f64 = 0.002;

/// White noise of about unit variance.
fn noise(k: u64) -> f64 {
    let mut x = k.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x1234_5678;
    let mut sum = 0.0;
    for _ in 0..12 {
        x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        sum += (x >> 33) as f64 / f64::from(1_u32 << 31);
    }
    sum - 6.0
}

/// Verdicts on measurements with the motion that a model predicts. The estimate of the model is the last used measurement.
fn judge(sensor: &mut Sensor, count: u64, sample: impl Fn(u64) -> (f64, f64)) -> Vec<Verdict> {
    let options = GuardOptions::new(0.1);
    let mut estimate = f64::NAN;
    let one = |k| {
        let (y, motion) = sample(k);
        let predicted = if estimate.is_nan() { y } else { estimate + motion };
        if k % 4 == 0 {
            let error = DRIFT * options.horizon as f64;
            sensor.horizon_error.add(error, options.gate, options.window / options.stride);
        }
        let verdict = sensor.judge(y, predicted, motion, true, &options);
        estimate = if verdict == Verdict::Used { y } else { predicted };
        verdict
    };
    (0..count).map(one).collect()
}

/// Verdicts on a `truth` with noise and a fault. The model predicts the motion up to a steady drift.
fn verdicts(truth: impl Fn(u64) -> f64, fault: impl Fn(u64, f64) -> f64) -> Vec<Verdict> {
    judge(&mut Sensor::new(NOISE), 400, |k| {
        (fault(k, truth(k) + NOISE * noise(k)), truth(k) - truth(k.saturating_sub(1)) + DRIFT)
    })
}

fn index(at: u64) -> usize {
    usize::try_from(at).unwrap()
}

fn wave(k: u64) -> f64 {
    (0.02 * k as f64).sin()
}

fn unused(all: &[Verdict]) -> Vec<usize> {
    all.iter().enumerate().filter(|(_, v)| **v != Verdict::Used).map(|(k, _)| k).collect()
}

/// A normal deviate exceeds four deviations with a probability of 6e-5, in 12,000 samples 0.8 times.
#[test]
fn noise_is_sound() {
    let unused: usize = (0..30_u64)
        .map(|run| {
            let sample = |k| (wave(k) + NOISE * noise(1000 * run + k), 0.0);
            unused(&judge(&mut Sensor::new(NOISE), 400, sample)).len()
        })
        .sum();
    assert!(unused <= 3, "{unused}");
}

#[test]
fn spikes_are_not_used_alone_and_side_by_side() {
    for spikes in [
        &[(250, 0.5)][..],
        &[(250, 0.2), (251, -3.0)],
        &[(250, 1.2), (252, -1.8), (253, 3.0)],
        &[(250, 5.0), (251, 5.2), (252, 5.1)],
    ] {
        let all =
            verdicts(wave, |k, x| x + spikes.iter().find(|(at, _)| *at == k).map_or(0.0, |(_, size)| *size));
        assert_eq!(unused(&all), spikes.iter().map(|(at, _)| index(*at)).collect::<Vec<_>>());
    }
}

/// The usual deviation from the line is 1.27 times the noise. A spike of eight is missed if four oppose it.
#[test]
fn spikes_of_eight_deviations_are_found_in_99_percent() {
    let is_found = |at: &u64| {
        let all = verdicts(wave, |k, x| if k == *at { x + 8.0 * 0.0127 } else { x });
        unused(&all).contains(&index(*at))
    };
    let found = (150..350).filter(is_found).count();
    assert!(found >= 198, "{found} of 200");
}

/// A wrong value is held back as long as the prediction is worth more, and the end of the fault ends the hold.
#[test]
fn a_jump_is_held_back_until_it_ends() {
    for (len, size) in [(5, 0.3), (30, 0.5), (100, 2.0)] {
        let fault = 200..200 + len;
        let all = verdicts(wave, |k, x| if fault.contains(&k) { x + size } else { x });
        assert_eq!(unused(&all), (200..200 + index(len)).collect::<Vec<_>>(), "{len} samples of {size}");
    }
}

#[test]
fn a_hold_begins_only_if_it_is_permitted_and_ends_when_it_is_released() {
    let options = GuardOptions::new(0.1);
    let mut sensor = Sensor::new(NOISE);
    judge(&mut sensor, 200, |k| (NOISE * noise(k), 0.0));
    assert_eq!(sensor.clone().judge(5.0, 0.0, 0.0, false, &options), Verdict::Used);
    assert!(matches!(sensor.judge(5.0, 0.0, 0.0, true, &options), Verdict::Unused { .. }));
    assert_eq!(sensor.unused(), Some(1));
    sensor.release();
    assert_eq!(sensor.unused(), None);
    assert_eq!(sensor.judge(5.01, 0.0, 0.0, true, &options), Verdict::Used);
}

/// Motion that the model does not predict has no jump: one or two measurements at each sudden change of the acceleration
/// are not used.
#[test]
fn holds_of_a_vessel_that_does_what_no_model_expects_end() {
    // The speed rises by 2 m/s within a second; it takes off; it turns.
    let take_off = [0.0, 0.06, 0.15, 0.27, 0.4, 0.5, 0.56, 0.58];
    let motions: [&dyn Fn(u64) -> f64; 3] = [
        &|k| 0.2 * k.saturating_sub(200).min(10) as f64,
        &|k| take_off[k.saturating_sub(200).min(7) as usize],
        &|k| 0.03 * k.saturating_sub(200) as f64,
    ];
    for motion in motions {
        let all = verdicts(wave, |k, x| x + motion(k));
        assert!(unused(&all).len() <= 7, "{:?}", unused(&all));
    }
}

/// A jump of the model alone is a fault of the model.
#[test]
fn a_model_that_jumps_accuses_no_sensor() {
    let all = judge(&mut Sensor::new(NOISE), 300, |k| {
        (wave(k) + NOISE * noise(k), wave(k) - wave(k.saturating_sub(1)) + if k == 200 { 1.0 } else { 0.0 })
    });
    assert_eq!(unused(&all), []);
}

#[test]
fn without_predictions_nothing_is_judged_and_the_check_recovers() {
    let all = judge(&mut Sensor::new(NOISE), 400, |k| {
        let spike = if k == 150 || k == 300 { 1.0 } else { 0.0 };
        (wave(k) + NOISE * noise(k) + spike, if (140..200).contains(&k) { f64::NAN } else { 0.0 })
    });
    assert_eq!(unused(&all), [300]);
}

#[test]
fn a_sensor_that_repeats_itself_is_stuck_and_comes_back() {
    let held = core::cell::Cell::new(0.0);
    let all = verdicts(wave, |k, x| {
        if !(200..260).contains(&k) {
            held.set(x);
        }
        held.get()
    });
    assert!(all[202..260].iter().all(|v| matches!(v, Verdict::Stuck { .. })), "{:?}", &all[198..206]);
    assert!(all[260..].iter().all(|verdict| *verdict == Verdict::Used), "{:?}", &all[258..270]);
}

#[test]
fn a_coarse_sensor_is_not_stuck() {
    let all = verdicts(wave, |_, x| (x / 0.05).round() * 0.05);
    assert!(all.iter().all(|verdict| *verdict == Verdict::Used), "{:?}", unused(&all));
}

/// A number far beyond any range leaves no trace in what is usual, once a line is known.
#[test]
fn one_absurd_value_changes_nothing_for_long() {
    for at in [6, 50, 250] {
        let all = verdicts(wave, |k, x| match k {
            _ if k == at => 1e200,
            350 => x + 0.2,
            _ => x,
        });
        assert!(matches!(all[350], Verdict::Unused { .. }), "{at}: {:?}", unused(&all));
    }
}
