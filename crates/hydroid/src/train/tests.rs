//! Gradients against finite differences of the loss, and damaged checkpoint files.

use std::sync::Arc;

use hydroid_core::actuator::Map;
use hydroid_core::model::affine::ControlAffineSession;
use hydroid_core::model::recurrent::BaseModel;
use hydroid_core::model::sparse::{Equations, Real, Signal, Term};
use hydroid_core::predict::{Predictor, Workspace};
use proptest::prelude::*;

use super::mini_batch::{Architecture, MiniBatch};
use super::restarts::{Plan, Restart, Restarts};
use super::*;
use crate::log::{Channel, Table};

const RANGES: [DesignRange; 2] = [DesignRange { low: -2.0, high: 3.0 }, DesignRange { low: -1.0, high: 1.0 }];
const INPUT: [DesignRange; 1] = [DesignRange { low: -1.0, high: 1.0 }];

/// A run of a synthetic vessel with two outputs and missing values.
fn run(samples: usize, phase: f64, missing: &[(usize, usize)]) -> Trajectory {
    let input: Vec<f64> = (0..samples).map(|k| (0.3 * k as f64 + phase).sin()).collect();
    let (mut u, mut v) = (0.1, -0.2);
    let mut outputs = Vec::new();
    for (k, c) in input.iter().enumerate() {
        outputs.extend([(0, u), (1, v)].map(|(i, y)| if missing.contains(&(k, i)) { f64::NAN } else { y }));
        (u, v) = (u + 0.1 * (c - u + v * v), v + 0.1 * (0.5 * u - v));
    }
    Trajectory {
        name: format!("run {phase}"),
        t0: 0.0,
        dt: 0.1,
        outputs: Table::new([Channel::new("u", "m/s"), Channel::new("v", "m/s")], outputs),
        inputs: Table::new([Channel::new("n", "1/s")], input),
        truth: None,
        heading: None,
        position: None,
    }
}

/// Approximate equations of the vessel, with a lag of the command.
fn equations() -> Arc<Equations> {
    let (u, v, a) = (0, 1, 3);
    let terms: Vec<Term> = [&[u][..], &[v], &[v, v], &[a]].map(Term::monomial).to_vec();
    let coefficients = vec![-0.9, 0.0, 0.8, 1.0, 0.6, -1.1, 0.0, 0.0];
    let lag = Signal::Lag { input: 2, time_constant_s: Real(0.05) };
    Arc::new(Equations::with_signals(terms, coefficients, 2, 1, vec![lag], 0.1, 2).unwrap())
}

fn plan_of(options: &TrainOptions, missing: &[(usize, usize)]) -> Plan<f64> {
    let runs = [run(60, 0.0, missing), run(45, 1.0, &[])];
    let refs: Vec<&Trajectory> = runs.iter().collect();
    let equations = Some(equations());
    let job = Job { runs: &refs, validation: &refs, outputs: &RANGES, inputs: &INPUT, horizon: 5, equations };
    plan::plan(&job, options).unwrap()
}

fn small(cell: CellKind) -> TrainOptions {
    TrainOptions {
        hidden: 4,
        wash_out_s: Some(0.8),
        window_s: Some(1.2),
        channel_weights: vec![1.0, 0.5],
        precision: Precision::F64,
        ..TrainOptions::of(cell)
    }
}

/// Loss over windows at every seventh origin of the runs.
fn loss(plan: &Plan<f64>, chunk: &mut MiniBatch<f64>, weights: &[f64]) -> f64 {
    let windows = plan.shape.every(&plan.runs, 7);
    assert!(windows.len() > 8, "{}", windows.len());
    chunk.forward(weights, &plan.runs, &windows);
    let mut sums = [[0.0; 2]; 2];
    chunk.squares(&plan.runs, plan.shape.length, &mut sums);
    sums.iter().zip(channel_weights(plan)).map(|([square, _], w)| w * square).sum()
}

/// Weights after an epoch in which the error of the second output was nine times smaller.
fn channel_weights(plan: &Plan<f64>) -> Vec<f64> {
    plan.loss.weights(&[0.2, 1.8])
}

/// Compares the gradient at `weights` with central differences of the loss for every `stride`-th weight; returns the
/// largest error relative to the norm of the gradient.
fn compare_with_differences(
    plan: &Plan<f64>,
    chunk: &mut MiniBatch<f64>,
    weights: &mut [f64],
    stride: usize,
    case: &str,
) -> f64 {
    loss(plan, chunk, weights);
    let mut gradient = vec![f64::NAN; weights.len()];
    chunk.backward(weights, &plan.runs, &channel_weights(plan), 0.7, &mut gradient);
    let norm = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
    let mut worst = 0.0f64;
    for i in (0..weights.len()).step_by(stride) {
        let (at, step) = (weights[i], 1e-5);
        let [plus, minus] = [step, -step].map(|step| {
            weights[i] = at + step;
            loss(plan, chunk, weights)
        });
        weights[i] = at;
        let difference = 0.7 * (plus - minus) / (2.0 * step);
        let error = (gradient[i] - difference).abs() / norm;
        assert!(error < 1e-8, "{case} {i}: {} {difference}", gradient[i]);
        worst = worst.max(error);
    }
    worst
}

#[test]
fn gradients_are_differences_of_the_loss() {
    // Missing in the wash-out and among the compared values.
    let missing = [(3, 0), (4, 0), (10, 1), (30, 1), (31, 0), (32, 0)];
    let mut worst = 0.0f64;
    for cell in [CellKind::Lstm, CellKind::Gru, CellKind::Rnn] {
        for base in [BaseKind::Nothing, BaseKind::Hold, BaseKind::Equations] {
            for feedback in [false, true] {
                let options = TrainOptions { feedback, base, ..small(cell) };
                let plan = plan_of(&options, &missing);
                let mut chunk = plan.net.chunk(&plan.scaling, plan.shape, 20, true);
                let mut rng = random::stream(3, random::Purpose::Weights, 0, 0);
                let mut weights = plan.net.first::<f64>(&mut rng);
                let case = format!("{cell:?} {base:?} {feedback}");
                worst = worst.max(compare_with_differences(&plan, &mut chunk, &mut weights, 3, &case));
            }
        }
    }
    println!("largest difference: {worst:e} of the gradient");
}

/// Gradient of a direct predictor, with gaps in the history and among the compared values.
#[test]
fn the_gradient_of_a_direct_predictor_is_differences_of_its_loss() {
    let missing = [(3, 0), (4, 0), (10, 1), (30, 1), (31, 0), (32, 0)];
    for base in [BaseKind::Nothing, BaseKind::Hold, BaseKind::Equations] {
        let options = TrainOptions {
            hidden: 5,
            base,
            history_s: Some(0.4),
            window_s: Some(0.6),
            precision: Precision::F64,
            ..TrainOptions::of(CellKind::Direct)
        };
        let plan = plan_of(&options, &missing);
        let mut chunk = plan.net.chunk(&plan.scaling, plan.shape, 20, true);
        let mut weights = plan.net.first::<f64>(&mut random::stream(3, random::Purpose::Weights, 0, 0));
        compare_with_differences(&plan, &mut chunk, &mut weights, 1, &format!("{base:?}"));
    }
}

/// A sine has no inverse beyond 90 degrees.
#[test]
fn a_sine_over_more_than_a_quarter_of_a_turn_is_refused() {
    let options = TrainOptions { maps: vec![Map::Sine], ..small(CellKind::Affine) };
    let runs = [run(60, 0.0, &[]), run(45, 1.0, &[])];
    let refs: Vec<&Trajectory> = runs.iter().collect();
    let planned = |low: f64, high: f64| {
        let (runs, validation, inputs) = (&refs[..], &refs[..], &[DesignRange { low, high }]);
        let job = Job { runs, validation, outputs: &RANGES, inputs, horizon: 5, equations: None };
        plan::plan::<f64>(&job, &options)
    };
    let quarter = 90.0_f64.to_radians();
    let plan = planned(-0.3, quarter).unwrap();
    let Architecture::Affine(parts) = &plan.net else { panic!() };
    assert_eq!(parts.units, [1.0]);
    let words = planned(-2.0, 1.0).err().map(|error| error.to_string()).unwrap();
    assert!(words.contains("'n'") && words.contains("maps = [\"identity\"] in [affine]"), "{words}");
}

/// The average has the units of all restarts and does not depend on the number of threads; invalid averages are errors.
#[test]
fn the_mean_of_all_restarts_is_one_control_affine_network() {
    let options = TrainOptions {
        maps: vec![Map::Identity],
        restarts: 3,
        ensemble: true,
        epochs: 3,
        ..small(CellKind::Affine)
    };
    let runs = [run(120, 0.0, &[]), run(90, 1.0, &[])];
    let refs: Vec<&Trajectory> = runs.iter().collect();
    let job = || Job {
        runs: &refs,
        validation: &refs,
        outputs: &RANGES,
        inputs: &INPUT,
        horizon: 5,
        equations: None,
    };
    let learned = |options: &TrainOptions, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| train(&job(), options, None, &mut |_| ControlFlow::Continue(()))).map(|trained| {
            let TrainedNetwork::Affine(model) = trained.model else { panic!() };
            (model, trained.members.len())
        })
    };
    let (mean, members) = learned(&options, 1).unwrap();
    assert_eq!((mean.network.hidden.clone(), members), (vec![12], 0));
    assert_eq!(learned(&options, 2).unwrap(), (mean.clone(), 0));
    let (alone, _) = learned(&TrainOptions { ensemble: false, ..options.clone() }, 1).unwrap();
    assert_eq!(alone.network.hidden, [4]);
    for (wrong, words) in [
        (TrainOptions { refit: true, ..options.clone() }, "refit"),
        (TrainOptions { layers: Some(0), ..options.clone() }, "1 or more for an ensemble"),
        (TrainOptions { hidden: 2000, ..options.clone() }, "the mean of 3 restarts"),
        (TrainOptions { settle_s: Some(2.0), ..options.clone() }, "no longer than wash_out_s"),
        (TrainOptions { settle_s: Some(0.2), ..small(CellKind::Gru) }, "for control-affine networks"),
    ] {
        let error = learned(&wrong, 1).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(words), "{words}: {error}");
    }
}

/// Gradient of a control-affine network with the time constants of its actuators; its predictions are those of the
/// session.
#[test]
fn the_gradient_of_a_control_affine_network_is_differences_of_its_loss() {
    let missing = [(3, 0), (4, 0), (10, 1), (30, 1), (31, 0), (32, 0)];
    for (map, layers) in [(Map::Identity, 1), (Map::Sine, 2), (Map::SignedSquare, 1)] {
        let options = TrainOptions {
            hidden: 5,
            layers: Some(layers),
            maps: vec![map],
            settle_s: Some(0.4),
            ..small(CellKind::Affine)
        };
        let plan = plan_of(&options, &missing);
        let mut chunk = plan.net.chunk(&plan.scaling, plan.shape, 20, true);
        let mut weights = plan.net.first::<f64>(&mut random::stream(3, random::Purpose::Weights, 0, 0));
        compare_with_differences(&plan, &mut chunk, &mut weights, 1, &format!("{map:?}"));
        let TrainedNetwork::Affine(model) = plan.net.model(&weights, &plan.scaling, plan.shape) else {
            panic!()
        };
        let Architecture::Affine(parts) = &plan.net else { panic!() };
        let session = ControlAffineSession::new(Arc::new(model)).unwrap();
        let run = run(60, 0.0, &missing);
        let mut judging = plan.net.chunk(&plan.scaling, plan.shape, 20, false);
        assert!(parts.settle > 1);
        // Validation starts from the measurement, training from the estimate of the observer.
        for (settle, chunk) in [(0, &mut judging), (parts.settle, &mut chunk)] {
            let window = plan.shape.window(&plan.runs, 0, 20).unwrap();
            chunk.forward(&weights, &plan.runs, &[window]);
            let (mut session, begin) = (session.clone(), 20 - settle);
            for k in 20 - plan.shape.wash_out..begin {
                session.advance(run.inputs.row(k));
            }
            session.observe(run.outputs.row(begin));
            let gain = 1.0 - 0.1_f64.powf(1.0 / settle.max(1) as f64);
            let mut z = [0.0; 2];
            for k in begin..20 {
                session.advance(run.inputs.row(k));
                session.output(&mut z);
                for (z, y) in z.iter_mut().zip(run.outputs.row(k + 1)) {
                    *z += gain * (y - *z);
                }
                session.observe(&z);
            }
            let (mut y, commands) =
                (vec![0.0; 2 * plan.shape.length], run.inputs.rows(20, 20 + plan.shape.length));
            session.rollout(commands, &mut Workspace::new(), &mut y);
            for step in 0..plan.shape.length {
                chunk.compare(&plan.runs, step, |i, _, error| {
                    let scaled = |y: f64| (y - plan.scaling.output_mean[i]) / plan.scaling.output_scale[i];
                    let measured = scaled(run.outputs.row(21 + step)[i]);
                    let ours = scaled(y[2 * step + i]);
                    assert!((ours - measured - error).abs() < 1e-11, "{step} {i}: {ours} {measured} {error}");
                });
            }
        }
    }
}

/// A batch with few windows after a batch with non-finite values.
#[test]
fn lanes_without_a_window_count_for_nothing() {
    for base in [BaseKind::Nothing, BaseKind::Hold, BaseKind::Equations] {
        for feedback in [false, true] {
            let plan = plan_of(&TrainOptions { feedback, base, ..small(CellKind::Gru) }, &[(10, 1)]);
            let chunk = |back| plan.net.chunk(&plan.scaling, plan.shape, 20, back);
            let weights = plan.net.first::<f64>(&mut random::stream(3, random::Purpose::Weights, 0, 0));
            let windows = plan.shape.every(&plan.runs, 7);
            let go = |chunk: &mut MiniBatch<f64>| {
                chunk.forward(&weights, &plan.runs, &windows[..3]);
                let mut gradient = vec![f64::NAN; weights.len()];
                chunk.backward(&weights, &plan.runs, &channel_weights(&plan), 0.7, &mut gradient);
                let mut sums = [[0.0; 2]; 2];
                chunk.squares(&plan.runs, plan.shape.length, &mut sums);
                (gradient, sums)
            };
            let mut used = chunk(true);
            for scale in [f64::NAN, 1e200] {
                let wild: Vec<f64> = weights.iter().map(|w| scale * w).collect();
                used.forward(&wild, &plan.runs, &windows);
                used.backward(&wild, &plan.runs, &channel_weights(&plan), 0.7, &mut vec![0.0; wild.len()]);
            }
            let (gradient, sums) = go(&mut used);
            assert!(gradient.iter().all(|g| g.is_finite()));
            assert_eq!((&gradient, sums), (&go(&mut chunk(true)).0, sums), "{base:?} {feedback}");
            // Forward pass without records for the backward pass.
            let (mut forward, mut others) = (chunk(false), [[0.0; 2]; 2]);
            forward.forward(&weights, &plan.runs, &windows[..3]);
            forward.squares(&plan.runs, plan.shape.length, &mut others);
            assert_eq!(others, sums, "{base:?} {feedback}");
        }
    }
}

fn restarts(options: &TrainOptions) -> Restarts<f64> {
    Restarts::new(plan_of(options, &[]), Phase::Selection)
}

/// Checkpoint after one epoch, and the fingerprints of its job.
fn checkpoint_bytes(options: &TrainOptions) -> (Vec<u8>, [String; 2]) {
    let mut restarts = restarts(options);
    let batches = restarts.begin(0);
    (0..batches).for_each(|batch| restarts.step(batch));
    restarts.end();
    let prints = [String::from("a"), String::from("b")];
    (checkpoint::encode(&restarts, 1, &prints).unwrap(), prints)
}

#[test]
fn a_checkpoint_holds_all_of_the_state() {
    let options = TrainOptions { restarts: 2, ..small(CellKind::Gru) };
    let (bytes, prints) = checkpoint_bytes(&options);
    let mut other = restarts(&options);
    assert_eq!(checkpoint::decode(&bytes, &prints, &mut other), Ok(1));
    assert_eq!(checkpoint::encode(&other, 1, &prints).unwrap(), bytes);
    let told = |prints: [&str; 2]| {
        checkpoint::decode(&bytes, &prints.map(str::to_owned), &mut restarts(&options)).unwrap_err()
    };
    assert!(told(["a", "c"]).contains("other data"));
    assert!(told(["c", "b"]).contains("other options"));
    assert_ne!(other.members[0].balance, [1.0; 2]);
    other.members[1].adam.steps = u64::MAX;
    let wild = checkpoint::encode(&other, 1, &prints).unwrap();
    let refused = checkpoint::decode(&wild, &prints, &mut restarts(&options)).unwrap_err();
    assert!(refused.contains("damaged"), "{refused}");
    let version = concat!("hydroid\\\":\\\"", env!("CARGO_PKG_VERSION"));
    let at = bytes.windows(version.len()).position(|part| part == version.as_bytes()).unwrap();
    let mut older = bytes;
    older[at + version.len() - 1] ^= 1;
    let refused = checkpoint::decode(&older, &prints, &mut restarts(&options)).unwrap_err();
    assert!(refused.contains("of hydroid 0."), "{refused}");
}

#[test]
fn a_damaged_best_weight_of_a_checkpoint_does_not_become_the_network() {
    let options = small(CellKind::Gru);
    let (bytes, prints) = checkpoint_bytes(&options);
    let refused = |change: &dyn Fn(&mut Restart<f64>)| {
        let mut damaged = restarts(&options);
        checkpoint::decode(&bytes, &prints, &mut damaged).unwrap();
        change(&mut damaged.members[0]);
        let bytes = checkpoint::encode(&damaged, 1, &prints).unwrap();
        checkpoint::decode(&bytes, &prints, &mut restarts(&options)).unwrap_err()
    };
    for change in [
        (|member| member.best[3] = f64::NAN) as fn(&mut Restart<f64>),
        |member| member.best_score = f64::NAN,
        |member| member.best_score = f64::NEG_INFINITY,
        |member| member.best_epoch = 0,
    ] {
        let refused = refused(&change);
        assert!(refused.contains("the best weights of restart 1"), "{refused}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn reading_a_checkpoint_never_panics(
        cut in any::<prop::sample::Index>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
    ) {
        let options = TrainOptions { hidden: 2, ..small(CellKind::Lstm) };
        let (mut bytes, prints) = checkpoint_bytes(&options);
        // Most of the file is numbers: changes in its front part are the ones that can be invalid.
        let front = bytes.len().min(700);
        for (at, value) in changes {
            bytes[at.index(front)] = value;
        }
        let _ = checkpoint::decode(&bytes, &prints, &mut restarts(&options));
        bytes.truncate(cut.index(bytes.len()));
        prop_assert!(checkpoint::decode(&bytes, &prints, &mut restarts(&options)).is_err());
    }
}

#[test]
fn bases_are_what_was_asked_for() {
    for (base, ratio) in [(BaseKind::Nothing, 1.0), (BaseKind::Hold, 0.1), (BaseKind::Equations, 0.1)] {
        let plan = plan_of(&TrainOptions { base, ..small(CellKind::Gru) }, &[]);
        for (correction, scale) in plan.scaling.correction_scale.iter().zip(&plan.scaling.output_scale) {
            assert!(correction / scale <= ratio && correction / scale >= 1e-3, "{base:?}");
        }
        let Architecture::Recurrent { base: made, .. } = &plan.net else { panic!("no recurrent network") };
        assert_eq!(matches!(made, BaseModel::Nothing), base == BaseKind::Nothing);
    }
}
