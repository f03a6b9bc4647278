//! Sensors with known faults.

use alloc::vec::Vec;

use super::*;

mod offsets;
mod spikes;
mod vessel;

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

/// Verdicts on `count` samples of a measurement and the expectations of the models.
fn verdicts_of(sensor: &mut Sensor, count: u64, sample: impl Fn(u64) -> (f64, [f64; 3])) -> Vec<Verdict> {
    let options = GuardOptions::new(0.1);
    let judge = |k: u64| {
        let (value, [a, b, c]) = sample(k);
        sensor.judge(value, [a, b, c], &options)
    };
    (0..count).map(judge).collect()
}

/// Verdicts on `truth` with noise of 0.01 and a fault. The models expect the truth and two deviations from it.
fn verdicts(truth: impl Fn(u64) -> f64, fault: impl Fn(u64, f64) -> f64) -> Vec<Verdict> {
    verdicts_of(&mut Sensor::new(0.01), 400, |k| {
        (fault(k, truth(k) + 0.01 * noise(k)), [truth(k), truth(k) + 0.05, f64::NAN])
    })
}

fn found(all: &[Verdict]) -> Option<f64> {
    all.iter().find_map(|v| if let Verdict::Offset { offset } = v { Some(*offset) } else { None })
}

fn wave(k: u64) -> f64 {
    (0.02 * k as f64).sin()
}

fn heard(k: u64) -> f64 {
    wave(k) + 0.01 * noise(k)
}

#[test]
fn noise_is_sound() {
    assert!(verdicts(wave, |_, x| x).iter().all(|verdict| *verdict == Verdict::Sound));
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
    assert!(all[260..].iter().all(|verdict| *verdict == Verdict::Sound), "{:?}", &all[258..270]);
}

#[test]
fn a_coarse_sensor_is_not_stuck() {
    let all = verdicts(wave, |_, x| (x / 0.05).round() * 0.05);
    let stuck = all.iter().filter(|verdict| matches!(verdict, Verdict::Stuck { .. })).count();
    assert_eq!(stuck, 0);
}

/// At the start of a run models deviate by metres a second and jump: no measurement is judged by them.
#[test]
fn models_that_find_their_states_excuse_nothing_and_accuse_nobody() {
    let mut sensor = Sensor::new(0.01);
    for run in 0..2 {
        sensor.reset();
        let all = verdicts_of(&mut sensor, 230, |k| {
            let offset = if run == 0 && k >= 200 { 0.15 } else { 0.0 };
            let off = if k < 15 && k != 1 { 2.0 - 0.1 * k as f64 } else { 0.0 };
            (heard(k) + offset, [wave(k) + off; 3])
        });
        let found = all.iter().position(|v| matches!(v, Verdict::Offset { .. }));
        assert_eq!(found, (run == 0).then_some(207), "{:?}", &all[..30]);
        assert!(all[..200].iter().all(|verdict| *verdict == Verdict::Sound));
        sensor.offset = 0.0;
    }
}

#[test]
fn models_that_jump_accuse_no_sensor() {
    let all = verdicts_of(&mut Sensor::new(0.01), 230, |k| {
        let off = if k >= 200 { 1.0 } else { 0.0 };
        (heard(k), [wave(k) - off; 3])
    });
    assert!(all.iter().all(|verdict| *verdict == Verdict::Sound));
}
