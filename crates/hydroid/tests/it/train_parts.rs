//! Parts of the training: Adam, step-size schedules, averages of networks.

use std::sync::Arc;

use hydroid::train::Schedule;
use hydroid::train::adam::{Adam, clip};
use hydroid::train::schedule::rate;
use hydroid::train::weight_average::weight_average;
use hydroid_core::actuator::Map;
use hydroid_core::control::{Affine as _, AffineNetwork, Motion};
use hydroid_core::model::affine::{ControlAffine, Effector};
use hydroid_core::model::direct::Perceptron;
use hydroid_core::model::recurrent::Scaling;

/// Three steps by hand: with gradients 1, 1, -2 the moments are
/// m = 0.1, 0.19, -0.029 and v = 0.001, 0.001999, 0.005997001.
#[test]
fn steps_of_adam_are_those_of_the_paper() {
    let (mut adam, mut w) = (Adam::new(1), [0.5f64]);
    let mut expected = 0.5;
    for (t, g, m, v) in [(1, 1.0, 0.1, 0.001), (2, 1.0, 0.19, 0.001_999), (3, -2.0, -0.029, 0.005_997_001)] {
        adam.step(&mut w, &[g], 0.01, 0.1);
        let (m_hat, v_hat): (f64, f64) = (m / (1.0 - 0.9f64.powi(t)), v / (1.0 - 0.999f64.powi(t)));
        expected = expected - 0.01 * 0.1 * expected - 0.01 * m_hat / (v_hat.sqrt() + 1e-8);
        assert!((w[0] - expected).abs() < 1e-12, "step {t}: {} {expected}", w[0]);
    }
    // The first step has the length of the step size for any gradient.
    let (mut adam, mut w) = (Adam::new(2), [0.0f64; 2]);
    adam.step(&mut w, &[1e-3, -1e3], 0.01, 0.0);
    assert!((w[0] + 0.01).abs() < 1e-6 && (w[1] - 0.01).abs() < 1e-6);
}

/// A decay of 1e-8 per step, less than the resolution of the weights, acts through the steps.
#[test]
fn a_small_weight_decay_acts_in_single_precision() {
    let end = |decay: f64| {
        let (mut adam, mut w, mut state) = (Adam::new(1), [1.0f32], 1u64);
        for _ in 0..100_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            adam.step(&mut w, &[(state >> 33) as f32 / (1u64 << 30) as f32 - 1.0], 1e-4, decay);
        }
        f64::from(w[0])
    };
    let ratio = end(1e-4) / end(0.0);
    assert!((ratio - (-1e-3f64).exp()).abs() < 1e-4, "{ratio}");
}

#[test]
fn only_long_gradients_are_clipped() {
    let mut g = [3.0f64, -4.0];
    assert_eq!(clip(&mut g, 10.0), 5.0);
    assert_eq!(g, [3.0, -4.0]);
    assert_eq!(clip(&mut g, 1.0), 5.0);
    assert!((g[0] - 0.6).abs() < 1e-15 && (g[1] + 0.8).abs() < 1e-15);
    assert!(clip(&mut [f32::NAN], 1.0).is_nan());
}

fn close(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-14, "{a} {b}");
}

#[test]
fn schedules_are_their_closed_forms() {
    for done in [0, 17, 1000] {
        close(rate(Schedule::Constant, 0.3, done, 1000), 0.3);
    }
    // The cosine at its start, a third, half and end.
    for (done, share) in [(0, 1.0), (300, 0.01 + 0.99 * 0.75), (450, 0.01 + 0.99 * 0.5), (900, 0.01)] {
        close(rate(Schedule::Cosine, 2.0, done, 900), 2.0 * share);
    }
    // The cycle: start, half-way up, peak, a third of the way down, end.
    for (done, share) in [
        (0, 0.04),
        (50, 0.04 + 0.96 * 0.5),
        (100, 1.0),
        (400, 0.001 + 0.999 * 0.75),
        (550, 0.001 + 0.999 * 0.5),
        (1000, 0.001),
    ] {
        close(rate(Schedule::OneCycle, 0.01, done, 1000), 0.01 * share);
    }
}

fn network(hidden: &[usize], seed: usize) -> ControlAffine {
    let network = Perceptron { inputs: 3, hidden: hidden.to_vec(), outputs: 9 };
    let weights = (0..network.weights()).map(|k| 0.5 * ((k * (seed + 3)) as f64).sin()).collect();
    let lag = |factor: f64| factor * (1.0 + seed as f64);
    ControlAffine {
        weights,
        scaling: Scaling {
            output_mean: vec![1.0, 0.1, 0.0],
            output_scale: vec![2.0, 0.5, 0.3],
            input_mean: vec![0.0; 2],
            input_scale: vec![1.0; 2],
            correction_scale: vec![0.7, 0.3, 0.4],
        },
        effectors: vec![
            Effector { map: Map::Identity, time_constant_s: lag(1.0), unit: 100.0 },
            Effector { map: Map::Sine, time_constant_s: lag(0.1), unit: 0.5 },
        ],
        dt: 0.1,
        wash_out: 10,
        network,
    }
}

#[test]
fn f_and_g_of_the_mean_are_the_means() {
    for hidden in [&[4][..], &[4, 3]] {
        let models: Vec<ControlAffine> = (0..3).map(|seed| network(hidden, seed)).collect();
        let mean = weight_average(&models).unwrap();
        assert_eq!(mean.check(), Ok(()));
        assert!((mean.effectors[1].time_constant_s - 0.1 * 6.0_f64.cbrt()).abs() < 1e-12);
        let at = |model: &ControlAffine| {
            let mut motion = Motion::new(2);
            AffineNetwork::new(Arc::new(model.clone())).unwrap().evaluate([1.7, -0.2, 0.1], &mut motion);
            motion
        };
        let (ours, each) = (at(&mean), models.iter().map(at).collect::<Vec<Motion>>());
        for j in 0..3 {
            let of = |value: fn(&Motion, usize) -> f64| {
                (value(&ours, j), each.iter().map(|m| value(m, j)).sum::<f64>() / 3.0)
            };
            for (ours, theirs) in [of(|m, j| m.f[j]), of(|m, j| m.g[0][j]), of(|m, j| m.g[1][j])] {
                assert!((ours - theirs).abs() < 1e-14, "{hidden:?} {j}: {ours} {theirs}");
            }
        }
    }
    assert_eq!(weight_average(&[]), None);
}
