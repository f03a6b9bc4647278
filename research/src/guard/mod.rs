//! Campaign on the guard: adaptation with and without it on days with drawn faults, and on clean days.
//!
//! A day of a seed draws a case (a model with logs), a log, faults (stated in `day.rs`), the options of a Kalman filter (each variance
//! and the leak within a factor of 30 of its default), and with a probability of 0.15 it multiplies every weight of a
//! recurrent network by 0.4 to 1.6. Three sessions follow the day: the learner without guard, the learner with guard, and
//! the reference model, which gets the measurements that the guard used. At every sample each predicts the horizon of the
//! guard with the recorded commands; errors are those against the truth. With the weights of the guarantee,
//!
//! ```text
//! excess = max over time of (sum b^age (e_guarded - factor e_reference)) / B - 1        B = floors floor / (1 - b)
//! ```
//!
//! is positive where the guarantee is exceeded. It holds by its proof for errors against the measurements that were used at
//! the tests; the excess also contains what faulty measurements, noise and the samples between two tests add.

mod adversary;
mod along;
mod day;
mod summary;

use std::ops::{ControlFlow, Range};

use anyhow::{Context as _, ensure};
use hydroid::adapt::{self, KalmanOptions, Options};
use hydroid::log::Trajectory;
use hydroid::model::{Body, Model};
use hydroid_core::adapt::Adapter;
use hydroid_core::adapt::guard::GuardOptions;
use hydroid_study::{Plan, Runner, Store};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

pub use summary::{Summary, summary};

use along::{Along, Detections, along};
use day::Day;

/// Options of a filter are drawn within this factor of their defaults.
const FACTOR: f64 = 30.0;

/// A model with logs that it did not learn from, and the start of a training log, along which the sessions settle.
#[derive(Clone, Debug)]
pub struct Case {
    /// Name in the report.
    pub name: String,
    /// The model.
    pub model: Model,
    /// Logs of a bad day, without faults.
    pub logs: Vec<Trajectory>,
    /// A training log.
    pub training: Option<Trajectory>,
}

/// Result of a day.
#[derive(Clone, Debug, Serialize)]
pub struct DayResult {
    /// Seed; `None` for a clean day.
    pub seed: Option<u64>,
    /// Name of the case.
    pub case: String,
    /// Kind of the model.
    pub kind: &'static str,
    /// Name of the log.
    pub log: String,
    /// Faults, with sizes and times in samples.
    pub faults: String,
    /// Mean errors of the reference, the unguarded and the guarded model, in half design ranges.
    pub errors: [f64; 3],
    /// Ratio of the guarded to the unguarded mean error, and of each output.
    pub cost: f64,
    /// The same for each output.
    pub cost_by_output: Vec<f64>,
    /// Excess of the unguarded and of the guarded model over the guarantee, relative to its constant.
    pub excess: [f64; 2],
    /// Sound samples of all outputs, and false alarms.
    pub false_alarms: [usize; 2],
    /// Spikes and detected ones.
    pub spikes: [usize; 2],
    /// Jumps and those held back within 2 s.
    pub jumps_held: [usize; 2],
    /// Stuck outputs and detected ones.
    pub stuck: [usize; 2],
    /// Longest stretch of samples with a held output.
    pub longest_hold: usize,
    /// Outputs that were trusted against the gate.
    pub trusts: usize,
    /// Mean errors of the unguarded and the guarded model during the faults of sensors, from 2 to 5 s after the last one has
    /// ended, and from 20 to 40 s after; NaN (`null`) if the day has no such time.
    pub during: [f64; 2],
    /// See [`during`](Self::during).
    pub soon: [f64; 2],
    /// See [`during`](Self::during).
    pub later: [f64; 2],
}

/// Result of a campaign.
#[derive(Clone, Debug, Serialize)]
pub struct Campaign {
    /// Bad days, in the order of their seeds.
    pub bad: Vec<DayResult>,
    /// Clean days: every model along every log.
    pub clean: Vec<DayResult>,
}

/// The built-in cases: equations, direct and recurrent networks on the simple vessel and the hydrofoil. Networks are
/// trained on first use, and stored in `store`.
pub fn built_in(quick: bool, store: &Store) -> anyhow::Result<Vec<Case>> {
    let plan = Plan::built_in(quick)?;
    let runner = Runner::new(&plan, store, &|_| ControlFlow::Continue(()));
    let lawns = ["lawn_1", "lawn_2", "lawn_3"];
    let models: [(&str, &str, &[&str]); 6] = [
        ("sindy_simple", "simple_train", &["simple_test"]),
        ("direct_simple", "simple_train", &["simple_test"]),
        ("sindy_hydrofoil", "both_train", &lawns),
        ("gru_low", "low_train", &lawns),
        ("lstm_low", "low_train", &lawns),
        ("rnn_low", "low_train", &lawns),
    ];
    let mut cases = Vec::new();
    for (name, training, logs) in models {
        let learned = runner.models(name)?;
        for one in learned.iter() {
            let logs: anyhow::Result<_> =
                logs.iter().map(|log| Ok(start(&runner.record(log)?.run, LONGEST))).collect();
            cases.push(Case {
                name: format!("{name}-seed{}", one.seed),
                model: one.model.clone(),
                logs: logs?,
                training: Some(start(&runner.record(training)?.run, TRAINING)),
            });
        }
    }
    Ok(cases)
}

/// Largest number of samples of a day.
const LONGEST: usize = 4000;

/// Least number of samples of a day beyond the horizon: the sensor check and the states of the models settle first.
const SHORTEST: usize = 400;

/// Samples of a training log.
const TRAINING: usize = 2000;

/// The first samples of a run.
fn start(run: &Trajectory, most: usize) -> Trajectory {
    if run.len() > most { run.slice(0, most) } else { run.clone() }
}

impl Case {
    /// A model with logs, of which a day takes the first 4,000 samples.
    pub fn new(name: String, model: Model, logs: &[Trajectory]) -> Self {
        Self { name, model, logs: logs.iter().map(|run| start(run, LONGEST)).collect(), training: None }
    }

    /// An error if no day can be drawn.
    fn check(&self) -> anyhow::Result<()> {
        ensure!(!self.logs.is_empty(), "every model needs a log: give one with --log");
        let inputs = &self.model.description.inputs;
        ensure!(!inputs.is_empty(), "the model {} has no inputs, and faults of commands need one", self.name);
        let least = SHORTEST + GuardOptions::new(self.model.description.dt).horizon;
        for Trajectory { name, outputs, .. } in &self.logs {
            ensure!(
                outputs.len() >= least,
                "the log {name} has {} samples, and a day needs at least {least}: give a longer log",
                outputs.len()
            );
        }
        Ok(())
    }
}

/// Runs the bad days of the seeds, and the clean days.
pub fn campaign(cases: &[Case], seeds: Range<u64>, clean: bool) -> anyhow::Result<Campaign> {
    cases.iter().try_for_each(Case::check)?;
    let of_case = |case: usize| (0..cases[case].logs.len()).map(move |log| (case, log));
    let clean_days: Vec<(usize, usize)> =
        if clean { (0..cases.len()).flat_map(of_case).collect() } else { Vec::new() };
    let bad = seeds.into_par_iter().map(|seed| bad_day(cases, seed)).collect::<anyhow::Result<_>>()?;
    let clean_day = |(case, log): (usize, usize)| {
        let case = &cases[case];
        let run = &case.logs[log];
        let noise = noise_of(&case.model, run);
        let options = with_noise(&case.model, &noise);
        judge(case, &case.model, &Day::clean(run), &noise, &options, None, &run.name)
    };
    let clean = clean_days.into_par_iter().map(clean_day).collect::<anyhow::Result<_>>()?;
    Ok(Campaign { bad, clean })
}

/// The worst days that an adversary finds with each seed, after a number of generations; see `adversary.rs`.
pub fn adversary(cases: &[Case], seeds: Range<u64>, generations: usize) -> anyhow::Result<Campaign> {
    cases.iter().try_for_each(Case::check)?;
    let found: Vec<Vec<DayResult>> =
        seeds.map(|seed| adversary::search(cases, seed, generations)).collect::<anyhow::Result<_>>()?;
    Ok(Campaign { bad: found.into_iter().flatten().collect(), clean: Vec::new() })
}

fn bad_day(cases: &[Case], seed: u64) -> anyhow::Result<DayResult> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let case = &cases[rng.random_range(0..cases.len())];
    let run = &case.logs[rng.random_range(0..case.logs.len())];
    let noise = noise_of(&case.model, run);
    let range = &case.model.description.outputs[0].range;
    let day = Day::draw(run, &noise, range.high - range.low, &mut rng);
    let mut model = case.model.clone();
    let spoiled = rng.random::<f64>() < 0.15;
    if let (true, Body::Recurrent(network)) = (spoiled, &mut model.body) {
        let network = std::sync::Arc::make_mut(network);
        network.weights.iter_mut().for_each(|w| *w *= 0.4 + 1.2 * rng.random::<f64>());
    }
    let mut options = with_noise(&model, &noise);
    let mut factor = || FACTOR.powf(2.0 * rng.random::<f64>() - 1.0);
    let kalman = &mut options.kalman;
    for value in [
        &mut kalman.weight_variance,
        &mut kalman.weight_noise_per_s,
        &mut kalman.state_noise_per_s,
        &mut kalman.noise_factor,
        &mut kalman.leak_s,
    ] {
        *value *= factor();
    }
    judge(case, &model, &day, &noise, &options, Some(seed), &run.name)
}

/// Standard deviations of the noise: from the truth, or a share of the design range.
fn noise_of(model: &Model, run: &Trajectory) -> Vec<f64> {
    let of = |i: usize| {
        let range = &model.description.outputs[i].range;
        let least = 1e-3 * (range.high - range.low);
        let Some(truth) = &run.truth else { return 2.0 * least };
        let off = run.outputs.column(i).zip(truth.column(i)).map(|(y, t)| (y - t).powi(2));
        let (sum, count) = off.filter(|x| x.is_finite()).fold((0.0, 0_u32), |(sum, n), x| (sum + x, n + 1));
        f64::max((sum / f64::from(count.max(1))).sqrt(), least)
    };
    (0..run.outputs.width()).map(of).collect()
}

fn with_noise(model: &Model, noise: &[f64]) -> Options {
    let options = Options::of(model);
    Options { kalman: KalmanOptions { noise: Some(noise.to_vec()), ..options.kalman }, ..options }
}

fn judge(
    case: &Case,
    model: &Model,
    day: &Day,
    noise: &[f64],
    options: &Options,
    seed: Option<u64>,
    log: &str,
) -> anyhow::Result<DayResult> {
    let ports = &model.description.outputs;
    let scale: Vec<f64> = ports.iter().map(|port| 0.5 * (port.range.high - port.range.low)).collect();
    let settings = GuardOptions::new(model.description.dt);
    let failed = || format!("the model {} cannot be adapted", case.name);
    let adapter = |options: &Options| -> anyhow::Result<Box<dyn Adapter>> {
        let mut session = adapt::adapter(model, options, &[&day.run]).with_context(failed)?.0;
        if let Some(training) = &case.training {
            adapt::replay_training_runs(session.as_mut(), &[training]);
        }
        Ok(session)
    };
    let mut used = Vec::new();
    let follow = |session: &mut dyn Adapter, measured: Option<&[f64]>, seen: &mut Vec<f64>| {
        along(session, day, &scale, &settings, measured, seen)
    };
    let alone = follow(adapter(options)?.as_mut(), None, &mut Vec::new());
    let guarded_options = Options { guard: Some(settings.clone()), ..options.clone() };
    let guarded = follow(adapter(&guarded_options)?.as_mut(), None, &mut used);
    let mut reference = adapt::reference(model, options, &[&day.run]).with_context(failed)?;
    let reference = follow(reference.as_mut(), Some(&used), &mut Vec::new());
    let floor =
        noise.iter().zip(&scale).map(|(noise, scale)| noise / scale).sum::<f64>() / noise.len() as f64;
    let excess = |own: &Along| {
        let past = (-1.0 / settings.window as f64).exp();
        let constant = settings.floors * floor / (1.0 - past);
        let mut sum = 0.0;
        let each = own.errors.iter().zip(&reference.errors).map(|(own, reference)| {
            sum = past * sum + own - settings.factor * reference;
            sum
        });
        each.fold(f64::NEG_INFINITY, f64::max) / constant - 1.0
    };
    let mean = |own: &Along| own.errors.iter().sum::<f64>() / own.errors.len().max(1) as f64;
    let begin = day.faults.iter().map(|fault| fault.from).min().unwrap_or(usize::MAX);
    let end = day.faults.iter().map(|fault| fault.to).max().unwrap_or(0);
    // A horizon is 2 s.
    let horizon = settings.horizon;
    let errors = |samples: Range<usize>| [&alone, &guarded].map(|own| own.mean(samples.clone()));
    let Detections { sound, false_alarms, spikes, jumps, stuck, longest_hold, trusts } = guarded.detections;
    Ok(DayResult {
        seed,
        case: case.name.clone(),
        kind: model.kind(),
        log: log.to_owned(),
        faults: day.text.clone(),
        errors: [mean(&reference), mean(&alone), mean(&guarded)],
        cost: mean(&guarded) / mean(&alone),
        cost_by_output: guarded.by_output.iter().zip(&alone.by_output).map(|(a, b)| a / b).collect(),
        excess: [excess(&alone), excess(&guarded)],
        false_alarms: [sound, false_alarms],
        spikes,
        jumps_held: jumps,
        stuck,
        longest_hold,
        trusts,
        during: errors(begin..end),
        soon: errors(end + horizon..end + 5 * horizon / 2),
        later: errors(end + 10 * horizon..end + 20 * horizon),
    })
}
