//! The control-affine network, compared with equivalent equations, and as a model that control laws invert.

use std::sync::Arc;

use hydroid_core::actuator::{Lag, Map};
use hydroid_core::control::{Affine, AffineNetwork, Motion};
use hydroid_core::model::affine::{ControlAffine, ControlAffineSession, Effector};
use hydroid_core::model::direct::Perceptron;
use hydroid_core::model::recurrent::Scaling;
use hydroid_core::model::sparse::{Equations, EquationsSession, Factor, Real, Shape, Signal, Term};
use hydroid_core::predict::{Predictor, Workspace};
use proptest::prelude::*;

const DT: f64 = 0.1;

fn wild(k: usize) -> f64 {
    (12.9898 * (k + 1) as f64).sin()
}

/// A propeller with a lag, and a rudder with a fast lag that acts by its sine.
fn network(hidden: Vec<usize>) -> ControlAffine {
    let network = Perceptron { inputs: 3, hidden, outputs: 9 };
    let weights = (0..network.weights()).map(|k| 0.4 * wild(k)).collect();
    let scaling = Scaling {
        output_mean: vec![2.0, 0.1, -0.1],
        output_scale: vec![1.5, 0.4, 0.3],
        input_mean: vec![100.0, 0.0],
        input_scale: vec![90.0, 0.3],
        correction_scale: vec![1.2, 0.3, 0.5],
    };
    let effectors = vec![
        Effector { map: Map::Identity, time_constant_s: 0.7, unit: 200.0 },
        Effector { map: Map::Sine, time_constant_s: 0.02, unit: 0.5 },
    ];
    ControlAffine { network, weights, scaling, effectors, dt: DT, wash_out: 10 }
}

/// Predictions over 30 samples of a network without hidden layer, and of equivalent equations with `parts` integration
/// steps in a sample: `f` and `g` are linear in the outputs.
fn linear(lags: [f64; 2], parts: usize) -> [Vec<f64>; 2] {
    let mut model = network(Vec::new());
    for (effector, lag) in model.effectors.iter_mut().zip(lags) {
        effector.time_constant_s = lag;
    }
    let one = Shape::Power(1);
    let efforts = [None, Some((5, one, 200.0)), Some((6, Shape::Sin, 0.5))];
    let (mut terms, mut coefficients) = (Vec::new(), vec![Vec::new(); 3]);
    for (i, effort) in efforts.into_iter().enumerate() {
        let factors = |variable: Option<u16>| {
            let effort = effort.map(|(variable, shape, _)| Factor { variable, shape });
            Term::new(
                variable.map(|variable| Factor { variable, shape: one }).into_iter().chain(effort).collect(),
            )
        };
        let unit = effort.map_or(1.0, |(.., unit)| unit);
        terms.push(factors(None));
        terms.extend((0..3).map(|variable| factors(Some(variable))));
        for (j, row) in coefficients.iter_mut().enumerate() {
            let line = &model.weights[(3 * i + j) * 3..][..3];
            let s = &model.scaling;
            let size = s.correction_scale[j] / unit;
            let offset: f64 = (0..3).map(|k| line[k] * s.output_mean[k] / s.output_scale[k]).sum();
            row.push(size * (model.weights[27 + 3 * i + j] - offset));
            row.extend((0..3).map(|k| size * line[k] / s.output_scale[k]));
        }
    }
    let lags = [3, 4]
        .into_iter()
        .zip(lags)
        .map(|(input, seconds)| Signal::Lag { input, time_constant_s: Real(seconds) })
        .collect();
    let equations = Equations::with_signals(terms, coefficients.concat(), 3, 2, lags, DT, parts).unwrap();
    let mut sessions: [Box<dyn Predictor>; 2] = [
        Box::new(EquationsSession::new(Arc::new(equations))),
        Box::new(ControlAffineSession::new(Arc::new(model)).unwrap()),
    ];
    let commands: Vec<f64> =
        (0..60).map(|k| if k % 2 == 0 { 100.0 + 80.0 * wild(k) } else { 0.4 * wild(k) }).collect();
    sessions.each_mut().map(|session| {
        let mut y = vec![0.0; 90];
        // Outputs measured in turns, and a missing sample.
        session.observe(&[1.8, f64::NAN, 0.1]);
        session.advance(&[50.0, 0.1]);
        session.observe(&[1.9, 0.05, 0.1]);
        session.advance(&[150.0, -0.3]);
        session.observe(&[2.0, f64::NAN, 0.12]);
        session.rollout(&commands, &mut Workspace::new(), &mut y);
        y
    })
}

fn farthest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / (1.0 + b.abs())).fold(0.0, f64::max)
}

#[test]
fn a_linear_network_equals_linear_equations() {
    let [equations, network] = linear([0.7, 1.5], 1);
    assert!(farthest(&network, &equations) < 1e-6, "{}", farthest(&network, &equations));
}

/// Equations hold a lag at its value at the start of a step. For a lag much faster than a sample this is an error of a
/// sixth.
#[test]
fn fast_actuator_lags_are_integrated_within_a_sample() {
    for lags in [[0.7, 0.02], [0.05, 0.002], [0.03, 0.2]] {
        let [exact, network] = linear(lags, 200);
        let [plain, _] = linear(lags, 1);
        let (ours, theirs) = (farthest(&network, &exact), farthest(&plain, &exact));
        assert!(ours < 0.2 * theirs && ours < 0.003, "{lags:?}: {ours}, without {theirs}");
    }
}

proptest! {
    /// `f + sum g phi` equals the rate of the session over a very short sample.
    #[test]
    fn f_and_g_are_the_rates_of_the_session(
        u in -1.0..6.0f64, v in -1.0..1.0f64, r in -0.6..0.6f64, force in -100.0..300.0f64, angle in -0.5..0.5f64,
    ) {
        let model = ControlAffine { dt: 1e-6, ..network(vec![12, 7]) };
        let mut affine = AffineNetwork::new(Arc::new(model.clone())).unwrap();
        let mut session = ControlAffineSession::new(Arc::new(model)).unwrap();
        let mut motion = Motion::new(2);
        affine.evaluate([u, v, r], &mut motion);
        session.observe(&[u, v, r]);
        session.advance(&[force, angle]);
        let mut y = [0.0; 3];
        session.output(&mut y);
        for (j, (y, before)) in y.iter().zip([u, v, r]).enumerate() {
            let efforts = motion.g[0][j] * force + motion.g[1][j] * angle.sin();
            prop_assert!(((y - before) / 1e-6 - motion.f[j] - efforts).abs() < 1e-4);
        }
        let lag = |i: usize| affine.channels()[i].lag;
        prop_assert_eq!([lag(0), lag(1)], [0.7, 0.02].map(Lag::of_time_constant));
    }
}

#[test]
fn invalid_arguments_are_refused_with_a_reason() {
    let good = network(vec![4]);
    let told = |model: ControlAffine| ControlAffineSession::new(Arc::new(model)).unwrap_err().to_string();
    let mut wrong = good.clone();
    wrong.effectors[0].time_constant_s = 0.0;
    assert_eq!(told(wrong), "a time constant is 0: a positive number is needed");
    let mut wrong = good.clone();
    wrong.effectors.pop();
    assert_eq!(told(wrong), "the network gives 9 numbers, and outputs and inputs need 6");
    let mut wrong = good.clone();
    wrong.weights[3] = f64::NAN;
    assert!(ControlAffineSession::new(Arc::new(wrong.clone())).is_err());
    assert!(AffineNetwork::new(Arc::new(wrong)).is_err());
}
