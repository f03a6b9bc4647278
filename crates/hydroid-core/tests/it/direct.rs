//! The direct predictor: network and gradient compared with PyTorch and finite differences; its session compared with
//! its equations.

use std::sync::Arc;

use hydroid_core::math::Scalar;
use hydroid_core::model::direct::{Batch, Direct, DirectError, DirectSession, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, NetworkError, RecurrentError, Scaling};
use hydroid_core::model::sparse::{Equations, EquationsSession, Real, Signal, Term};
use hydroid_core::predict::{Predictor, Workspace};
use proptest::prelude::*;
use serde_json::Value;

/// Weights as in `tests/peers/direct_golden.py`.
fn ruled(network: &Perceptron) -> Vec<f64> {
    let number = |vector: bool, columns: usize, k: usize| {
        let k = k as f64;
        if vector { 0.1 * k.sin() } else { 0.8 * (0.7 * k + 0.3).sin() / (columns as f64).sqrt() }
    };
    let tensors = network.tensors();
    tensors.iter().flat_map(|t| (0..t.len()).map(move |k| number(t.vector, t.columns, k))).collect()
}

/// Mean square error of a batch whose inputs and targets follow the same rule, its outputs and its gradient.
fn batch<T: Scalar>(network: &Perceptron, weights: &[f64], windows: usize) -> (f64, Vec<f64>, Vec<f64>) {
    let mut batch = Batch::<T>::new(network, windows);
    let lanes = batch.lanes();
    // Lanes without a window have no effect.
    batch.input_mut().fill(T::nan());
    for w in 0..windows {
        for i in 0..network.inputs {
            batch.input_mut()[i * lanes + w] = T::of((0.3 * (w * network.inputs + i) as f64).sin());
        }
    }
    let weights: Vec<T> = weights.iter().map(|&w| T::of(w)).collect();
    batch.forward(&weights);
    let count = (windows * network.outputs) as f64;
    let (mut loss, mut outputs) = (0.0, Vec::new());
    batch.output_adjoint_mut().fill(T::nan());
    for w in 0..windows {
        for i in 0..network.outputs {
            let y = batch.output()[i * lanes + w];
            let error = y - T::of((0.2 * (w * network.outputs + i) as f64).cos());
            outputs.push(y.wide());
            loss += error.wide().powi(2) / count;
            batch.output_adjoint_mut()[i * lanes + w] = T::of(2.0 / count) * error;
        }
    }
    let mut gradient = vec![T::nan(); weights.len()];
    batch.backward(&weights, &mut gradient);
    (loss, outputs, gradient.into_iter().map(T::wide).collect())
}

fn flat(value: &Value, into: &mut Vec<f64>) {
    match value {
        Value::Array(values) => values.iter().for_each(|value| flat(value, into)),
        number => into.push(number.as_f64().unwrap()),
    }
}

fn far(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn outputs_loss_and_gradient_are_those_of_torch() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden/direct/perceptron.json");
    let golden: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let numbers = |value: &Value| {
        let mut numbers = Vec::new();
        flat(value, &mut numbers);
        numbers
    };
    let network = Perceptron { inputs: 11, hidden: vec![17, 6], outputs: 5 };
    assert_eq!(numbers(&golden["sizes"]), [11.0, 17.0, 6.0, 5.0]);
    let gradient: Vec<f64> =
        network.tensors().iter().flat_map(|t| numbers(&golden["gradient"][&t.name])).collect();
    let differences = |(loss, outputs, made): (f64, Vec<f64>, Vec<f64>)| {
        let loss = (loss - golden["loss"].as_f64().unwrap()).abs();
        [loss, far(&outputs, &numbers(&golden["output"])), far(&made, &gradient)]
    };
    let double = differences(batch::<f64>(&network, &ruled(&network), 9));
    assert!(double.iter().all(|d| *d < 1e-14), "{double:?}");
    let single = differences(batch::<f32>(&network, &ruled(&network), 9));
    assert!(single.iter().all(|d| *d < 2e-6), "{single:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Networks of all depths, narrower and wider than vectors and blocks.
    #[test]
    fn the_gradient_is_that_of_finite_differences(
        inputs in 1..40_usize,
        hidden in prop::collection::vec(1..40_usize, 0..4),
        outputs in 1..20_usize,
        windows in 1..40_usize,
    ) {
        let network = Perceptron { inputs, hidden, outputs };
        let mut weights = ruled(&network);
        let (_, _, gradient) = batch::<f64>(&network, &weights, windows);
        let norm = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        for i in (0..weights.len()).step_by(1 + weights.len() / 15) {
            let (at, step) = (weights[i], 1e-5);
            let [plus, minus] = [step, -step].map(|step| {
                weights[i] = at + step;
                batch::<f64>(&network, &weights, windows).0
            });
            weights[i] = at;
            let difference = (plus - minus) / (2.0 * step);
            prop_assert!((gradient[i] - difference).abs() < 1e-8 * norm.max(1.0), "{i}: {} {difference}", gradient[i]);
        }
    }
}

fn model(history: usize, horizon: usize, base: BaseModel) -> Direct {
    let (inputs, outputs) = Direct::lengths(history, horizon, 2, 2);
    let network = Perceptron { inputs, hidden: vec![9, 7], outputs };
    let scaling = Scaling {
        output_mean: vec![1.0, -0.5],
        output_scale: vec![2.0, 0.4],
        input_mean: vec![10.0, 0.1],
        input_scale: vec![5.0, 0.3],
        correction_scale: vec![0.7, 0.2],
    };
    Direct { weights: ruled(&network), network, scaling, history, horizon, base }
}

const PAST: usize = 2;

/// Two outputs and two inputs, with a lag and past values of an output and of an input.
fn equations() -> BaseModel {
    let signals = vec![
        Signal::Lag { input: 2, time_constant_s: Real(0.2) },
        Signal::Past { variable: 0, samples: 2 },
        Signal::Past { variable: 3, samples: 1 },
    ];
    let terms: Vec<Term> =
        [&[0][..], &[1], &[0, 1], &[3], &[4], &[5], &[6]].iter().map(|v| Term::monomial(v)).collect();
    let coefficients = vec![-0.8, 0.1, -0.3, 0.2, 0.09, -0.1, 0.3, 0.2, -1.1, 0.1, 0.5, 0.01, 0.1, -0.2];
    BaseModel::Equations(Arc::new(
        Equations::with_signals(terms, coefficients, 2, 2, signals, 0.1, 2).unwrap(),
    ))
}

fn every_model() -> Vec<Direct> {
    let sizes = [(1, 1), (1, 3), (4, 6), (6, 2), (3, 3)];
    let on = |(p, h)| [BaseModel::Nothing, BaseModel::Hold, equations()].map(|base| model(p, h, base));
    sizes.into_iter().flat_map(on).collect()
}

/// Base of the model over a horizon; equations are simulated along all outputs.
fn base(model: &Direct, outputs: &[[f64; 2]], passed: &[[f64; 2]], given: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let Some(equations) = model.equations() else {
        let s = &model.scaling;
        let present = outputs[outputs.len() - 1];
        let base = if model.base == BaseModel::Hold { present } else { [s.output_mean[0], s.output_mean[1]] };
        return vec![base; given.len()];
    };
    let (mut state, mut scratch) = (vec![f64::NAN; equations.state_len()], vec![0.0; equations.scratch()]);
    for (y, c) in outputs.iter().zip(passed) {
        state[..2].copy_from_slice(y);
        equations.step(&mut state, c, &mut scratch);
    }
    state[..2].copy_from_slice(&outputs[outputs.len() - 1]);
    let mut step = |c: &[f64; 2]| {
        equations.step(&mut state, c, &mut scratch);
        [state[0], state[1]]
    };
    given.iter().map(&mut step).collect()
}

fn session(model: &Direct) -> DirectSession {
    DirectSession::new(Arc::new(model.clone())).unwrap()
}

fn command(k: usize) -> [f64; 2] {
    [10.0 + 5.0 * (0.3 * k as f64).sin(), 0.2 * (0.17 * k as f64).cos()]
}

fn measured(k: usize) -> [f64; 2] {
    [1.0 + (0.1 * k as f64).sin(), -0.5 + 0.2 * (0.23 * k as f64).cos()]
}

/// The equations of the model on vectors: predictions from all outputs and commands until now, under `given` commands.
fn plain(model: &Direct, outputs: &[[f64; 2]], passed: &[[f64; 2]], given: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let s = &model.scaling;
    let (mut outputs, mut passed, mut predicted) = (outputs.to_vec(), passed.to_vec(), Vec::new());
    for given in given.chunks(model.horizon) {
        let past = &outputs[outputs.len() - model.history..];
        let mut x: Vec<f64> =
            past.iter().flat_map(|y| [0, 1].map(|i| (y[i] - s.output_mean[i]) / s.output_scale[i])).collect();
        let mut commands = passed[passed.len() + 1 - model.history..].to_vec();
        commands.extend_from_slice(given);
        commands.resize(model.history + model.horizon - 1, given[given.len() - 1]);
        x.extend(commands.iter().flat_map(|c| [0, 1].map(|i| (c[i] - s.input_mean[i]) / s.input_scale[i])));
        for (l, pair) in model.network.tensors().chunks(2).enumerate() {
            let (w, b) = (&model.weights[pair[0].range()], &model.weights[pair[1].range()]);
            let sum = |(row, b): (&[f64], &f64)| b + row.iter().zip(&x).map(|(w, x)| w * x).sum::<f64>();
            let rows = w.chunks_exact(pair[0].columns).zip(b).map(sum);
            let last = l == model.network.hidden.len();
            x = rows.map(|y| if last { y } else { y.tanh() }).collect();
        }
        let base = base(model, &outputs, &passed, given);
        for (g, (c, base)) in x.chunks_exact(2).zip(given.iter().zip(base)) {
            let y = [0, 1].map(|i| base[i] + s.correction_scale[i] * g[i]);
            outputs.push(y);
            passed.push(*c);
            predicted.push(y);
        }
    }
    predicted
}

fn close(a: &[f64], b: &[[f64; 2]]) {
    assert!(far(a, b.as_flattened()) < 1e-13, "{a:?} {b:?}");
}

#[test]
fn sessions_and_rollouts_equal_the_equations() {
    for model in every_model() {
        let mut session = session(&model);
        let (mut outputs, mut passed) = (vec![measured(0)], Vec::new());
        session.observe(&measured(0));
        let past = if model.equations().is_some() { PAST } else { 0 };
        let least = model.equations().map_or(0, |equations| equations.warm_up());
        assert_eq!(session.warm_up(), model.history.max(least));
        for k in 0..20 {
            session.advance(&command(k));
            let mut y = [0.0; 2];
            session.output(&mut y);
            if k + 1 >= model.history && k >= past {
                close(&y, &plain(&model, &outputs, &passed, &[command(k)]));
            } else {
                assert_eq!(y, measured(k), "nothing can be predicted yet");
            }
            passed.push(command(k));
            let missing = k % 7 == 5;
            let seen = measured(k + 1);
            session.observe(&[seen[0], if missing { f64::NAN } else { seen[1] }]);
            outputs.push([seen[0], if missing { y[1] } else { seen[1] }]);
        }
        let mut work = Workspace::new();
        for steps in [1, 2, 3, 6, 7, 25] {
            let given: Vec<[f64; 2]> = (20..20 + steps).map(command).collect();
            let mut y = vec![0.0; 2 * steps];
            session.rollout(given.as_flattened(), &mut work, &mut y);
            close(&y, &plain(&model, &outputs, &passed, &given));
        }
    }
}

#[test]
fn snapshots_and_forks_hold_all_that_predictions_depend_on() {
    for model in every_model() {
        let (mut walked, mut other) = (session(&model), session(&model));
        for k in 0..10 {
            walked.observe(&measured(k));
            walked.advance(&command(k));
        }
        let mut snapshot = vec![0.0; walked.snapshot_len()];
        walked.snapshot(&mut snapshot);
        other.restore(&snapshot);
        let mut fork = walked.fork();
        let commands: Vec<f64> = (10..21).flat_map(command).collect();
        let roll = |session: &dyn Predictor| {
            let mut y = vec![0.0; 22];
            session.rollout(&commands, &mut Workspace::new(), &mut y);
            y
        };
        let expected = roll(&walked);
        assert!(expected.iter().all(|y| y.is_finite()));
        assert_eq!(roll(&other), expected);
        fork.observe(&[f64::NAN; 2]);
        assert_eq!(roll(fork.as_ref()), expected);
        walked.reset();
        assert!(roll(&walked).iter().all(|y| y.is_nan()));
    }
}

/// An output with a late first measurement takes it as its past.
#[test]
fn sessions_wait_for_the_first_measurement() {
    let model = model(4, 3, BaseModel::Nothing);
    let mut session = session(&model);
    for k in 0..9 {
        session.observe(&[measured(k)[0], f64::NAN]);
        session.advance(&command(k));
    }
    session.observe(&measured(9));
    let outputs: Vec<[f64; 2]> = (0..10)
        .map(|k| {
            // No predictions before the last first measurement.
            [measured(k)[0], measured(9)[1]]
        })
        .collect();
    let passed: Vec<[f64; 2]> = (0..9).map(command).collect();
    let mut y = [0.0; 6];
    let given: Vec<[f64; 2]> = (9..12).map(command).collect();
    session.rollout(given.as_flattened(), &mut Workspace::new(), &mut y);
    close(&y, &plain(&model, &outputs, &passed, &given));
}

/// Zeros in the last layer leave the base to the last bit, also beyond the horizon.
#[test]
fn a_zero_network_equals_its_base_equations() {
    for (p, h) in [(1, 3), (4, 6), (6, 2)] {
        let mut model = model(p, h, equations());
        let read_out = (model.network.hidden[1] + 1) * model.network.outputs;
        let at = model.weights.len() - read_out;
        model.weights[at..].fill(0.0);
        let Some(below) = model.equations() else { panic!("it stands on equations") };
        let (mut alone, mut session) = (EquationsSession::new(Arc::clone(below)), session(&model));
        let commands: Vec<f64> = (0..17).flat_map(command).collect();
        let roll = |session: &dyn Predictor| {
            let mut y = vec![0.0; 34];
            session.rollout(&commands, &mut Workspace::new(), &mut y);
            y
        };
        for k in 0..12 {
            let mut y = measured(k);
            if k == 9 {
                y[1] = f64::NAN;
            }
            let known = k >= PAST && k + 1 >= p;
            alone.observe(&y);
            session.observe(&y);
            assert_eq!(roll(&session).iter().all(|y| y.is_finite()), known, "{k}");
            if known {
                assert_eq!(roll(&session), roll(&alone));
            }
            alone.advance(&command(k));
            session.advance(&command(k));
        }
    }
}

/// Equations that diverge within a sample leave the last measurement in the history, and no NaN.
#[test]
fn diverging_equations_hold_the_last_measurement() {
    let steep = Equations::new(vec![Term::monomial(&[0, 0, 0])], vec![1e9, 0.0], 2, 2, 0.1, 4).unwrap();
    let model = model(3, 4, BaseModel::Equations(Arc::new(steep)));
    let mut session = session(&model);
    for k in 0..8 {
        let y = if k == 4 { [f64::NAN; 2] } else { [1e3, 0.1] };
        session.observe(&y);
        let mut now = [0.0; 2];
        session.output(&mut now);
        assert_eq!(now, [1e3, 0.1], "{k}");
        session.advance(&command(k));
    }
    let mut y = [0.0; 8];
    session.rollout(&[0.1; 8], &mut Workspace::new(), &mut y);
    assert!(y.iter().any(|y| !y.is_finite()), "a rollout says so: {y:?}");
    for k in 8..20 {
        session.observe(&[0.0, 0.1]);
        session.advance(&command(k));
    }
    session.observe(&[0.0, 0.1]);
    session.rollout(&[0.1; 2], &mut Workspace::new(), &mut y[..2]);
    assert!(y[..2].iter().all(|y| y.is_finite()));
}

#[test]
fn invalid_models_are_refused() {
    let refused = |change: fn(&mut Direct)| {
        let mut model = model(4, 3, BaseModel::Nothing);
        change(&mut model);
        model.check().unwrap_err()
    };
    assert_eq!(model(4, 3, BaseModel::Hold).check(), Ok(()));
    assert_eq!(refused(|m| m.history = 0), DirectError::Span { what: "history", given: 0 });
    assert_eq!(refused(|m| m.history = 5), DirectError::Length { what: "reads", network: 20, model: 24 });
    assert_eq!(
        refused(|m| m.network.outputs = 5),
        DirectError::Length { what: "gives", network: 5, model: 6 }
    );
    assert!(matches!(refused(|m| m.weights[3] = f64::NAN), DirectError::Numbers(_)));
    assert!(refused(|m| m.scaling.input_scale[0] = 0.0).to_string().contains("inputs' scales"));
    assert!(matches!(refused(|m| m.weights.truncate(5)), DirectError::Numbers(_)));
    let alien = |m: &mut Direct| {
        let other = Equations::new(vec![Term::monomial(&[0])], vec![0.1; 3], 3, 2, 0.1, 1).unwrap();
        m.base = BaseModel::Equations(Arc::new(other));
    };
    let error = DirectError::Numbers(RecurrentError::Equations { equations: (2, 3), model: (2, 2) });
    assert_eq!(refused(alien), error);
}

#[test]
fn weights_have_the_order_and_names_of_torch() {
    let network = Perceptron { inputs: 58, hidden: vec![256; 3], outputs: 60 };
    assert_eq!(network.check(), Ok(()));
    assert_eq!(network.weights(), 59 * 256 + 2 * 257 * 256 + 257 * 60);
    let tensors = network.tensors();
    let shapes: Vec<_> = tensors.iter().map(|t| (t.name.as_str(), t.shape())).collect();
    assert_eq!(shapes[0], ("0.weight", vec![256, 58]));
    assert_eq!(shapes[7], ("6.bias", vec![60]));
    let mut end = 0;
    for tensor in &tensors {
        assert_eq!(tensor.offset, end);
        end += tensor.len();
    }
    assert_eq!(end, network.weights());
}

#[test]
fn impossible_perceptrons_are_refused() {
    let check =
        |inputs, hidden: &[usize], outputs| Perceptron { inputs, hidden: hidden.to_vec(), outputs }.check();
    assert_eq!(check(0, &[], 1), Err(NetworkError::Empty("inputs")));
    assert_eq!(check(1, &[3, 0], 1), Err(NetworkError::Empty("units")));
    assert_eq!(check(1, &[4097], 1), Err(NetworkError::Huge("units", 4097, 4096)));
    assert_eq!(check(1, &[1; 65], 1), Err(NetworkError::Huge("layers", 65, 64)));
    assert!(matches!(check(4096, &[4096; 5], 1), Err(NetworkError::Huge("weights", ..))));
    assert_eq!(check(3, &[], 2), Ok(()));
}
