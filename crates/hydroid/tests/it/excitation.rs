//! Shapes of command signals.

use hydroid::excitation::{Segment, Shape, Signal};

fn sampled(shape: Shape, duration_s: f64, n: usize) -> Vec<f64> {
    Signal { segments: vec![Segment { shape, duration_s }] }.sample(0.1, n)
}

#[test]
fn steps_share_the_time() {
    let samples = sampled(Shape::Steps { levels: vec![1.0, -2.0, 3.0] }, 0.6, 7);
    assert_eq!(samples, [1.0, 1.0, -2.0, -2.0, 3.0, 3.0, 0.0]);
}

#[test]
fn ramp_and_triangle_are_straight() {
    let ramp = sampled(Shape::Ramp { from: 1.0, to: 2.0 }, 1.0, 10);
    assert!((ramp[5] - 1.5).abs() < 1e-12 && ramp[0] == 1.0);
    let triangle = sampled(Shape::Triangle { low: -1.0, high: 1.0, period_s: 0.8 }, 1.6, 16);
    for (ours, theirs) in triangle.iter().zip([-1.0, -0.5, 0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0]) {
        assert!((ours - theirs).abs() < 1e-12, "{triangle:?}");
    }
}

#[test]
fn a_chirp_sweeps_through_its_cycles() {
    // From 0.2 to 0.6 Hz in 20 s: 8 cycles on average, so 16 changes of sign.
    let chirp = sampled(Shape::Chirp { centre: 0.0, amplitude: 2.0, from_hz: 0.2, to_hz: 0.6 }, 20.0, 200);
    let changes = chirp[1..].windows(2).filter(|w| w[0].signum() != w[1].signum()).count();
    assert!((15..=16).contains(&changes), "{changes}");
    assert!(chirp.iter().all(|x| x.abs() <= 2.0));
}

#[test]
fn a_prbs_has_full_length_and_balance_and_holds_its_bits() {
    const PERIOD: usize = 32_767;
    for start in [0, 0x2a5] {
        let prbs = |hold_s: f64, n: usize| {
            let shape = Shape::Prbs { low: -1.0, high: 1.0, hold_s, start };
            sampled(shape, 0.1 * (n + 1) as f64, n)
        };
        let bits = prbs(0.1, 2 * PERIOD);
        let (first, second) = bits.split_at(PERIOD);
        assert_eq!(first, second);
        assert_eq!(first.iter().filter(|bit| **bit == 1.0).count(), 16_384);
        // The largest divisors of the period: a shorter period would divide one of them.
        for shorter in [PERIOD / 7, PERIOD / 31, PERIOD / 151] {
            assert!((0..PERIOD).any(|k| bits[k] != bits[k + shorter]), "{shorter}");
        }
        let held = prbs(0.3, 300);
        assert!(held.chunks(3).zip(&bits).all(|(samples, bit)| samples.iter().all(|x| x == bit)));
    }
}

#[test]
fn segments_join_without_gap() {
    let hold = |level: f64| Segment { shape: Shape::Steps { levels: vec![level] }, duration_s: 0.3 };
    let signal = Signal { segments: vec![hold(1.0), hold(2.0), hold(3.0)] };
    assert_eq!(signal.sample(0.1, 10), [1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 0.0]);
}
