//! Sensors with known faults.

use alloc::vec::Vec;

use super::*;

const NOISE: f64 = 0.01;

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

fn wave(k: u64) -> f64 {
    (0.02 * k as f64).sin()
}

/// Verdicts on `truth` with noise and a fault. The model expects `expected`.
fn verdicts(
    count: u64,
    truth: impl Fn(u64) -> f64,
    expected: impl Fn(u64) -> f64,
    fault: impl Fn(u64, f64) -> f64,
) -> Vec<Verdict> {
    let options = GuardOptions::new(0.1);
    let mut sensor = Sensor::new();
    (0..count).map(|k| sensor.judge(fault(k, truth(k) + NOISE * noise(k)), expected(k), &options)).collect()
}

fn count(all: &[Verdict], of: impl Fn(&Verdict) -> bool) -> usize {
    all.iter().filter(|verdict| of(verdict)).count()
}

fn found(all: &[Verdict]) -> Option<f64> {
    all.iter().find_map(|v| if let Verdict::Offset { offset } = v { Some(*offset) } else { None })
}

fn is_spike(verdict: &Verdict) -> bool {
    matches!(verdict, Verdict::Spike { .. })
}

#[test]
fn noise_is_sound() {
    let all = verdicts(50_000, wave, wave, |_, x| x);
    let alarms = count(&all, |verdict| *verdict != Verdict::Sound);
    assert!(alarms <= 50, "{alarms} false alarms in 50,000 samples");
}

#[test]
fn spikes_of_eight_usual_deviations_are_rejected() {
    // The usual deviation of an innovation: noise, and the error of the prediction (1.23 deviations for the motion).
    let size = 8.0 * 1.23 * NOISE;
    let is_hit = |k: u64| k > 300 && k.is_multiple_of(37);
    let all = verdicts(20_000, wave, wave, |k, x| if is_hit(k) { x + size } else { x });
    let hit: Vec<bool> =
        (0..).zip(&all).filter(|(k, _)| is_hit(*k)).map(|(_, verdict)| is_spike(verdict)).collect();
    let caught = hit.iter().filter(|hit| **hit).count();
    assert!(100 * caught >= 99 * hit.len(), "{caught} of {}", hit.len());
    assert_eq!(found(&all), None);
}

#[test]
fn neighbouring_spikes_leave_no_offset() {
    for [first, second, third] in [[0.5, 0.45, 0.5], [5.0, -0.3, 5.2], [0.3, 2.0, -4.0], [-3.0, 0.4, -2.0]] {
        let all = verdicts(300, wave, wave, |k, x| match k {
            250 => x + first,
            251 => x + second,
            252 => x + third,
            _ => x,
        });
        assert!(all[250..253].iter().all(is_spike), "{:?}", &all[248..256]);
        assert!(all[254..].iter().all(|verdict| *verdict == Verdict::Sound), "{:?}", &all[248..262]);
    }
}

/// Of jumps, those of twelve deviations are found in nine of ten cases within a second.
#[test]
fn jumps_are_found_and_subtracted() {
    for (size, least) in [(12.0, 45), (20.0, 48), (100.0, 50)] {
        let (mut hits, mut square) = (0, 0.0);
        for at in (200..1200).step_by(20) {
            let sign = if at % 40 == 0 { 1.0 } else { -1.0 };
            let all = verdicts(at + 10, wave, wave, |k, x| if k >= at { x + sign * size * NOISE } else { x });
            if let Some(offset) = found(&all) {
                hits += 1;
                square += (offset / NOISE - sign * size).powi(2);
            }
        }
        assert!(hits >= least, "{hits} of 50 jumps of {size} deviations");
        let error = (square / f64::from(hits)).sqrt();
        assert!(error < 1.5, "the offset is wrong by {error} deviations of the noise");
    }
}

/// The vessel takes off, and the model does not know.
#[test]
fn motion_that_the_model_does_not_expect_is_no_offset() {
    let gathers = |k: u64| wave(k) + 0.15 * (k.saturating_sub(200) as f64).min(20.0);
    let all = verdicts(300, gathers, wave, |_, x| x);
    assert_eq!(found(&all), None);
    let rejected = count(&all[195..225], is_spike);
    assert!(rejected <= 12, "{rejected} rejected: {:?}", &all[198..215]);
    assert!(all[230..].iter().all(|verdict| *verdict == Verdict::Sound));
}

#[test]
fn a_sensor_that_repeats_itself_is_stuck_and_comes_back() {
    let held = core::cell::Cell::new(0.0);
    let all = verdicts(400, wave, wave, |k, x| {
        if !(200..260).contains(&k) {
            held.set(x);
        }
        held.get()
    });
    assert!(all[202..260].iter().all(|v| matches!(v, Verdict::Stuck { .. })), "{:?}", &all[198..206]);
    assert!(all[260..].iter().all(|verdict| *verdict == Verdict::Sound), "{:?}", &all[258..270]);
}

#[test]
fn a_coarse_sensor_is_not_stuck() {
    let all = verdicts(400, wave, wave, |_, x| (x / 0.05).round() * 0.05);
    assert_eq!(count(&all, |verdict| matches!(verdict, Verdict::Stuck { .. })), 0);
}

/// After an outage nothing is judged by predictions from before.
#[test]
fn a_vessel_that_moved_during_an_outage_has_no_fault() {
    let all = verdicts(
        400,
        |k| if k < 250 { 0.0 } else { 1.0 },
        |k| if k < 253 { 0.0 } else { 1.0 },
        |k, x| {
            if (200..250).contains(&k) { f64::NAN } else { x }
        },
    );
    assert!(all[200..250].iter().all(|verdict| *verdict == Verdict::Missing));
    assert!(all[250..].iter().all(|verdict| *verdict == Verdict::Sound), "{:?}", &all[248..262]);
}
