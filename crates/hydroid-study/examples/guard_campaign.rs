//! Monte Carlo trials of the guard: adaptation with and without it under faults, and how far its guarantee holds.
//!
//! ```text
//! cargo run --release --example guard_campaign -- MODEL[,MODEL ..] LOG[,LOG ..] TRAIN [runs=200] [seed=1] [only=INDEX]
//! ```
//!
//! Models are recurrent networks without output feedback; the logs have truth (or are used as truth); `TRAIN` is a
//! training log. Each trial draws a model, a log, filter options (each variance and the leak within a factor of 30 of
//! its default) and a fault (offsets of 5 to 125 standard deviations of the noise), and sometimes disturbs the initial
//! weights. The unguarded adapter, the guarded adapter and the reference model with a state filter run along the same
//! faulty log. `clean=1` runs each model along each unmodified log with the defaults.
//!
//! From every sample each predicts 2 s with the recorded commands. An error is the mean over the outputs of the
//! absolute difference from the truth, in half design ranges. For windows of 30 s, `exceeds` is the largest `guarded -
//! 1.2 frozen - floor`, in multiples of the floor, which is the sensor noise.

#[path = "shared/hydrofoil.rs"]
mod hydrofoil;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use hydrofoil::read;
use hydroid::adapt::{self, KalmanOptions, Options};
use hydroid::faults::Faults;
use hydroid::log::Trajectory;
use hydroid::model::{self, Body, Model};
use hydroid_core::adapt::Adapter;
use hydroid_core::adapt::guard::GuardOptions;
use hydroid_core::predict::Workspace;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Standard deviations of the simulated sensors.
const NOISE: [f64; 3] = [0.01, 0.01, 0.017_453_292_519_943_295];

/// Filter options are drawn within this factor of the default.
const FACTOR: f64 = 30.0;

struct Case {
    model: Model,
    run: Trajectory,
    options: Options,
    name: String,
}

struct Course {
    /// Error of the prediction from each sample, and of each output.
    errors: Vec<f64>,
    by_output: Vec<[f64; 3]>,
    touched: usize,
    events: BTreeMap<&'static str, usize>,
    median_us: f64,
    p99_us: f64,
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [models, logs, train, keys @ ..] = arguments.as_slice() else {
        return Err("give MODEL[,MODEL ..] LOG[,LOG ..] TRAIN [KEY=VALUE ..]".into());
    };
    let mut settings = BTreeMap::new();
    for key in keys {
        let (name, value) = key.split_once('=').ok_or("settings are KEY=VALUE")?;
        settings.insert(name, value.parse::<u64>()?);
    }
    let setting = |name: &str, default: u64| settings.get(name).copied().unwrap_or(default);
    let models: Vec<Model> =
        models.split(',').map(|path| model::read(Path::new(path))).collect::<Result<_, _>>()?;
    let runs: Vec<Trajectory> = logs.split(',').map(read).collect::<Result<_, _>>()?;
    let shore = read(train)?.slice(0, usize::try_from(setting("shore", 2000))?);
    let cases: Vec<Case> = if setting("clean", 0) > 0 {
        let each = |model: &Model| runs.iter().map(|run| clean(model, run)).collect::<Vec<_>>();
        models.iter().flat_map(each).collect()
    } else {
        (0..setting("runs", 200))
            .filter(|&index| settings.get("only").is_none_or(|&only| only == index))
            .map(|index| drawn(&models, &runs, setting("seed", 1), index))
            .collect::<Result<_, _>>()?
    };
    let next = AtomicUsize::new(0);
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let mut rows: Vec<(usize, Row)> = std::thread::scope(|scope| {
        let work = || -> Result<Vec<(usize, Row)>, Failure> {
            let mut rows = Vec::new();
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(case) = cases.get(index) else { return Ok(rows) };
                let row = row(case, &shore)?;
                println!("{}", row.text);
                rows.push((index, row));
            }
        };
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let joined = workers.into_iter().map(|w| w.join().map_err(|_| Failure::from("a run panicked"))?);
        Ok::<_, Failure>(joined.collect::<Result<Vec<_>, _>>()?.concat())
    })?;
    rows.sort_by_key(|(index, _)| *index);
    let count = |with: &dyn Fn(&Row) -> bool| rows.iter().filter(|(_, row)| with(row)).count();
    println!(
        "{} runs: {} unguarded runs exceed twice the frozen error over 30 s, or fail; {} guarded runs exceed the guarantee",
        rows.len(),
        count(&|row| row.alone > 2.0),
        count(&|row| row.exceeds > 0.0),
    );
    let geometric = |of: &dyn Fn(&Row) -> f64| {
        (rows.iter().map(|(_, row)| of(row).ln()).sum::<f64>() / rows.len() as f64).exp()
    };
    println!(
        "error, guarded / unguarded: {:.3} (geometric mean); largest share of modified samples: {:.2} %",
        geometric(&|row| row.ratio),
        100.0 * rows.iter().map(|(_, row)| row.touched).fold(0.0, f64::max)
    );
    let middle = |of: &dyn Fn(&Row) -> f64| {
        let mut all: Vec<f64> = rows.iter().map(|(_, row)| of(row)).collect();
        all.sort_unstable_by(f64::total_cmp);
        all[all.len() / 2]
    };
    println!(
        "time per sample, guarded / unguarded: median {:.3}, 99th percentile {:.3} (medians of the runs)",
        middle(&|row| row.slower[0]),
        middle(&|row| row.slower[1])
    );
    Ok(())
}

fn clean(model: &Model, run: &Trajectory) -> Case {
    let name = format!("{} {}", model.description.name, run.name);
    let kalman = KalmanOptions { noise: Some(NOISE.to_vec()), ..KalmanOptions::default() };
    Case { model: model.clone(), run: run.clone(), options: Options { kalman, ..Options::default() }, name }
}

fn drawn(models: &[Model], runs: &[Trajectory], seed: u64, index: u64) -> Result<Case, Failure> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index);
    let mut pick = |count: usize| rng.random_range(0..count);
    let (mut model, mut run) = (models[pick(models.len())].clone(), runs[pick(runs.len())].clone());
    let kind = pick(8);
    let output = ["u", "v", "r"][pick(3)];
    // Offsets of 10 to 50 standard deviations of the noise; for faults on a single output, 0.5 to 2.5 times that.
    let noise = NOISE[["u", "v", "r"].iter().position(|o| *o == output).unwrap_or(0)];
    let sign = if rng.random() { 1.0 } else { -1.0 };
    let size = sign * noise * (10.0 + 40.0 * rng.random::<f64>());
    let fault = match kind {
        0 => "none".to_owned(),
        1 => "spikes=0.003".to_owned(),
        2 => "spikes=0.02".to_owned(),
        3 => format!("dropout={output}:20s"),
        4 => format!("stuck={output}:20s"),
        5 => format!(
            "bias={output}:{}",
            size * (0.5 + 2.0 * rng.random::<f64>()) * if rng.random() { 1.0 } else { -1.0 }
        ),
        6 => format!("spikes=0.005,dropout={output}:10s,stuck={output}:10s"),
        _ => format!("stuck={output}:5s,bias={output}:{size:.3}"),
    };
    if fault != "none" {
        let faults = Faults { seed: rng.random(), ..fault.parse::<Faults>()? };
        faults.inject(std::slice::from_mut(&mut run))?;
    }
    let spoiled = rng.random::<f64>() < 0.15;
    if spoiled && let Body::Recurrent(network) = &mut model.body {
        let network = std::sync::Arc::make_mut(network);
        network.weights.iter_mut().for_each(|w| *w *= 1.0 + 0.6 * (2.0 * rng.random::<f64>() - 1.0));
    }
    let mut factor = || FACTOR.powf(2.0 * rng.random::<f64>() - 1.0);
    let default = KalmanOptions::default();
    let kalman = KalmanOptions {
        weight_variance: default.weight_variance * factor(),
        weight_noise_per_s: default.weight_noise_per_s * factor(),
        state_noise_per_s: default.state_noise_per_s * factor(),
        noise_factor: default.noise_factor * factor(),
        leak_s: default.leak_s * factor(),
        noise: Some(NOISE.to_vec()),
        ..default
    };
    let name = format!(
        "{index:3} {:5} {:7} {fault:52} P0 {:.0e} Q {:.0e} Qh {:.0e} R {:.0e}{}",
        model.description.name,
        run.name,
        kalman.weight_variance,
        kalman.weight_noise_per_s,
        kalman.state_noise_per_s,
        kalman.noise_factor,
        if spoiled { " spoiled" } else { "" }
    );
    Ok(Case { model, run, options: Options { kalman, ..Options::default() }, name })
}

#[derive(Clone)]
struct Row {
    text: String,
    /// Largest ratio of unguarded to frozen error over a window; infinite after a failure.
    alone: f64,
    /// Largest excess over the guarantee, in multiples of the floor.
    exceeds: f64,
    /// Ratio of the mean errors, guarded / unguarded.
    ratio: f64,
    touched: f64,
    slower: [f64; 2],
}

fn row(case: &Case, shore: &Trajectory) -> Result<Row, Failure> {
    let Case { model, run, options, name } = case;
    let scale: Vec<f64> =
        model.description.outputs.iter().map(|port| 0.5 * (port.range.high - port.range.low)).collect();
    let floor = NOISE.iter().zip(&scale).map(|(noise, scale)| noise / scale).sum::<f64>() / 3.0;
    let settings = GuardOptions::new(model.description.dt);
    let window = settings.window;
    let with = |options: &Options| -> Result<Box<dyn Adapter>, Failure> {
        Ok(adapt::adapter(model, options, &[run])?.0)
    };
    let sail = |options: &Options| -> Result<Course, Failure> {
        let mut session = with(options)?;
        walk(session.as_mut(), shore);
        Ok(course(session.as_mut(), run, &scale, settings.horizon))
    };
    let alone = sail(options)?;
    let guarded = sail(&Options { guard: Some(settings.clone()), ..options.clone() })?;
    let sure = KalmanOptions {
        weight_variance: 0.0,
        weight_noise_per_s: 0.0,
        state_noise_per_s: 1e-3,
        noise_factor: 1.0,
        leak_s: f64::INFINITY,
        noise: Some(NOISE.to_vec()),
        ..KalmanOptions::default()
    };
    let mut frozen = with(&Options { kalman: sure, ..Options::default() })?;
    frozen.freeze(true);
    let frozen = course(frozen.as_mut(), run, &scale, settings.horizon);
    let windows = |of: &dyn Fn(f64, f64) -> f64, course: &Course| {
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        let each = course.errors.windows(window).zip(frozen.errors.windows(window));
        each.map(|(own, frozen)| of(mean(own), mean(frozen)))
            .fold(f64::NEG_INFINITY, |most, x| if x.is_nan() { f64::INFINITY } else { most.max(x) })
    };
    let ratio_alone = windows(&|own, frozen| own / frozen, &alone);
    let ratio = windows(&|own, frozen| own / frozen, &guarded);
    let exceeds = windows(&|own, frozen| (own - settings.factor * frozen) / floor - 1.0, &guarded);
    let worst = {
        let over = |k: usize, course: &Course| course.errors[k..k + window].iter().sum::<f64>();
        let excess = |k: &usize| over(*k, &guarded) - settings.factor * over(*k, &frozen);
        let last = guarded.errors.len().saturating_sub(window);
        (0..last).max_by(|a, b| excess(a).total_cmp(&excess(b))).unwrap_or(0) as f64 * run.dt + 100.0 * run.dt
    };
    let mean = |course: &Course| course.errors.iter().sum::<f64>() / course.errors.len() as f64;
    let means = |course: &Course| {
        let mean =
            |c: usize| course.by_output.iter().map(|e| e[c]).sum::<f64>() / course.by_output.len() as f64;
        format!("{:.4} {:.4} {:.4}", mean(0), mean(1), mean(2))
    };
    let touched = guarded.touched as f64 / run.len() as f64;
    let text = format!(
        "{name}\n      frozen {}  alone {} ({ratio_alone:.2})  guarded {} ({ratio:.2})  exceeds {exceeds:.2} from {worst:.1} s  touched {:.2} %  {:?}",
        means(&frozen),
        means(&alone),
        means(&guarded),
        100.0 * touched,
        guarded.events
    );
    Ok(Row {
        text,
        alone: ratio_alone,
        exceeds,
        ratio: mean(&guarded) / mean(&alone),
        touched,
        slower: [guarded.median_us / alone.median_us, guarded.p99_us / alone.p99_us],
    })
}

fn walk(session: &mut dyn Adapter, run: &Trajectory) {
    session.reset();
    for k in 0..run.len() {
        session.observe(run.outputs.row(k));
        session.advance(run.inputs.row(k));
    }
}

fn course(session: &mut dyn Adapter, run: &Trajectory, scale: &[f64], horizon: usize) -> Course {
    let truth = run.truth.as_ref().unwrap_or(&run.outputs);
    let m = run.inputs.width();
    let commands = run.inputs.rows(0, run.len());
    let (mut work, mut y) = (Workspace::new(), vec![0.0; 3 * horizon]);
    let (mut errors, mut by_output, mut times) = (Vec::new(), Vec::new(), Vec::new());
    let (mut touched, mut events) = (0, BTreeMap::new());
    session.reset();
    for k in 0..run.len() - horizon {
        let start = std::time::Instant::now();
        session.observe(run.outputs.row(k));
        let mut time = start.elapsed();
        if let Some(guard) = session.guard() {
            for event in guard.events() {
                *events.entry(event.action.name()).or_default() += 1;
                if std::env::var_os("GUARD_EVENTS").is_some() {
                    println!("{:.1} {:?}", k as f64 * run.dt, event.action);
                }
            }
            let names = guard.events().iter().map(|event| event.action.name());
            touched += usize::from(
                names.into_iter().any(|n| ["spike", "inflated", "stuck", "believed"].contains(&n)),
            );
        }
        // After the hidden state has converged.
        if k >= 100 {
            session.rollout(&commands[m * k..m * (k + horizon)], &mut work, &mut y);
            let last = &y[3 * (horizon - 1)..];
            let off: [f64; 3] = std::array::from_fn(|c| (last[c] - truth.row(k + horizon)[c]).abs());
            errors.push(off.iter().zip(scale).map(|(off, scale)| off / scale).sum::<f64>() / 3.0);
            by_output.push(off);
        }
        let start = std::time::Instant::now();
        session.advance(run.inputs.row(k));
        time += start.elapsed();
        times.push(1e6 * time.as_secs_f64());
    }
    times.sort_unstable_by(f64::total_cmp);
    let at = |share: usize| times[times.len() * share / 100];
    Course { errors, by_output, touched, events, median_us: at(50), p99_us: at(99) }
}
