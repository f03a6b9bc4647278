//! Error(k) of a model beside C0, below, across and above the hydrofoil's change of mode (thesis, section 4.2 and figure 5).
//!
//! ```text
//! cargo run --release --example error_k -- MODEL LOG [FIGURE.svg]
//! ```
//!
//! The model starts from what was measured and is compared with the truth. Beside it stand, from the same origins,
//!
//! - C0, the perfect model of low speed, from the true state with the true force of the propeller;
//! - the true plant from the measured velocities with the true force of the propeller: what noise at the start alone does.
//!
//! `Error(k)` is, for each output, the mean absolute error over 10 windows of 20 steps, the window `m` starting at the
//! sample `k + 20 m`; `k = 3, 203, 403, ..`, so that windows follow each other. A model that needs more samples before its
//! first prediction begins with a later `k`. The log is one that `hydroid simulate hydrofoil` writes, with the true
//! outputs and the column `P_f_true`; the model may be of any kind.

use std::path::Path;
use std::process::ExitCode;

use hydroid::log::{self, Trajectory};
use hydroid::model;
use hydroid::report::figure::{Figure, Key, Line, Mark, Panel, Stroke};
use hydroid::report::style;
use hydroid_core::predict::{Predictor, Workspace};
use hydroid_core::vessel::{Command, Plant, State, VesselParams};

/// Steps of a window, windows of an `Error(k)`, the first `k`.
const STEPS: usize = 20;
const WINDOWS: usize = 10;
const FIRST: usize = 3;
/// Where the hydrofoil changes its mode \[m/s\].
const TRANSITION: f64 = 2.5;
/// Origins of which one is taken for the plants, which are slower than networks.
const STRIDE: usize = 5;
/// What the plant steps by \[s\].
const INTERNAL_S: f64 = 0.01;
/// Errors below it are drawn there.
const LEAST: f64 = 1e-4;

const OUTPUTS: usize = 3;

type Failure = Box<dyn std::error::Error>;

/// Mean absolute errors of a window.
type Errors = [f64; OUTPUTS];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let done = match arguments.as_slice() {
        [model, log] => tell(model, log, None),
        [model, log, figure] => tell(model, log, Some(figure)),
        _ => Err("give MODEL LOG [FIGURE.svg]".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

/// A log, and what only a simulation knows of it.
struct Record {
    run: Trajectory,
    /// True outputs, row by row.
    truth: Vec<f64>,
    force: Vec<f64>,
}

impl Record {
    fn truth(&self, k: usize) -> [f64; OUTPUTS] {
        std::array::from_fn(|c| self.truth[k * OUTPUTS + c])
    }

    fn error(&self, k: usize, y: &[f64]) -> Errors {
        let truth = self.truth(k);
        std::array::from_fn(|c| (y[c] - truth[c]).abs())
    }

    /// Mean absolute error over a window of a plant's.
    fn of_plant(&self, plant: &Plant, from: [f64; OUTPUTS], origin: usize) -> Errors {
        let mut state = State { u: from[0], v: from[1], r: from[2], p_f: self.force[origin], ..State::REST };
        let mut sums = [0.0; OUTPUTS];
        let step = self.run.dt / (self.run.dt / INTERNAL_S).round().max(1.0);
        for k in origin..origin + STEPS {
            let c = self.run.inputs.row(k);
            let mut left = self.run.dt;
            while left > 0.5 * step {
                state = plant.advance(&state, &Command { pp: c[0], rd: c[1] }, step);
                left -= step;
            }
            add(&mut sums, self.error(k + 1, &state.nu()), STEPS);
        }
        sums
    }
}

fn add(sums: &mut Errors, errors: Errors, of: usize) {
    for (sum, error) in sums.iter_mut().zip(errors) {
        *sum += error / of as f64;
    }
}

fn read(path: &str, reading: &model::Reading) -> Result<Record, Failure> {
    let raw = log::read(Path::new(path))?;
    let force = raw
        .position("P_f_true")
        .map(|c| raw.columns[c].values.clone())
        .ok_or_else(|| format!("{path} has no column P_f_true: give a simulated hydrofoil's log"))?;
    let run = log::prepare(&[raw], &reading.selection, &reading.options)?.runs.remove(0);
    let truth =
        run.truth.as_ref().ok_or_else(|| format!("{path} has no true outputs: give a simulated log"))?;
    let names: Vec<&str> = run.outputs.channels().iter().map(|c| c.name.as_str()).collect();
    if names != ["u", "v", "r"] || force.len() != run.len() || run.inputs.width() != 2 {
        return Err(format!("{path}: a model of u, v, r under PP_cmd, RD_ang is needed").into());
    }
    let truth = truth.rows(0, truth.len()).to_vec();
    Ok(Record { run, truth, force })
}

/// Mean errors of the model over the window from each origin; none where there is no window. The means over all windows of
/// the first and of the last step are told as well.
fn walk(record: &Record, session: &mut dyn Predictor) -> (Vec<Option<Errors>>, [Errors; 2]) {
    let run = &record.run;
    let (mut work, mut y) = (Workspace::new(), [0.0; STEPS * OUTPUTS]);
    let first = session.warm_up().max(FIRST + 1) - 1;
    let (mut windows, mut ends) = (Vec::new(), [[0.0; OUTPUTS]; 2]);
    let count = run.len().saturating_sub(STEPS + first);
    session.reset();
    for k in 0..run.len() {
        session.observe(run.outputs.row(k));
        windows.push((k >= first && k + STEPS < run.len()).then(|| {
            session.rollout(run.inputs.rows(k, k + STEPS), &mut work, &mut y);
            let mut sums = [0.0; OUTPUTS];
            for (j, y) in y.chunks_exact(OUTPUTS).enumerate() {
                let error = record.error(k + j + 1, y);
                add(&mut sums, error, STEPS);
                if j == 0 || j + 1 == STEPS {
                    add(&mut ends[usize::from(j > 0)], error, count);
                }
            }
            sums
        }));
        session.advance(run.inputs.row(k));
    }
    (windows, ends)
}

/// One `Error(k)`.
struct Block {
    k: usize,
    mean_u: f64,
    max_u: f64,
    model: Errors,
    c0: Errors,
}

fn tell(model: &str, log: &str, figure: Option<&String>) -> Result<(), Failure> {
    let model = model::read(Path::new(model))?;
    let record = read(log, &model.description.reading)?;
    model.check(std::slice::from_ref(&record.run))?;
    let [c0, truth] =
        [VesselParams::hydrofoil_low_speed(), VesselParams::hydrofoil()].map(|p| Plant::new(&p));
    let (c0, plant) = (c0?, truth?);
    let (windows, [first, last]) = walk(&record, model.session().as_mut());
    let speeds = |k: usize, steps: usize| (k..=k + steps).map(|k| record.truth(k)[0]);

    println!("mean absolute error over {STEPS} steps, u [m/s], v [m/s], r [rad/s]");
    let kind = |k: usize| {
        let above = speeds(k, STEPS).filter(|u| *u > TRANSITION).count();
        if above == 0 {
            0
        } else if above > STEPS {
            1
        } else {
            2
        }
    };
    let origins: Vec<usize> = (0..windows.len()).filter(|&k| windows[k].is_some()).collect();
    for (name, wanted) in
        [("all", None), ("below the transition", Some(0)), ("above", Some(1)), ("across", Some(2))]
    {
        let chosen: Vec<usize> =
            origins.iter().copied().filter(|&k| wanted.is_none_or(|wanted| kind(k) == wanted)).collect();
        let some: Vec<usize> = chosen.iter().copied().step_by(STRIDE).collect();
        let of = |origins: &[usize], error: &dyn Fn(usize) -> Errors| {
            let mut sums = [0.0; OUTPUTS];
            for &k in origins {
                add(&mut sums, error(k), origins.len());
            }
            row(sums)
        };
        let measured = |k: usize| std::array::from_fn(|c| record.run.outputs.row(k)[c]);
        println!(
            "  {name:21} {:6} windows   model {}   C0 {}   plant from the noise {}",
            chosen.len(),
            of(&chosen, &|k| windows[k].unwrap_or_default()),
            of(&some, &|k| record.of_plant(&c0, record.truth(k), k)),
            of(&some, &|k| record.of_plant(&plant, measured(k), k)),
        );
    }
    println!("  first step {}   last step {}", row(first), row(last));

    let mut blocks = Vec::new();
    let span = STEPS * WINDOWS;
    for k in (FIRST..record.run.len().saturating_sub(span)).step_by(span) {
        let starts = || (0..WINDOWS).map(|m| k + STEPS * m);
        let Some(errors) = starts().map(|k| windows[k]).collect::<Option<Vec<Errors>>>() else { continue };
        let (mut model, mut low) = ([0.0; OUTPUTS], [0.0; OUTPUTS]);
        for (k, error) in starts().zip(errors) {
            add(&mut model, error, WINDOWS);
            add(&mut low, record.of_plant(&c0, record.truth(k), k), WINDOWS);
        }
        let mean_u = speeds(k, span).sum::<f64>() / (span + 1) as f64;
        blocks.push(Block { k, mean_u, max_u: speeds(k, span).fold(f64::MIN, f64::max), model, c0: low });
    }
    println!("Error(k), the mean of {WINDOWS} windows of {STEPS} steps");
    for (name, wanted) in [
        ("all", (|_| true) as fn(&Block) -> bool),
        ("below the transition", |b| b.max_u < TRANSITION),
        ("mean u above it", |b| b.mean_u > TRANSITION),
    ] {
        let chosen: Vec<&Block> = blocks.iter().filter(|block| wanted(block)).collect();
        let mean = |of: fn(&Block) -> Errors| {
            let mut sums = [0.0; OUTPUTS];
            for block in &chosen {
                add(&mut sums, of(block), chosen.len());
            }
            row(sums)
        };
        println!(
            "  {name:21} {:6} blocks    model {}   C0 {}",
            chosen.len(),
            mean(|b| b.model),
            mean(|b| b.c0)
        );
    }
    if let Some(path) = figure {
        std::fs::write(path, draw(&blocks, &model.description.name, record.run.dt).svg()?)?;
    }
    Ok(())
}

fn row(errors: Errors) -> String {
    errors.map(|error| format!("{error:.4}")).join(" ")
}

/// The speed, and below it the errors on logarithmic axes.
fn draw(blocks: &[Block], name: &str, dt: f64) -> Figure {
    let time = |block: &Block| block.k as f64 * dt;
    let line = |value: &dyn Fn(&Block) -> f64, stroke: Stroke| {
        Mark::Line(Line::new(blocks.iter().map(|block| (time(block), value(block))).collect(), stroke))
    };
    let logarithm = |error: f64| error.max(LEAST).log10();
    let [low, high] = [style::PERSISTENCE_LINE, style::MODEL_LINE];
    let mut figure =
        Figure::new("Error(k) of the predictor and of C0 over a run in both modes", "time of k [s]")
            .key(Key::Line(high), name)
            .key(Key::Line(low), "C0, the perfect model of low speed")
            .panel(
                Panel::new("u, mean over the 200 samples [m/s] (dotted: change of mode)")
                    .mark(Mark::Level { at: TRANSITION, stroke: style::VALIDATION_LINE })
                    .mark(line(&|block| block.mean_u, style::MEASURED_LINE)),
            );
    for (c, label) in
        ["Error(k) of u [m/s]", "Error(k) of v [m/s]", "Error(k) of r [rad/s]"].iter().enumerate()
    {
        figure = figure.panel(
            Panel::new(*label)
                .decades()
                .range(LEAST.log10(), 0.3)
                .mark(line(&|block| logarithm(block.c0[c]), low))
                .mark(line(&|block| logarithm(block.model[c]), high)),
        );
    }
    figure
}
