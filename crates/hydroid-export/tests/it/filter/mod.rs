//! The filter of recurrent networks in exported C, against that of hydroid.

mod derivatives;
mod program;

use std::sync::Arc;

use hydroid::adapt::{self, CovarianceForm, Options};
use hydroid::model::{Body, Model};
use hydroid_core::adapt::{Adapter, Outcome};
use hydroid_core::model::recurrent::{BaseModel, Recurrent};
use hydroid_core::predict::Workspace;
use hydroid_export::{COptions, Format, Precision, check, export};

use crate::models::{all, commands, drawn, first_outputs};
use crate::run::{difference, rollout, steady};
use program::{AHEAD, CLANG, FAST, Plan, SANITIZED};

/// A run: commands and measurements, row by row.
#[derive(Clone)]
pub(crate) struct Run {
    first: Vec<f64>,
    held: Vec<f64>,
    commands: Vec<f64>,
    measured: Vec<f64>,
}

/// Measurements of a vessel that is not the model: each output follows a mixture of the commands, whose effect changes along
/// the run, behind a lag. There are missing values, and an outlier.
fn simulated(model: &Model, samples: usize) -> Run {
    let (first, held) = (first_outputs(model), commands(model, 1, 0.4));
    let (n, m) = (first.len(), held.len());
    let given = commands(model, samples, 2.0);
    let mut y = first.clone();
    let mut measured = Vec::new();
    for (k, c) in given.chunks_exact(m).enumerate() {
        let effect = 0.8 - 0.5 * k as f64 / samples as f64;
        for (i, y) in y.iter_mut().enumerate() {
            let target: f64 = c.iter().enumerate().map(|(j, c)| effect * c / (1 + i + j) as f64).sum();
            *y += (0.1 + 0.05 * i as f64) * (target - *y);
        }
        let noise = drawn(n, k as f64);
        let mut row: Vec<f64> = y.iter().zip(noise).map(|(y, noise)| y + 0.01 * noise).collect();
        if k % 97 == 13 {
            row[k % n] = f64::NAN;
        }
        if k == samples / 3 {
            row[k % n] += 1.0;
        }
        if (samples / 5..samples / 5 + 60).contains(&k) {
            row.fill(f64::NAN);
        }
        measured.extend(row);
    }
    Run { first, held, commands: given, measured }
}

/// What happens along a run.
#[derive(Debug, Default, PartialEq)]
struct Learned {
    /// Outputs after each step, and after each measurement.
    outputs: Vec<f64>,
    /// Whether each measurement was used: 0, 1, or 2 for a divergence.
    results: Vec<f64>,
    weights: Vec<f64>,
    predicted: Vec<f64>,
}

/// Starts a run. The memory of a base and the positions of actuators are those of a steady motion.
fn start(adapter: &mut dyn Adapter, model: &Model, run: &Run) {
    adapter.reset();
    let Body::Recurrent(network) = &model.body else { return };
    let unlimited = model.description.inputs.iter().all(|port| port.rate_limit.is_none());
    if unlimited && matches!(network.base, BaseModel::Nothing | BaseModel::Hold) {
        return adapter.observe(&run.first);
    }
    let session = steady(model, &run.first, &run.held);
    let mut snapshot = vec![0.0; session.snapshot_len()];
    session.snapshot(&mut snapshot);
    let front = snapshot.len() - network.network.state_len();
    snapshot[front..].fill(0.0);
    snapshot.extend(adapter.weights());
    adapter.restore(&snapshot);
}

impl Learned {
    fn of(model: &Model, options: &Options, run: &Run, plan: &Plan) -> Self {
        let (mut adapter, _) = adapt::adapter(model, options, &[]).unwrap();
        let (n, m) = (run.first.len(), run.held.len());
        let mut own = Self::default();
        let mut work = Workspace::new();
        let (mut y, mut ahead) = (vec![0.0; n], vec![0.0; AHEAD * n]);
        for (k, (c, row)) in run.commands.chunks_exact(m).zip(run.measured.chunks_exact(n)).enumerate() {
            if k == 0 || k == plan.anew {
                start(adapter.as_mut(), model, run);
            }
            adapter.freeze((plan.frozen..plan.learning).contains(&k));
            adapter.advance(c);
            adapter.output(&mut y);
            own.outputs.extend(&y);
            adapter.observe(row);
            adapter.output(&mut y);
            own.outputs.extend(&y);
            own.results.push(match adapter.outcome() {
                Outcome::Rejected(_) => 2.0,
                Outcome::Waiting => 0.0,
                _ if (plan.frozen..plan.learning).contains(&k) => 0.0,
                _ => 1.0,
            });
            if k % plan.every == 0 {
                own.weights.extend(adapter.weights());
                adapter.rollout(&run.commands[..AHEAD * m], &mut work, &mut ahead);
                own.predicted.extend(&ahead);
            }
        }
        own
    }

    /// From the numbers of the program.
    fn read(numbers: &[f64], samples: usize, n: usize, weights: usize, plan: &Plan) -> Self {
        let mut own = Self::default();
        let mut rest = numbers;
        let mut take = |count: usize| {
            let (taken, after) = rest.split_at(count);
            rest = after;
            taken
        };
        for k in 0..samples {
            own.outputs.extend(take(2 * n));
            own.results.extend(take(1));
            if k % plan.every == 0 {
                own.weights.extend(take(weights));
                own.predicted.extend(take(AHEAD * n));
            }
        }
        assert!(rest.is_empty());
        own
    }
}

/// The largest difference of numbers, relative to the largest of them. A number that is not finite differs from all others.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let largest = a.iter().filter(|a| a.is_finite()).map(|a| a.abs()).fold(1e-9, f64::max);
    let of = |(a, b): (&f64, &f64)| match (a.is_finite(), b.is_finite()) {
        (true, true) => (a - b).abs() / largest,
        (false, false) => 0.0,
        _ => f64::INFINITY,
    };
    a.iter().zip(b).map(of).fold(0.0, f64::max)
}

/// Learns along a run in C and in Rust. Returns the differences of weights, outputs and predictions.
fn compare(
    model: &Model,
    options: &Options,
    precision: Precision,
    (run, plan): (&Run, &Plan),
    flags: &[&str],
) -> [f64; 3] {
    let title = &model.description.name;
    let expected = Learned::of(model, options, run, plan);
    let (numbers, header) = program::run(model, (options, precision), (run, plan), flags);
    let (n, samples) = (run.first.len(), run.commands.len() / run.held.len());
    let weights = expected.weights.len() / samples.div_ceil(plan.every);
    let (size, numbers) = numbers.split_first().unwrap();
    assert!(header.contains(&format!("memory of the method: {size} bytes")), "{title}: {size}");
    let found = Learned::read(numbers, samples, n, weights, plan);
    if precision == Precision::Double {
        let differs = (0..samples).find(|&k| expected.results[k] != found.results[k]);
        assert_eq!(differs, None, "{title}: first sample with another result");
    }
    let moved = apart(&expected.weights[..weights], &expected.weights[expected.weights.len() - weights..]);
    let learns = options.kalman.weight_variance > 0.0;
    assert!(if learns { moved > 1e-2 } else { moved == 0.0 }, "{title}: the weights move by {moved}");
    [
        apart(&expected.weights, &found.weights),
        apart(&expected.outputs, &found.outputs),
        apart(&expected.predicted, &found.predicted),
    ]
}

/// Networks with known noise of the measurements.
fn networks() -> Vec<(Model, Options)> {
    let learns = |mut model: Model| {
        let Body::Recurrent(network) = &model.body else { return None };
        if network.base == BaseModel::Nothing {
            // The network gives the outputs, not their increments.
            let mut network = Recurrent::clone(network);
            network.scaling.correction_scale.clone_from(&network.scaling.output_scale);
            model.body = Body::Recurrent(Arc::new(network));
        }
        model.description.outputs.iter_mut().for_each(|port| port.noise = Some(0.01));
        let options = Options::of(&model);
        Some((model, options))
    };
    all().into_iter().filter_map(learns).collect()
}

/// One network of each cell, with and without feedback, on each base.
fn some() -> Vec<(Model, Options)> {
    let names = [
        "lstm with projection on hold",
        "lstm on nothing, without feedback",
        "gru on equations, without feedback",
        "rnn on hold, without feedback",
        "rnn on equations",
    ];
    let mut networks = networks();
    networks.retain(|(model, _)| names.contains(&model.description.name.as_str()));
    assert_eq!(networks.len(), names.len());
    networks
}

/// Compares with the tolerance of a relative difference of 1e-9.
fn agree((model, options): &(Model, Options), run: &Run, plan: &Plan, flags: &[&str]) {
    let [weights, outputs, predicted] = compare(model, options, Precision::Double, (run, plan), flags);
    let name = &model.description.name;
    println!("{name}: weights {weights:.1e}, outputs {outputs:.1e}, predictions {predicted:.1e}");
    assert!(weights < 1e-9 && outputs < 1e-9 && predicted < 1e-9, "{name}: {weights} {outputs} {predicted}");
}

const SHORT: Plan = Plan { anew: 500, frozen: 600, learning: 650, copied: 400, every: 10 };

#[test]
fn the_filter_in_c_learns_as_in_hydroid() {
    for network in some() {
        agree(&network, &simulated(&network.0, 800), &SHORT, &FAST);
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn all_filters_learn_along_a_long_run() {
    let samples = 10_000;
    let plan = Plan { anew: 6000, frozen: 8000, learning: 8300, copied: samples / 2, every: 50 };
    for network in networks() {
        agree(&network, &simulated(&network.0, samples), &plan, &FAST);
    }
}

/// A run with commands and measurements that are not finite.
fn disturbed(model: &Model, samples: usize) -> Run {
    let mut run = simulated(model, samples);
    let (n, m) = (run.first.len(), run.held.len());
    run.commands[100 * m] = f64::NAN;
    run.commands[220 * m + 1] = f64::INFINITY;
    run.measured[300 * n + 1] = f64::INFINITY;
    run.measured[420 * n] = f64::NEG_INFINITY;
    // After each of them, some outputs are measured before others.
    for k in [100, 101, 102, 220, 300, 301, 420, 421, 422, 423] {
        run.measured[k * n + 2] = f64::NAN;
    }
    run
}

#[test]
fn the_filter_in_c_recovers_as_in_hydroid() {
    for network in some() {
        let run = disturbed(&network.0, 800);
        agree(&network, &run, &SHORT, &FAST);
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn all_filters_recover() {
    for network in networks() {
        let run = disturbed(&network.0, 800);
        agree(&network, &run, &SHORT, &SANITIZED);
        agree(&network, &run, &SHORT, &CLANG);
    }
}

/// Networks with other options of the filter than the defaults, and behind a limit of the rate.
fn variants() -> Vec<(Model, Options)> {
    let (model, defaults) = some().remove(0);
    let named = |name: &str, change: &dyn Fn(&mut Model, &mut Options)| {
        let (mut model, mut options) = (model.clone(), defaults.clone());
        name.clone_into(&mut model.description.name);
        change(&mut model, &mut options);
        (model, options)
    };
    let limited = |model: &mut Model, _: &mut Options| model.description.inputs[1].rate_limit = Some(0.9);
    let mut variants = vec![
        named("Huber's loss", &|_, options| options.kalman.huber = 2.5),
        named("forgetting", &|_, options| options.kalman.forgetting_s = 60.0),
        named("no leak", &|_, options| options.kalman.leak_s = f64::INFINITY),
        named("limit of the rate", &|model, options| limited(model, options)),
    ];
    for (mut model, mut options) in some() {
        if model.description.name.contains("without feedback") {
            limited(&mut model, &mut options);
            model.description.name.push_str(", limit of the rate");
            variants.push((model, options));
        }
    }
    variants
}

#[test]
fn all_options_of_the_filter_act_in_c_as_in_hydroid() {
    for network in variants() {
        agree(&network, &simulated(&network.0, 800), &SHORT, &FAST);
    }
    let (mut model, mut options) = some().remove(0);
    model.description.name = String::from("constant weights");
    (options.kalman.weight_variance, options.kalman.weight_noise_per_s) = (0.0, 0.0);
    agree(&(model.clone(), options), &simulated(&model, 800), &SHORT, &FAST);
}

const BRIEF: Plan = Plan { anew: 250, frozen: 270, learning: 280, copied: 200, every: 10 };

/// In single precision, along 300 samples. Networks of 3 to 6 cells that give the outputs, not their increments, amplify
/// differences of the weights up to a hundred thousand times along such a run, in double precision, too.
fn single((model, options): &(Model, Options), flags: &[&str]) {
    let run = simulated(model, 300);
    let far = compare(model, options, Precision::Float, (&run, &BRIEF), flags);
    let name = &model.description.name;
    println!("{name}: {:.1e} {:.1e} {:.1e}", far[0], far[1], far[2]);
    let tolerance = if name.contains("nothing") { 5e-2 } else { 1e-3 };
    assert!(far.iter().all(|far| *far < tolerance), "{name}: {far:?}");
}

#[test]
fn the_filter_in_single_precision_stays_near() {
    for network in some() {
        single(&network, &FAST);
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn all_filters_in_single_precision() {
    for network in networks() {
        single(&network, &CLANG);
        single(&network, &SANITIZED);
    }
}

#[test]
fn rollouts_with_weights_in_the_state_are_those_of_the_session() {
    for (model, options) in networks().into_iter().chain(variants()) {
        let (name, n) = (&model.description.name, model.description.outputs.len());
        let (y, c) = (first_outputs(&model), commands(&model, 1, 0.4));
        let mut run = check::Run::of_learning(&model, &options, &y, &c).unwrap();
        let mut session = steady(&model, &y, &c);
        let along = simulated(&model, 60);
        for (c, row) in along.commands.chunks_exact(c.len()).zip(along.measured.chunks_exact(n)) {
            session.advance(c);
            session.observe(row);
            run.step(c);
            run.observe(row);
        }
        let ahead = commands(&model, 300, 1.0);
        let far = difference(&rollout(&*session, &ahead), &run.rollout(&ahead), n);
        assert!(far < 1e-12, "{name}: {far}");
    }
}

#[test]
fn options_that_c_does_not_have_are_refused() {
    let (model, options) = some().remove(0);
    let refusal = |change: &dyn Fn(&mut Options)| {
        let mut options = options.clone();
        change(&mut options);
        let c = COptions { adapter: Some(Box::new(options)), ..COptions::default() };
        let names = hydroid_export::Options { name: String::from("boat") };
        export(&model, &Format::C(c), &names).unwrap_err().to_string()
    };
    let rehearsal = refusal(&|options| options.kalman.rehearsal = Some(adapt::Rehearse::default()));
    assert!(rehearsal.contains("without rehearsal"), "{rehearsal}");
    let blocks = CovarianceForm::Blocks { group: 2 };
    let blocks = refusal(&|options| options.kalman.covariance = blocks);
    assert!(blocks.contains("covariance"), "{blocks}");
    let negative = refusal(&|options| options.kalman.noise = Some(vec![-1.0, 0.1, 0.1]));
    assert!(negative.contains('u'), "{negative}");
}
