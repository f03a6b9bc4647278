//! The filter of recurrent networks in exported C, against that of hydroid.

mod derivatives;
mod learned;

use std::sync::Arc;

use hydroid::adapt::{self, CovarianceForm, Options};
use hydroid::model::{Body, Model};
use hydroid_core::model::recurrent::{BaseModel, Recurrent};
use hydroid_export::{COptions, Format, Precision, check, export};

use crate::learning::{CLANG, FAST, Run, SANITIZED, apart};
use crate::models::{all, commands, first_outputs};
use crate::run::{difference, rollout, steady};
use learned::{Learned, Plan, in_c, simulated};

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
    let (numbers, header) = in_c(model, (options, precision), (run, plan), flags);
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

/// By how much hydroid learns otherwise if the weights of the model differ by their rounding.
fn sensitivity((model, options): &(Model, Options), run: &Run, plan: &Plan) -> f64 {
    let Body::Recurrent(network) = &model.body else { return 0.0 };
    let mut network = Recurrent::clone(network);
    network.weights.iter_mut().for_each(|weight| *weight *= 1.0 + f64::EPSILON);
    let rounded = Model { body: Body::Recurrent(Arc::new(network)), ..model.clone() };
    let [exact, rounded] = [model, &rounded].map(|model| Learned::of(model, options, run, plan));
    let far = apart(&exact.weights, &rounded.weights).max(apart(&exact.outputs, &rounded.outputs));
    far.max(apart(&exact.predicted, &rounded.predicted))
}

const TOLERANCE: f64 = 1e-9;

/// Compares, with a tolerance of the relative differences.
fn agree((model, options): &(Model, Options), run: &Run, plan: &Plan, flags: &[&str], tolerance: f64) {
    let [weights, outputs, predicted] = compare(model, options, Precision::Double, (run, plan), flags);
    let name = &model.description.name;
    println!("{name}: weights {weights:.1e}, outputs {outputs:.1e}, predictions {predicted:.1e}");
    let most = weights.max(outputs).max(predicted);
    assert!(most < tolerance, "{name}: {weights} {outputs} {predicted}, tolerance {tolerance}");
}

const SHORT: Plan = Plan { anew: 500, frozen: 600, learning: 650, copied: 400, every: 10 };

#[test]
fn the_filter_in_c_learns_as_in_hydroid() {
    for network in some() {
        agree(&network, &simulated(&network.0, 800), &SHORT, &FAST, TOLERANCE);
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn all_filters_learn_along_a_long_run() {
    let samples = 5_000;
    let plan = Plan { anew: 3000, frozen: 4000, learning: 4150, copied: samples / 2, every: 50 };
    for network in networks() {
        agree(&network, &simulated(&network.0, samples), &plan, &FAST, TOLERANCE);
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

/// The filter learns anew several times: a network that gives the outputs, not their increments, then amplifies roundings. The
/// sensitivity of hydroid is the scale of the tolerance.
fn recovers(network: &(Model, Options), compilers: &[&[&str]]) {
    let run = disturbed(&network.0, 800);
    let tolerance = TOLERANCE.max(10.0 * sensitivity(network, &run, &SHORT));
    assert!(tolerance < 1e-7, "{}: {tolerance}", network.0.description.name);
    for flags in compilers {
        agree(network, &run, &SHORT, flags, tolerance);
    }
}

#[test]
fn the_filter_in_c_recovers_as_in_hydroid() {
    for network in some() {
        recovers(&network, &[&FAST]);
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn all_filters_recover() {
    for network in networks() {
        recovers(&network, &[&SANITIZED, &CLANG]);
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
        agree(&network, &simulated(&network.0, 800), &SHORT, &FAST, TOLERANCE);
    }
    let (mut model, mut options) = some().remove(0);
    model.description.name = String::from("constant weights");
    (options.kalman.weight_variance, options.kalman.weight_noise_per_s) = (0.0, 0.0);
    agree(&(model.clone(), options), &simulated(&model, 800), &SHORT, &FAST, TOLERANCE);
}

const BRIEF: Plan = Plan { anew: 250, frozen: 270, learning: 280, copied: 200, every: 10 };

/// In single precision, along 300 samples. The tolerance of all networks is that of the one that amplifies roundings most.
fn single((model, options): &(Model, Options), flags: &[&str], tolerance: f64) {
    let run = simulated(model, 300);
    let far = compare(model, options, Precision::Float, (&run, &BRIEF), flags);
    let name = &model.description.name;
    println!("{name}: {:.1e} {:.1e} {:.1e}", far[0], far[1], far[2]);
    assert!(far.iter().all(|far| *far < tolerance), "{name}: {far:?}");
}

#[test]
fn the_filter_in_single_precision_stays_near() {
    for network in some() {
        single(&network, &FAST, 2e-3);
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn all_filters_in_single_precision() {
    for network in networks() {
        single(&network, &CLANG, 2e-2);
        single(&network, &SANITIZED, 2e-2);
    }
}

/// Root of the mean square of the errors of the predictions by a sample, from a sample on.
fn rms(learned: &Learned, run: &Run, from: usize) -> f64 {
    let n = run.first.len();
    let predicted = learned.outputs.chunks_exact(2 * n).map(|both| &both[..n]);
    let rows = predicted.zip(run.measured.chunks_exact(n)).skip(from);
    let errors = rows.flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b)).filter(|e| !e.is_nan());
    let (sum, count) = errors.fold((0.0, 0.0), |(sum, count), e| (sum + e * e, count + 1.0));
    f64::sqrt(sum / count)
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn filters_in_single_precision_predict_as_well_along_a_long_run() {
    let samples = 10_000;
    let plan = Plan { anew: samples, frozen: samples, learning: samples, copied: samples, every: 5000 };
    for (model, options) in networks() {
        let (name, run) = (&model.description.name, simulated(&model, samples));
        let double = Learned::of(&model, &options, &run, &plan);
        let (numbers, _) = in_c(&model, (&options, Precision::Float), (&run, &plan), &FAST);
        let single = Learned::read(&numbers[1..], samples, 3, double.weights.len() / 2, &plan);
        assert_eq!(double.results, single.results, "{name}");
        let [start, end, of_single] = [(&double, 100), (&double, 8000), (&single, 8000)]
            .map(|(learned, from)| rms(learned, &run, from));
        println!("{name}: {start:.4}, at the end {end:.4}, in single precision {of_single:.4}");
        assert!((of_single / end - 1.0).abs() < 0.01, "{name}: {end} {of_single}");
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
