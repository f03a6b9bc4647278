//! Networks that learn along logs with truth, beside the same networks frozen.
//!
//! ```text
//! cargo run --release --example adapt_lawns -- MODEL[,MODEL ..] LOG[,LOG ..] [KEY=VALUE ..]
//! ```
//!
//! Models are files of hydroid's recurrent networks that see inputs alone, or PyTorch's tensors with `norm.*` beside them, as
//! the reference has them; errors are medians over all of them. `KEY=VALUE` is the tuning, in scaled units: `p0`, `q`,
//! `gates` (times these, for the weights of gates), `p0_h`, `q_h`, `r` (times the variance of the true noise), `leak`,
//! `forgetting`, `huber`, `noise_rate`, `weights` (`all`, `last`, `read_out`), `memory` (`full`, `blocks:GROUP`, `diagonal`,
//! `low-rank:RANK`). `bands=1` counts how often the 80 and 95 % bands hold what is measured.
//!
//! Windows start at samples 100, 105, ..; from the filtered state the network is run 100 steps on the logged commands with the
//! weights of that moment; errors are means of the absolute difference from the truth. `frozen`: no measurement enters;
//! `filtered`: a filter corrects the state alone (`P0_h` 1, `Q_h` 1e-4, true noise). Beside them, the numbers that are kept
//! of the covariance, and the median time of a sample's measurement and step.

#[path = "shared/hydrofoil.rs"]
mod hydrofoil;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use hydrofoil::read;
use hydroid::log::Trajectory;
use hydroid::model::{self, Body, NamedTensor, weights_from_torch};
use hydroid_core::adapt::Adapter;
use hydroid_core::adapt::kalman::{KalmanNetwork, Memory, Tuning};
use hydroid_core::model::recurrent::{
    BaseModel, Blocks, Cell, Layout, Network, Packed, Recurrent, RecurrentSession, Scaling, StateFilter,
};
use hydroid_core::predict::{Predictor, Workspace};
use safetensors::SafeTensors;

type Failure = Box<dyn std::error::Error>;

const HORIZON: usize = 100;
const SHOWN: [usize; 5] = [1, 5, 20, 50, 100];
/// Of the simulated sensors.
const NOISE: [f64; 3] = [0.01, 0.01, 0.017_453_292_519_943_295];

/// Mean error at each horizon of each output.
type Errors = Vec<[f64; 3]>;

/// What became of a model along a run.
struct Outcome {
    /// Frozen, filtered, adapted.
    errors: [Errors; 3],
    /// Numbers that are kept of the covariance.
    kept: usize,
    /// Of a measurement and a step, median.
    time_us: f64,
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
    let models: Vec<Recurrent> = models.split(',').map(network).collect::<Result<_, _>>()?;
    let runs: Vec<Trajectory> = logs.split(',').map(read).collect::<Result<_, _>>()?;
    let mut score = (0.0, 0.0);
    for run in &runs {
        let all = std::thread::scope(|scope| {
            let workers: Vec<_> = models
                .iter()
                .map(|model| scope.spawn(|| three(model, run, &settings).map_err(|e| e.to_string())))
                .collect();
            workers
                .into_iter()
                .map(|w| w.join().map_err(|_| "a run panicked".to_owned())?)
                .collect::<Result<Vec<_>, _>>()
        })?;
        println!("{} ({} windows)", run.name, (run.len() - HORIZON).saturating_sub(100).div_ceil(5));
        let medians: Vec<Errors> =
            (0..3).map(|part| median(&all.iter().map(|outcome| &outcome.errors[part]))).collect();
        for (name, errors) in ["frozen", "filtered", "adapted"].iter().zip(&medians) {
            let row: Vec<String> = SHOWN.iter().map(|&n| format!("{:.4?}", errors[n - 1])).collect();
            println!("  {name:8} {}", row.join("  "));
        }
        let cost = |outcome: &Outcome| format!("{} kept, {:.1} us a sample", outcome.kept, outcome.time_us);
        println!("  {}", all.iter().map(cost).collect::<Vec<_>>().join("; "));
        let first = |c: usize| {
            let loses = |n: &usize| medians[2][*n][c] >= medians[0][*n][c].min(medians[1][*n][c]);
            (0..HORIZON).find(loses).map_or("-".into(), |n| (n + 1).to_string())
        };
        println!("  first horizon that loses: {} {} {}", first(0), first(1), first(2));
        for n in SHOWN {
            for c in 0..3 {
                score.0 += medians[2][n - 1][c].ln();
                score.1 += 1.0;
            }
        }
    }
    println!("geometric mean of all adapted errors shown: {:.5}", f64::exp(score.0 / score.1));
    Ok(())
}

fn three(
    model: &Recurrent,
    run: &Trajectory,
    settings: &BTreeMap<String, String>,
) -> Result<Outcome, Failure> {
    let noise: Vec<f64> =
        NOISE.iter().zip(&model.scaling.correction_scale).map(|(s, scale)| (s / scale).powi(2)).collect();
    let filter = StateFilter { process: 1e-4, initial: 1.0, noise: noise.clone() };
    let frozen = Arc::new(Recurrent { state_filter: None, ..model.clone() });
    let filtered = Arc::new(Recurrent { state_filter: Some(filter), ..model.clone() });
    let number = |key: &str, default: f64| settings.get(key).map_or(Ok(default), |v| v.parse::<f64>());
    let r = number("r", 3.0)?;
    let noise: Vec<f64> = noise.iter().map(|n| r * n).collect();
    let mut tuning = Tuning {
        leak: number("leak", 3e-6)?,
        forgetting: number("forgetting", 1.0)?,
        huber: number("huber", f64::INFINITY)?,
        noise_rate: number("noise_rate", 0.0)?,
        memory: settings.get("memory").map_or(Ok(Memory::Full), |value| value.parse::<Memory>())?,
        ..Tuning::uniform(
            model.weights.len(),
            number("p0", 0.02)?,
            number("q", 6e-8)?,
            (number("p0_h", 1.0)?, number("q_h", 1e-5)?),
            &noise,
        )
    };
    let gates = number("gates", 5.0)?;
    for place in Layout::new(&model.network).gates(model.network.cell) {
        tuning.initial_weights[place] *= gates;
        tuning.weight_noise[place] *= gates;
    }
    let blocks = Blocks::new(&Packed::new(model.network, &model.weights));
    let from = match settings.get("weights").map_or("all", String::as_str) {
        "read_out" => blocks.transition(),
        "last" => blocks.last_layer(),
        _ => 0,
    };
    for &place in blocks.places()[..from].iter().flatten() {
        (tuning.initial_weights[place], tuning.weight_noise[place]) = (0.0, 0.0);
    }
    if settings.contains_key("bands") {
        bands(KalmanNetwork::<f64>::new(Arc::clone(&frozen), tuning.clone())?, run);
    }
    let learning = KalmanNetwork::<f64>::new(Arc::clone(&frozen), tuning)?;
    let kept = learning.filter().covariance_len();
    let (adapted, time_us) = errors(learning, run);
    let errors = [
        errors(RecurrentSession::new(frozen)?, run).0,
        errors(RecurrentSession::new(filtered)?, run).0,
        adapted,
    ];
    Ok(Outcome { errors, kept, time_us })
}

/// Errors, and the median time of a sample in microseconds.
fn errors(mut session: impl Predictor, run: &Trajectory) -> (Errors, f64) {
    let truth = run.truth.as_ref().unwrap_or(&run.outputs);
    let commands: Vec<f64> = (0..run.len()).flat_map(|k| run.inputs.row(k).to_vec()).collect();
    let (mut sums, mut windows) = (vec![[0.0; 3]; HORIZON], 0.0);
    let (mut work, mut y) = (Workspace::new(), vec![0.0; 3 * HORIZON]);
    let mut times = Vec::with_capacity(run.len());
    for k in 0..run.len() - HORIZON {
        let start = Instant::now();
        session.observe(run.outputs.row(k));
        let observed = start.elapsed();
        if k >= 100 && k % 5 == 0 {
            session.rollout(&commands[2 * k..2 * (k + HORIZON)], &mut work, &mut y);
            for (n, sums) in sums.iter_mut().enumerate() {
                for c in 0..3 {
                    sums[c] += (y[3 * n + c] - truth.row(k + n + 1)[c]).abs();
                }
            }
            windows += 1.0;
        }
        let start = Instant::now();
        session.advance(run.inputs.row(k));
        times.push(observed + start.elapsed());
    }
    times.sort_unstable();
    let time_us = times.get(times.len() / 2).map_or(f64::NAN, |time| 1e6 * time.as_secs_f64());
    sums.iter_mut().flatten().for_each(|sum| *sum /= windows);
    (sums, time_us)
}

/// How often the 80 and 95 % bands hold what is measured, at the horizons shown; windows begin every 25 samples.
fn bands(mut session: KalmanNetwork<f64>, run: &Trajectory) {
    let commands: Vec<f64> = (0..run.len()).flat_map(|k| run.inputs.row(k).to_vec()).collect();
    let (mut work, mut y) = (Workspace::new(), vec![0.0; 3 * HORIZON]);
    let mut deviations = vec![0.0; 3 * SHOWN.len()];
    let (mut inside, mut windows) = ([[[0.0; 2]; 3]; SHOWN.len()], 0.0);
    for k in 0..run.len() - HORIZON {
        session.observe(run.outputs.row(k));
        if k >= 100 && k % 25 == 0 {
            let commands = &commands[2 * k..2 * (k + HORIZON)];
            session.rollout(commands, &mut work, &mut y);
            session.deviations(commands, &SHOWN, &mut work, &mut deviations);
            for (h, n) in SHOWN.iter().enumerate() {
                for c in 0..3 {
                    let off = (run.outputs.row(k + n)[c] - y[3 * (n - 1) + c]).abs() / deviations[3 * h + c];
                    inside[h][c][0] += f64::from(u8::from(off < 1.281_55));
                    inside[h][c][1] += f64::from(u8::from(off < 1.959_96));
                }
            }
            windows += 1.0;
        }
        session.advance(run.inputs.row(k));
    }
    for (n, inside) in SHOWN.iter().zip(&inside) {
        let share = inside.map(|[a, b]| format!("{:.0}/{:.0}", 100.0 * a / windows, 100.0 * b / windows));
        println!("  bands of {}, {n} steps: {} %", run.name, share.join("  "));
    }
}

fn median<'a>(all: &(impl Iterator<Item = &'a Errors> + Clone)) -> Errors {
    let middle = |n: usize, c: usize| {
        let mut values: Vec<f64> = all.clone().map(|errors| errors[n][c]).collect();
        values.sort_unstable_by(f64::total_cmp);
        0.5 * (values[values.len() / 2] + values[(values.len() - 1) / 2])
    };
    (0..HORIZON).map(|n| std::array::from_fn(|c| middle(n, c))).collect()
}

fn network(path: impl AsRef<str>) -> Result<Recurrent, Failure> {
    let path = path.as_ref();
    let bytes = std::fs::read(path)?;
    let file = SafeTensors::deserialize(&bytes)?;
    if file.tensor("norm.output_mean").is_err() {
        let Body::Recurrent(model) = model::read(Path::new(path))?.body else {
            return Err(format!("{path} is no recurrent network").into());
        };
        return Ok((*model).clone());
    }
    let tensors: Vec<(String, Vec<usize>, Vec<f64>)> = file
        .iter()
        .map(|(name, view)| {
            let values =
                view.data().chunks_exact(8).filter_map(|b| b.try_into().ok()).map(f64::from_le_bytes);
            (name.to_owned(), view.shape().to_vec(), values.collect())
        })
        .collect();
    let named: Vec<NamedTensor<'_>> =
        tensors.iter().map(|(name, shape, values)| NamedTensor { name, shape, values }).collect();
    let of = |name: &str| -> Result<Vec<f64>, Failure> {
        let found =
            tensors.iter().find(|(own, ..)| own == name).ok_or(format!("{path}: no tensor {name}"))?;
        Ok(found.2.clone())
    };
    let cells = [
        (Cell::Lstm { hidden: 18, projection: Some(3) }, false),
        (Cell::Gru { hidden: 18 }, true),
        (Cell::Vanilla { hidden: 18, layers: 2 }, true),
    ];
    let (network, weights) = cells
        .into_iter()
        .map(|(cell, read_out)| Network { cell, inputs: 2, outputs: 3, read_out })
        .find_map(|network| Some((network, weights_from_torch(&network, &named).ok()?)))
        .ok_or(format!("{path} is none of the thesis's networks"))?;
    let scaling = Scaling {
        output_mean: of("norm.output_mean")?,
        output_scale: of("norm.output_std")?,
        input_mean: of("norm.input_mean")?,
        input_scale: of("norm.input_std")?,
        correction_scale: of("norm.output_std")?,
    };
    let (base, feedback, wash_out) = (BaseModel::Nothing, false, 100);
    Ok(Recurrent { network, weights, scaling, base, feedback, wash_out, state_filter: None })
}
