//! Adaptation of the last layer of a direct predictor, compared with dense recursive least squares of each output.

use std::sync::Arc;

use hydroid_core::adapt::guard::{Guard, GuardOptions};
use hydroid_core::adapt::{
    Adapter, DirectLastLayer, LastLayerError, LastLayerOptions, Learning, Outcome, Rejection, SaveState,
};
use hydroid_core::model::direct::{Direct, DirectSession, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, Scaling};
use hydroid_core::model::sparse::{Equations, Real, Signal, Term};
use hydroid_core::predict::{Predictor, Workspace};
use proptest::prelude::*;

const OPTIONS: LastLayerOptions =
    LastLayerOptions { forgetting: 0.99, information: 0.5, leak: true, noise_rate: 0.01 };

fn model(history: usize, horizon: usize, hold: bool, hidden: &[usize]) -> Direct {
    on(if hold { BaseModel::Hold } else { BaseModel::Nothing }, history, horizon, hidden)
}

/// Two outputs and two inputs, with a lag and past values of an output.
fn equations() -> BaseModel {
    let signals =
        vec![Signal::Lag { input: 2, time_constant_s: Real(0.2) }, Signal::Past { variable: 0, samples: 2 }];
    let terms: Vec<Term> = [0, 1, 3, 4, 5].map(|v| Term::monomial(&[v])).to_vec();
    let coefficients = vec![-0.8, 0.1, 0.2, 0.09, -0.1, 0.2, -1.1, 0.5, 0.01, 0.1];
    BaseModel::Equations(Arc::new(
        Equations::with_signals(terms, coefficients, 2, 2, signals, 0.1, 2).unwrap(),
    ))
}

/// Base of the model over the horizon of the window that ended at `k`; equations are simulated from the start.
fn base(model: &Direct, k: usize) -> Vec<[f64; 2]> {
    let mut e: Vec<[f64; 2]> = Vec::new();
    match &model.base {
        BaseModel::Nothing => e.resize(model.horizon, [0, 1].map(|c| model.scaling.output_mean[c])),
        BaseModel::Hold => e.resize(model.horizon, measured(k)),
        BaseModel::Equations(equations) => {
            let (mut state, mut scratch) =
                (vec![f64::NAN; equations.state_len()], vec![0.0; equations.scratch()]);
            for j in 0..k + model.horizon {
                if j <= k {
                    state[..2].copy_from_slice(&measured(j));
                }
                equations.step(&mut state, &command(j), &mut scratch);
                if j >= k {
                    e.push([state[0], state[1]]);
                }
            }
        }
    }
    e
}

fn on(base: BaseModel, history: usize, horizon: usize, hidden: &[usize]) -> Direct {
    let (inputs, outputs) = Direct::lengths(history, horizon, 2, 2);
    let network = Perceptron { inputs, hidden: hidden.to_vec(), outputs };
    let weights = (0..network.weights()).map(|k| 0.6 * (0.7 * k as f64 + 0.3).sin()).collect();
    let scaling = Scaling {
        output_mean: vec![1.0, -0.5],
        output_scale: vec![2.0, 0.4],
        input_mean: vec![10.0, 0.1],
        input_scale: vec![5.0, 0.3],
        correction_scale: vec![0.7, 0.2],
    };
    Direct { weights, network, scaling, history, horizon, base }
}

fn learner(model: &Direct, options: &LastLayerOptions) -> DirectLastLayer {
    DirectLastLayer::new(Arc::new(model.clone()), options).unwrap()
}

fn command(k: usize) -> [f64; 2] {
    [10.0 + 5.0 * (0.3 * k as f64).sin(), 0.2 * (0.17 * k as f64).cos()]
}

fn measured(k: usize) -> [f64; 2] {
    let noise = (0.01 * (12.9 * k as f64).sin() * 43_758.5).fract();
    [1.0 + (0.1 * k as f64).sin() + 0.05 * noise, -0.5 + 0.2 * (0.23 * k as f64).cos()]
}

struct Naive {
    information: Vec<Vec<f64>>,
    theta: Vec<f64>,
    prior: Vec<f64>,
    turn: usize,
}

/// `A x = b` by elimination with pivots.
fn solve(a: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
    let n = b.len();
    let mut rows: Vec<Vec<f64>> = a.iter().zip(b).map(|(row, b)| [row.as_slice(), &[*b]].concat()).collect();
    for i in 0..n {
        let pivot = (i..n).max_by(|&p, &q| rows[p][i].abs().total_cmp(&rows[q][i].abs())).unwrap();
        rows.swap(i, pivot);
        for p in 0..n {
            if p != i {
                let factor = rows[p][i] / rows[i][i];
                for q in i..=n {
                    rows[p][q] -= factor * rows[i][q];
                }
            }
        }
    }
    (0..n).map(|i| rows[i][n] / rows[i][i]).collect()
}

impl Naive {
    fn new(theta: &[f64], r0: f64) -> Self {
        let n = theta.len();
        let information = (0..n).map(|i| (0..n).map(|j| if i == j { r0 } else { 0.0 }).collect()).collect();
        Self { information, theta: theta.to_vec(), prior: theta.to_vec(), turn: 0 }
    }

    fn weigh(&mut self, phi: &[f64], error: f64, weight: f64) {
        for (row, a) in self.information.iter_mut().zip(phi) {
            row.iter_mut().zip(phi).for_each(|(r, b)| *r += weight * a * b);
        }
        let pull: Vec<f64> = phi.iter().map(|phi| weight * phi * error).collect();
        let step = solve(&self.information, &pull);
        self.theta.iter_mut().zip(step).for_each(|(theta, step)| *theta += step);
    }

    /// `R <- R + phi phi'`, then `R <- lambda R + n (1 - lambda) r0 e_j e_j'` with the leak of the target.
    fn learn(&mut self, phi: &[f64], target: f64, options: &LastLayerOptions) {
        let error = target - phi.iter().zip(&self.theta).map(|(phi, theta)| phi * theta).sum::<f64>();
        self.weigh(phi, error, 1.0);
        let n = self.theta.len();
        let (lambda, j) = (options.forgetting, self.turn);
        if lambda < 1.0 {
            self.information.iter_mut().flatten().for_each(|r| *r *= lambda);
            let unit: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i == j))).collect();
            let lost = if options.leak { self.prior[j] - self.theta[j] } else { 0.0 };
            self.weigh(&unit, lost, n as f64 * (1.0 - lambda) * options.information);
            self.turn = (j + 1) % n;
        }
    }
}

/// Rows of the last layer, each with its bias.
fn rows(model: &Direct, weights: &[f64]) -> Vec<Vec<f64>> {
    let gives = model.network.outputs;
    let features = weights.len() / gives - 1;
    let (matrix, bias) = weights.split_at(features * gives);
    matrix.chunks_exact(features).zip(bias).map(|(row, b)| [row, &[*b]].concat()).collect()
}

/// Inputs of the last layer for the window that ended at `k`.
fn regressor(model: &Direct, k: usize) -> Vec<f64> {
    let (s, p, h) = (&model.scaling, model.history, model.horizon);
    let outputs =
        (k + 1 - p..=k).flat_map(|j| [0, 1].map(|i| (measured(j)[i] - s.output_mean[i]) / s.output_scale[i]));
    let inputs =
        (k + 1 - p..k + h).flat_map(|j| [0, 1].map(|i| (command(j)[i] - s.input_mean[i]) / s.input_scale[i]));
    let mut x: Vec<f64> = outputs.chain(inputs).collect();
    let tensors = model.network.tensors();
    for pair in tensors.chunks(2).take(model.network.hidden.len()) {
        let (w, b) = (&model.weights[pair[0].range()], &model.weights[pair[1].range()]);
        let sum = |(row, b): (&[f64], &f64)| b + row.iter().zip(&x).map(|(w, x)| w * x).sum::<f64>();
        x = w.chunks_exact(pair[0].columns).zip(b).map(|row| sum(row).tanh()).collect();
    }
    x.push(1.0);
    x
}

#[test]
fn every_step_learns_as_if_it_were_alone() {
    for (p, h, below, hidden) in [
        (1, 1, BaseModel::Nothing, vec![5]),
        (4, 6, BaseModel::Hold, vec![7, 5]),
        (3, 4, BaseModel::Nothing, vec![6, 4, 5]),
        (2, 3, BaseModel::Hold, vec![]),
        (4, 6, equations(), vec![7, 5]),
        (3, 1, equations(), vec![]),
    ] {
        for options in [
            OPTIONS,
            LastLayerOptions { forgetting: 1.0, ..OPTIONS },
            LastLayerOptions { leak: false, ..OPTIONS },
        ] {
            let model = on(below.clone(), p, h, &hidden);
            let mut adapter = learner(&model, &options);
            let mut naive: Vec<Naive> = rows(&model, adapter.weights())
                .iter()
                .map(|theta| Naive::new(theta, options.information))
                .collect();
            for m in 0..60 {
                adapter.observe(&measured(m));
                // The window that ended a horizon ago is complete if its past is known.
                let complete = m.checked_sub(h).filter(|k| k + 1 >= p);
                assert_eq!(adapter.outcome() == Outcome::Accepted, complete.is_some(), "{m}");
                if let Some(k) = complete {
                    let (phi, base) = (regressor(&model, k), base(&model, k));
                    for (i, naive) in naive.iter_mut().enumerate() {
                        let (j, c) = (i / 2 + 1, i % 2);
                        let target =
                            (measured(k + j)[c] - base[j - 1][c]) / model.scaling.correction_scale[c];
                        naive.learn(&phi, target, &options);
                    }
                }
                for (row, naive) in rows(&model, adapter.weights()).iter().zip(&naive) {
                    for (a, b) in row.iter().zip(&naive.theta) {
                        assert!((a - b).abs() < 1e-9, "{p} {h} {hidden:?} {m}: {a} {b}");
                    }
                }
                adapter.advance(&command(m));
            }
        }
    }
}

fn run(adapter: &mut dyn Adapter, from: usize, to: usize) -> Vec<u64> {
    let (mut seen, mut work) = (Vec::new(), Workspace::new());
    for k in from..to {
        let mut y = measured(k);
        if k % 23 == 22 {
            y[k % 2] = f64::NAN;
        }
        if k % 29 == 28 {
            adapter.scale_noise(9.0);
        }
        adapter.observe(&y);
        seen.push(u64::from(adapter.outcome() == Outcome::Accepted));
        seen.extend(adapter.innovations().iter().flat_map(|i| [i.value.to_bits(), i.deviation.to_bits()]));
        adapter.advance(&command(k));
        let (mut ahead, mut bands) = ([0.0; 12], [0.0; 4]);
        let commands: Vec<f64> = (k + 1..k + 7).flat_map(command).collect();
        adapter.rollout(&commands, &mut work, &mut ahead);
        adapter.deviations(&commands, &[2, 6], &mut work, &mut bands);
        seen.extend(ahead.iter().chain(&bands).chain(adapter.weights()).map(|x| x.to_bits()));
    }
    seen
}

fn saved(adapter: &mut dyn Adapter) -> Vec<f64> {
    let mut memory = vec![0.0; adapter.memory_len()];
    adapter.save(&mut memory);
    memory
}

fn far(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn a_session_resumes_from_a_saved_state() {
    for (model, at) in [model(3, 4, true, &[7, 5]), on(equations(), 3, 4, &[7, 5])]
        .iter()
        .flat_map(|model| [0, 1, 3, 6, 7, 23, 30, 120].map(|at| (model, at)))
    {
        let (mut first, mut second) = (learner(model, &OPTIONS), learner(model, &OPTIONS));
        run(&mut first, 0, at);
        run(&mut second, 5, 90);
        second.load(&saved(&mut first));
        assert_eq!(bits(&saved(&mut second)), bits(&saved(&mut first)));
        assert_eq!(run(&mut first, at, at + 100), run(&mut second, at, at + 100), "{at}");
    }
}

#[test]
fn a_snapshot_predicts_as_it_did() {
    for model in [model(3, 4, false, &[7, 5]), on(equations(), 3, 4, &[7, 5])] {
        snapshots_of(&model);
    }
}

fn snapshots_of(model: &Direct) {
    let mut adapter = learner(model, &OPTIONS);
    run(&mut adapter, 0, 60);
    let roll = |session: &dyn Predictor| {
        let commands: Vec<f64> = (60..70).flat_map(command).collect();
        let mut y = vec![0.0; 20];
        session.rollout(&commands, &mut Workspace::new(), &mut y);
        y
    };
    let then = roll(&adapter);
    let mut snapshot = vec![0.0; adapter.snapshot_len()];
    adapter.snapshot(&mut snapshot);
    let weights = adapter.weights().to_vec();
    assert_eq!(snapshot[snapshot.len() - weights.len()..], weights);
    run(&mut adapter, 60, 120);
    assert_ne!(roll(&adapter), then);
    let mut fork = adapter.fork();
    fork.restore(&snapshot);
    assert_eq!(roll(fork.as_ref()), then);
    adapter.restore(&snapshot);
    assert_eq!((roll(&adapter), adapter.weights()), (then, &weights[..]));
    // The windows restart; learning then continues.
    for k in 60..60 + model.horizon {
        adapter.observe(&measured(k));
        adapter.advance(&command(k));
        assert_eq!(adapter.weights(), weights);
    }
    adapter.observe(&measured(60 + model.horizon));
    assert_ne!(adapter.weights(), weights);
}

#[test]
fn missing_measurements_change_no_weights() {
    let model = model(3, 4, false, &[7, 5]);
    let options = LastLayerOptions { leak: false, ..OPTIONS };
    let (mut whole, mut half) = (learner(&model, &options), learner(&model, &options));
    for k in 0..41 {
        // Regressors stay equal until the first window without measurements is complete.
        let gone = k >= 37;
        whole.observe(&measured(k));
        half.observe(&[measured(k)[0], if gone { f64::NAN } else { measured(k)[1] }]);
        assert_eq!(half.outcome(), whole.outcome());
        let (a, b) = (rows(&model, whole.weights()), rows(&model, half.weights()));
        for i in 0..8 {
            let (j, c) = (i / 2 + 1, i % 2);
            assert_eq!(a[i] != b[i], gone && c == 1 && k - 4 + j >= 37, "{k} {j} {c}");
        }
        whole.advance(&command(k));
        half.advance(&command(k));
    }
    let before = half.weights().to_vec();
    for k in 41..60 {
        half.observe(&[f64::NAN; 2]);
        half.advance(&command(k));
    }
    assert_eq!(half.outcome(), Outcome::Waiting);
    assert!(half.weights().iter().zip(&before).any(|(a, b)| a != b), "targets that were still to come");
    let before = half.weights().to_vec();
    half.observe(&[f64::INFINITY, 1.0]);
    assert_eq!(half.outcome(), Outcome::Rejected(Rejection::NotFinite));
    assert!(half.weights().iter().all(|w| w.is_finite()) && before.iter().all(|w| w.is_finite()));
    let mut y = [0.0; 2];
    half.output(&mut y);
    assert!(y[0].is_finite());
}

/// The deviation of an output requires errors of that output.
#[test]
fn each_number_has_a_band_from_its_own_errors() {
    let model = model(3, 4, true, &[7, 5]);
    let mut adapter = learner(&model, &OPTIONS);
    let mut work = Workspace::new();
    let mut bands = |adapter: &mut DirectLastLayer, k: usize| {
        let (commands, mut bands): (Vec<f64>, _) = ((k + 1..k + 5).flat_map(command).collect(), [0.0; 4]);
        adapter.deviations(&commands, &[1, 4], &mut work, &mut bands);
        bands
    };
    for k in 0..200 {
        // Measured once, so that windows are complete, then missing until sample 100.
        let gone = (1..100).contains(&k);
        adapter.observe(&[measured(k)[0], if gone { f64::NAN } else { measured(k)[1] }]);
        adapter.advance(&command(k));
        if k == 99 {
            let bands = bands(&mut adapter, k);
            assert!(bands[0] > 0.0 && bands[2] > 0.0 && bands[1].is_nan() && bands[3].is_nan(), "{bands:?}");
        }
    }
    let bands = bands(&mut adapter, 199);
    assert!(bands.iter().all(|band| *band > 1e-6), "{bands:?}");
}

/// A finite value whose square overflows counts as missing.
#[test]
fn a_huge_number_has_no_later_effect() {
    for (hold, hidden) in [(true, vec![7, 5]), (false, vec![7]), (false, vec![])] {
        for far in [1e308, -1e308, 1e200] {
            let mut adapter = learner(&model(3, 4, hold, &hidden), &OPTIONS);
            run(&mut adapter, 0, 60);
            let before = adapter.weights().to_vec();
            adapter.observe(&[far, measured(60)[1]]);
            assert_eq!(adapter.outcome(), Outcome::Rejected(Rejection::NotFinite), "{far}");
            assert_eq!(adapter.weights(), before);
            adapter.advance(&command(60));
            for k in 61..120 {
                adapter.observe(&measured(k));
                adapter.advance(&command(k));
                assert!(adapter.weights().iter().all(|w| w.abs() < 100.0), "{far} {k}");
            }
            assert_eq!(adapter.outcome(), Outcome::Accepted);
            assert_ne!(adapter.weights(), before);
            let last = adapter.innovations()[0];
            assert!(last.deviation < 10.0, "{far}: {last:?}");
        }
    }
}

/// A vessel with another last layer on the same features is identified, with correct coverage.
#[test]
fn a_last_layer_that_has_changed_is_found() {
    let plain = model(2, 1, false, &[12]);
    let mut other = plain.clone();
    let at = other.weights.len() - 13 * 2;
    for (k, w) in other.weights[at..].iter_mut().enumerate() {
        *w += 0.2 * (1.3 * k as f64).cos();
    }
    let options = LastLayerOptions { forgetting: 1.0, information: 1e-6, ..OPTIONS };
    let mut adapter = learner(&plain, &options);
    let mut frozen = DirectSession::new(Arc::new(plain)).unwrap();
    let mut world = DirectSession::new(Arc::new(other)).unwrap();
    world.observe(&measured(0));
    let command = |k: usize| {
        let x = (k * k) as f64;
        [10.0 + 7.0 * (1.7 * x).sin(), 0.5 * (2.3 * x + k as f64).cos()]
    };
    let (mut y, mut work) = ([0.0; 2], Workspace::new());
    let (mut before, mut after, mut bands) = (0.0_f64, 0.0_f64, [0.0; 4]);
    for k in 0..2000 {
        world.output(&mut y);
        adapter.observe(&y);
        frozen.observe(&y);
        adapter.advance(&command(k));
        frozen.advance(&command(k));
        world.advance(&command(k));
        if k > 1500 {
            let [mut truth, mut a, mut b] = [[0.0; 2]; 3];
            world.output(&mut truth);
            adapter.output(&mut a);
            frozen.output(&mut b);
            after = after.max(far(&a, &truth));
            before = before.max(far(&b, &truth));
        }
    }
    assert!(before > 0.02 && after < 1e-4 * before, "{before} {after}");
    adapter.observe(&y);
    let commands: Vec<f64> = (2000..2002).flat_map(command).collect();
    adapter.deviations(&commands, &[1, 2], &mut work, &mut bands);
    assert!(bands[..2].iter().all(|b| *b < 0.1 * before), "{bands:?}");
    assert!(bands[2..].iter().all(|b| b.is_nan()), "beyond what the network gives: {bands:?}");
}

#[test]
fn the_filter_stays_stable_over_a_long_run() {
    let model = model(2, 3, true, &[6]);
    let mut adapter = learner(&model, &LastLayerOptions { forgetting: 0.97, ..OPTIONS });
    for k in 0..200_000 {
        // Noise with occasional excitation.
        let lively = (k / 5000) % 4 == 3;
        let y = if lively { measured(k) } else { [1.0 + 1e-3 * (k as f64).sin(), -0.5] };
        adapter.observe(&y);
        adapter.advance(&if lively { command(k) } else { [10.0, 0.1] });
        assert!(adapter.health().min_s_over_r.is_nan() || adapter.health().min_s_over_r >= 1.0, "{k}");
    }
    let learner = adapter.learner().unwrap();
    assert!(learner.is_sound());
    for i in 0..learner.len() {
        let most = 0.97_f64.powf(1.0 - learner.len() as f64) / OPTIONS.information;
        assert!((0.0..=most).contains(&learner.covariance(i, i)), "{i}: {}", learner.covariance(i, i));
    }
    assert!(adapter.weights().iter().all(|w| w.abs() < 100.0));
}

#[test]
fn a_guard_takes_a_frozen_companion() {
    let model = Arc::new(model(3, 4, true, &[7, 5]));
    let companion = || -> Box<dyn Adapter> {
        let mut companion = DirectLastLayer::companion(Arc::clone(&model), &OPTIONS).unwrap();
        companion.freeze(true);
        Box::new(companion)
    };
    let guard = || {
        let learner = || Box::new(DirectLastLayer::new(Arc::clone(&model), &OPTIONS).unwrap());
        let ranges = [(-1.0, 3.0), (-1.5, 0.5)];
        let options = GuardOptions { horizon: 4, stride: 1, ..GuardOptions::new(0.1) };
        Guard::new(learner(), learner(), companion(), &ranges, &[0.02, 0.02], options).unwrap()
    };
    let (mut first, mut second) = (guard(), guard());
    let before = first.weights().to_vec();
    run(&mut first, 0, 200);
    assert_ne!(first.weights(), before);
    second.load(&saved(&mut first));
    assert_eq!(run(&mut first, 200, 300), run(&mut second, 200, 300));
    // A companion equals a plain session.
    let mut companion = companion();
    let mut plain = DirectSession::new(Arc::clone(&model)).unwrap();
    for k in 0..50 {
        companion.observe(&measured(k));
        plain.observe(&measured(k));
        companion.advance(&command(k));
        plain.advance(&command(k));
    }
    assert_eq!(companion.weights(), before);
    let commands: Vec<f64> = (50..60).flat_map(command).collect();
    let (mut a, mut b, mut work) = ([0.0; 20], [0.0; 20], Workspace::new());
    companion.rollout(&commands, &mut work, &mut a);
    plain.rollout(&commands, &mut work, &mut b);
    assert_eq!(bits(&a), bits(&b));
}

#[test]
fn invalid_options_are_refused_with_a_reason() {
    let model = Arc::new(model(3, 4, true, &[7]));
    for (options, part) in [
        (LastLayerOptions { forgetting: 1.1, ..OPTIONS }, "forgetting"),
        (LastLayerOptions { forgetting: f64::NAN, ..OPTIONS }, "forgetting"),
        (LastLayerOptions { forgetting: 0.1, ..OPTIONS }, "forgetting"),
        (LastLayerOptions { information: 0.0, ..OPTIONS }, "weight of the reference model"),
        (LastLayerOptions { noise_rate: -0.1, ..OPTIONS }, "noise"),
    ] {
        let error = DirectLastLayer::new(Arc::clone(&model), &options).unwrap_err();
        assert!(error.to_string().contains(part) && error.to_string().contains("needed"), "{error}");
    }
    let broken = Arc::new(Direct { history: 0, ..Direct::clone(&model) });
    assert!(matches!(DirectLastLayer::new(broken, &OPTIONS), Err(LastLayerError::Model(_))));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn an_arbitrary_saved_state_never_panics(seed in any::<u64>(), finite in any::<bool>()) {
        let mut x = seed | 1;
        let mut next = || {
            x ^= x << 13;
            x ^= x >> 7;
            x ^= x << 17;
            if finite { (x % 10_000) as f64 - 5000.0 } else { f64::from_bits(x) }
        };
        let mut adapter = learner(&model(3, 4, true, &[7, 5]), &OPTIONS);
        let memory: Vec<f64> = (0..adapter.memory_len()).map(|_| next()).collect();
        adapter.load(&memory);
        run(&mut adapter, 0, 60);
    }
}
