//! Online adaptation of direct predictors on logs with truth, by several methods, compared with the frozen networks.
//!
//! ```text
//! cargo run --release -p hydroid-research --bin direct_at_sea -- MODEL[,MODEL ..] LOG[,LOG ..] [KEY=VALUE ..]
//! ```
//!
//! Models are direct predictors with at least 20 steps; errors are medians over the models. `frozen`: as trained;
//! `read-out`: last layer adapted by recursive least squares; `guarded`: the same with the guard; `replay`: all weights
//! adapted by Adam on completed windows of the run. `forgetting` \[s\], `prior` \[s\] and `leak` (0 or 1) are options
//! of the least squares; `rate`, `batch`, `steps` (Adam steps per sample; 0 omits the method) and `last` (stored
//! windows) are those of the replay. `low=LOG` is a log at low speed, evaluated afterwards without adaptation.
//! `shore=LOG` is a training log: its first `shore_time` seconds (600) are rehearsed by the least-squares methods
//! before the run.
//!
//! Origins are samples 100, 105, ..; errors are mean absolute differences from the truth at 1, 5 and 20 steps, and
//! times are medians per sample.

mod replay;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use hydroid::adapt::{LeastSquaresOptions, Options, adapter, replay_training_runs};
use hydroid::log::{self, PrepareOptions, Selection, Trajectory};
use hydroid::model::{self, Model};
use hydroid_core::adapt::Adapter;
use hydroid_core::model::direct::Direct;
use hydroid_core::predict::Workspace;
use replay::{Replay, ReplaySettings};

type Failure = Box<dyn std::error::Error>;

const HORIZON: usize = 20;
const SHOWN: [usize; 3] = [1, 5, 20];
const STEPS: usize = SHOWN.len() + 1;
const WAYS: [&str; 4] = ["frozen", "read-out", "guarded", "replay"];

/// Mean errors of each output at the evaluated steps, then over all steps.
type Errors = [[f64; 3]; STEPS];

/// Result of one network on one log with one method.
#[derive(Clone, Copy)]
struct Outcome {
    errors: Errors,
    time_us: f64,
    low: Errors,
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [models, logs, keys @ ..] = arguments.as_slice() else {
        return Err("give MODEL[,MODEL ..] LOG[,LOG ..] [KEY=VALUE ..]".into());
    };
    let mut settings = BTreeMap::new();
    for key in keys {
        let (name, value) = key.split_once('=').ok_or("settings are KEY=VALUE")?;
        settings.insert(name.to_owned(), value.to_owned());
    }
    let models: Vec<Model> =
        models.split(',').map(|path| model::read(Path::new(path))).collect::<Result<_, _>>()?;
    let runs: Vec<Trajectory> = logs.split(',').map(read).collect::<Result<_, _>>()?;
    let low = settings.get("low").map(read).transpose()?;
    let shore = settings.get("shore").map(read).transpose()?;
    let number = |key: &str, default: f64| settings.get(key).map_or(Ok(default), |v| v.parse::<f64>());
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "casts saturate")]
    let shore = match shore {
        Some(run) => Some(run.slice(0, run.len().min((number("shore_time", 600.0)? / run.dt) as usize))),
        None => None,
    };
    let ways = if number("steps", 1.0)? > 0.0 { WAYS.len() } else { WAYS.len() - 1 };
    for run in &runs {
        println!("{} ({} windows)", run.name, (run.len() - HORIZON).saturating_sub(100).div_ceil(5));
        let mut frozen = None;
        for (way, name) in WAYS.iter().enumerate().take(ways) {
            let outcomes: Vec<Outcome> = models
                .iter()
                .map(|model| sail(model, way, run, [low.as_ref(), shore.as_ref()], &settings))
                .collect::<Result<_, _>>()?;
            let middle = |of: &dyn Fn(&Outcome) -> f64| median(outcomes.iter().map(of).collect());
            let row: Vec<String> = (0..STEPS)
                .map(|s| {
                    let of = |c: usize| format!("{:.4}", middle(&|outcome| outcome.errors[s][c]));
                    format!("{} {} {}", of(0), of(1), of(2))
                })
                .collect();
            // Ratios are computed network by network.
            let own: &Vec<Outcome> = frozen.get_or_insert_with(|| outcomes.clone());
            let ratio = |errors: &dyn Fn(&Outcome) -> Errors, c: usize| {
                let of = |(a, b): (&Outcome, &Outcome)| errors(a)[STEPS - 1][c] / errors(b)[STEPS - 1][c];
                median(outcomes.iter().zip(own).map(of).collect())
            };
            let ratios = |errors: &dyn Fn(&Outcome) -> Errors| {
                format!("{:.2} {:.2} {:.2}", ratio(errors, 0), ratio(errors, 1), ratio(errors, 2))
            };
            println!(
                "  {name:8} {} | ratio of the mean {} | low {} | {:.0} us",
                row.join("  "),
                ratios(&|outcome| outcome.errors),
                ratios(&|outcome| outcome.low),
                middle(&|outcome| outcome.time_us),
            );
        }
    }
    Ok(())
}

/// Reads a log with outputs `u`, `v`, `r`, or `u_meas` .. if these are missing.
fn read(path: impl AsRef<str>) -> Result<Trajectory, Failure> {
    let raw = log::read(Path::new(path.as_ref()))?;
    let outputs = if raw.position("u").is_some() { "u,v,r" } else { "u=u_meas,v=v_meas,r=r_meas" };
    let selection = Selection::of(outputs, "PP_cmd,RD_ang")?;
    let mut prepared = log::prepare(&[raw], &selection, &PrepareOptions::default())?;
    Ok(prepared.runs.remove(0))
}

/// Runs a network along a log, then along one at low speed.
fn sail(
    model: &Model,
    way: usize,
    run: &Trajectory,
    [low, shore]: [Option<&Trajectory>; 2],
    settings: &BTreeMap<String, String>,
) -> Result<Outcome, Failure> {
    let number = |key: &str, default: f64| settings.get(key).map_or(Ok(default), |v| v.parse::<f64>());
    let direct = model.direct().ok_or("the model is not a direct predictor")?;
    if direct.horizon < HORIZON {
        return Err(format!("the network predicts {} steps instead of {HORIZON}", direct.horizon).into());
    }
    let mut session: Box<dyn Adapter> = if WAYS[way] == "replay" {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "casts saturate")]
        let count = |key: &str, default: f64| number(key, default).map(|n| n as usize);
        if direct.equations().is_some() {
            return Err("replay does not support predictors with base equations: give steps=0".into());
        }
        Box::new(Replay::new(
            &Arc::new(Direct::clone(direct)),
            ReplaySettings {
                rate: number("rate", 3e-4)?,
                batch: count("batch", 64.0)?,
                steps: count("steps", 1.0)?,
                last: count("last", 100_000.0)?,
            },
        )?)
    } else {
        let defaults = LeastSquaresOptions::for_last_layer();
        let least_squares = LeastSquaresOptions {
            forgetting_s: number("forgetting", defaults.forgetting_s)?,
            prior_s: number("prior", defaults.prior_s)?,
            leak: number("leak", 1.0)? > 0.5,
            ..defaults
        };
        let options = Options { least_squares, ..Options::default() };
        let options = if WAYS[way] == "guarded" { options.guarded(model) } else { options };
        adapter(model, &options, &[])?.0
    };
    if WAYS[way] == "read-out" || WAYS[way] == "guarded" {
        replay_training_runs(session.as_mut(), shore.as_slice());
    }
    session.freeze(way == 0);
    let (errors, time_us) = walk(session.as_mut(), run);
    session.reset();
    session.freeze(true);
    let low = low.map_or([[f64::NAN; 3]; STEPS], |low| walk(session.as_mut(), low).0);
    Ok(Outcome { errors, time_us, low })
}

fn walk(session: &mut dyn Adapter, run: &Trajectory) -> (Errors, f64) {
    let truth = run.truth.as_ref().unwrap_or(&run.outputs);
    let commands: Vec<f64> = (0..run.len()).flat_map(|k| run.inputs.row(k).to_vec()).collect();
    let m = run.inputs.row(0).len();
    let (mut sums, mut windows) = ([[0.0; 3]; STEPS], 0.0);
    let (mut work, mut y) = (Workspace::new(), vec![0.0; 3 * HORIZON]);
    let mut times = Vec::with_capacity(run.len());
    for k in 0..run.len() - HORIZON {
        let start = Instant::now();
        session.observe(run.outputs.row(k));
        let observed = start.elapsed();
        if k >= 100 && k % 5 == 0 {
            session.rollout(&commands[m * k..m * (k + HORIZON)], &mut work, &mut y);
            for n in 0..HORIZON {
                for c in 0..3 {
                    let error = (y[3 * n + c] - truth.row(k + n + 1)[c]).abs();
                    sums[STEPS - 1][c] += error / HORIZON as f64;
                    if let Some(s) = SHOWN.iter().position(|shown| *shown == n + 1) {
                        sums[s][c] += error;
                    }
                }
            }
            windows += 1.0;
        }
        let start = Instant::now();
        session.advance(run.inputs.row(k));
        times.push(1e6 * (observed + start.elapsed()).as_secs_f64());
    }
    sums.iter_mut().flatten().for_each(|sum| *sum /= windows);
    (sums, median(times))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let of = |at: usize| values.get(at).copied().unwrap_or(f64::NAN);
    0.5 * (of(values.len() / 2) + of(values.len().saturating_sub(1) / 2))
}
