//! Adaptation in a current that sets in under way: frozen and adapted models, without and with an estimate of the current.
//!
//! ```text
//! cargo run --release -p hydroid-research --bin current_campaign -- [vessel|sindy|committee] [runs=20] [hydrofoil|simple]
//! ```
//!
//! Two vessels sail a lawn-mower, steered by feedback linearization with their true parameters. Half-way a current of
//! 0.4 m/s sets in, from another direction in each run; in the second part of the table, mass and yaw inertia grow by
//! 20 % at the same time. The models are the true vessel (`vessel`), or models identified from three runs of 600 s in
//! still water.
//!
//! An error is the RMSE of the predicted `u`, `v` and `r` over ground, divided by the standard deviation of the true
//! ones, mean over the three. Origins are those within ten seconds after each turn that ends after the onset; in the
//! columns *end*, those of the last quarter of the run. The distance of the weights is the RMS of their relative change,
//! mean over the time after the onset; the last column is the mass at the end, relative to that of the model. All figures
//! are medians over the runs.

use std::sync::Arc;

use anyhow::{Context as _, bail};
use hydroid::adapt;
use hydroid::closed_loop::{
    self, Conditions, ControlMethod, ControllerOptions, Run, Scenario, SpeedOptions, Task, Track,
};
use hydroid::excitation::Excitation;
use hydroid::identify::{
    Job, Method, MotionOption, NetworkTrainingOptions, RateLimitOption, SindyOptions, identify,
};
use hydroid::log::{Split, Table, Trajectory};
use hydroid::model::{Model, Reading};
use hydroid::progress::silent;
use hydroid::simulate::{self, simulate};
use hydroid_core::adapt::Adapter;
use hydroid_core::craft::Craft;
use hydroid_core::predict::Workspace;
use rayon::prelude::*;

/// Sample time \[s\].
const DT: f64 = 0.1;

/// Standard deviation of the components of the current that the sessions assume \[m/s\].
const ASSUMED: f64 = 0.3;

/// Speed of the current \[m/s\].
const SPEED_OF_CURRENT: f64 = 0.4;

/// Origins after the end of a turn \[s\].
const AFTER_S: f64 = 10.0;

const HORIZONS_S: [f64; 2] = [2.0, 20.0];

struct Boat {
    vessel: Craft,
    speed: SpeedOptions,
    radius: f64,
}

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let kind = arguments.next().unwrap_or_else(|| "vessel".to_owned());
    let runs = match arguments.next() {
        Some(text) => text.strip_prefix("runs=").context("give runs=N")?.parse()?,
        None => 20_u64,
    };
    let speed = |cruise, turn| SpeedOptions { turn: Some(turn), ..SpeedOptions::cruise(cruise) };
    let boats = [
        Boat { vessel: Craft::hydrofoil(), speed: speed(4.0, 1.8), radius: 15.0 },
        Boat { vessel: Craft::simple(), speed: speed(1.5, 1.0), radius: 10.0 },
    ];
    println!("| vessel, change | model | 2 s | 20 s | 2 s, end | 20 s, end | weights | mass |");
    println!("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    let only = arguments.next();
    for boat in boats.iter().filter(|boat| only.as_ref().is_none_or(|name| *name == boat.vessel.name)) {
        let model = model(&kind, &boat.vessel)?;
        for (change, mass) in [("current", 1.0), ("current, mass", 1.2)] {
            let each: Vec<[Figures; 4]> = (1..=runs)
                .into_par_iter()
                .map(|seed| figures(boat, &model, mass, seed))
                .collect::<anyhow::Result<_>>()?;
            for (i, name) in ["frozen", "adapted", "frozen, with the current", "adapted, with the current"]
                .iter()
                .enumerate()
            {
                let median = |of: &dyn Fn(&Figures) -> f64| {
                    let mut all: Vec<f64> = each.iter().map(|run| of(&run[i])).collect();
                    all.sort_by(f64::total_cmp);
                    all[all.len() / 2]
                };
                let mass = median(&|f| f.mass);
                let mass = if model.is_vessel() { format!("{mass:.2}") } else { String::new() };
                println!(
                    "| {}, {change} | {name} | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} | {mass} |",
                    boat.vessel.name,
                    median(&|f| f.after_turns[0]),
                    median(&|f| f.after_turns[1]),
                    median(&|f| f.end[0]),
                    median(&|f| f.end[1]),
                    median(&|f| f.distance),
                );
            }
        }
    }
    Ok(())
}

fn model(kind: &str, vessel: &Craft) -> anyhow::Result<Model> {
    let method = match kind {
        "vessel" => return Ok(Model::of_vessel(vessel, DT)?),
        "sindy" => Method::Sindy,
        "committee" => Method::Committee,
        other => bail!("'{other}': give vessel, sindy or committee"),
    };
    let log = |seed| -> anyhow::Result<Trajectory> {
        let options = simulate::Options {
            duration_s: 600.0,
            seed,
            ..simulate::Options::new(vessel.clone(), Excitation::Mixed)
        };
        Ok(simulate(&options, &mut silent())?.to_trajectory(&["u", "v", "r"])?)
    };
    let train = vec![log(101)?, log(102)?, log(103)?];
    let job = Job {
        methods: vec![method],
        split: Split { train, validation: Vec::new(), test: Vec::new(), notes: Vec::new() },
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon: 100,
        origin_stride: 10,
        seed: 0,
        ranges: std::collections::BTreeMap::default(),
        motion: MotionOption::OverGround,
        rate_limits: RateLimitOption::default(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions::default(),
        networks: NetworkTrainingOptions::default(),
        vessel: None,
    };
    let found = identify(&job, &mut silent())?;
    let model = found.candidates.into_iter().next().context("no model was found")?.model;
    Ok(model)
}

/// Figures of a model along a run.
#[derive(Clone, Copy, Debug, Default)]
struct Figures {
    after_turns: [f64; 2],
    end: [f64; 2],
    distance: f64,
    /// First weight at the end, relative to that of the model: the mass of a vessel.
    mass: f64,
}

fn figures(boat: &Boat, model: &Model, mass: f64, seed: u64) -> anyhow::Result<[Figures; 4]> {
    let task = Task::LawnMower { leg: 60.0, spacing: 2.0 * boat.radius, legs: 8, radius: boat.radius };
    let track = Track::new(&task, &boat.speed)?;
    let onset_s = 0.5 * track.duration_s().unwrap_or(0.0);
    // Another direction in each run.
    let direction = 2.4 * seed as f64;
    let current = [SPEED_OF_CURRENT * direction.cos(), SPEED_OF_CURRENT * direction.sin()];
    let conditions = Conditions { current, mass, onset_s, ..Conditions::calm(seed) };
    let scenario = Scenario::new(boat.vessel.clone(), track);
    let steering = ControllerOptions {
        model: Some(Arc::new(Model::of_vessel(&boat.vessel, DT)?.with_current(ASSUMED)?)),
        ..ControllerOptions::new(ControlMethod::FeedbackLinearization, &scenario.plant, DT)
    };
    let mut controller = steering.controller(seed)?;
    let sailed = closed_loop::run(&scenario, &conditions, controller.as_mut(), &mut silent())?;
    anyhow::ensure!(sailed.arrived == Some(true), "seed {seed}: the end of the path was not reached");
    let run = motion_of(&sailed);
    let session = |current_m_s, frozen| -> anyhow::Result<Box<dyn Adapter>> {
        let options = adapt::Options { current_m_s, ..adapt::Options::of(model) };
        let (mut adapter, _) = adapt::adapter(model, &options, &[])?;
        adapter.freeze(frozen);
        Ok(adapter)
    };
    let mut all = [Figures::default(); 4];
    for (into, (current, frozen)) in
        all.iter_mut().zip([(None, true), (None, false), (Some(ASSUMED), true), (Some(ASSUMED), false)])
    {
        *into = course(session(current, frozen)?.as_mut(), &sailed, &run, onset_s);
    }
    Ok(all)
}

/// The run as a log of the motion.
fn motion_of(run: &Run) -> Trajectory {
    let mut log = run.trajectory();
    for table in [Some(&mut log.outputs), log.truth.as_mut()].into_iter().flatten() {
        let rows = (0..table.len()).flat_map(|k| table.row(k)[..3].to_vec()).collect();
        *table = Table::new(table.channels()[..3].to_vec(), rows);
    }
    log
}

/// Sums of squared errors.
#[derive(Clone, Copy, Default)]
struct Errors {
    squares: [f64; 3],
    count: usize,
}

impl Errors {
    fn mean(&self, deviations: [f64; 3]) -> f64 {
        let each = self.squares.iter().zip(deviations);
        each.map(|(square, deviation)| (square / self.count as f64).sqrt() / deviation).sum::<f64>() / 3.0
    }
}

fn course(session: &mut dyn Adapter, sailed: &Run, run: &Trajectory, onset_s: f64) -> Figures {
    let truth = run.truth.as_ref().unwrap_or(&run.outputs);
    let deviations = [0, 1, 2].map(|c| {
        let mean = truth.column(c).sum::<f64>() / truth.len() as f64;
        (truth.column(c).map(|x| (x - mean) * (x - mean)).sum::<f64>() / truth.len() as f64).sqrt()
    });
    let steps = HORIZONS_S.map(samples);
    let longest = steps[1];
    let curved = |k: usize| sailed.samples[k].reference.curvature != 0.0;
    let end = 3 * run.len() / 4;
    let first = session.weights().to_vec();
    let (mut work, mut y) = (Workspace::new(), vec![0.0; 3 * longest]);
    let (mut after_turns, mut at_end) = ([Errors::default(); 2], [Errors::default(); 2]);
    let (mut distances, mut count) = (0.0, 0_u32);
    let mut since_turn = usize::MAX;
    session.reset();
    for k in 0..run.len() {
        session.observe_heading(run.heading_at(k));
        session.observe(run.outputs.row(k));
        let changed = sailed.samples[k].t >= onset_s;
        since_turn = match (curved(k), k > 0 && curved(k - 1)) {
            (true, _) => usize::MAX,
            (false, true) => 0,
            (false, false) => since_turn.saturating_add(1),
        };
        let after_turn = changed && since_turn < samples(AFTER_S);
        if (after_turn || k > end) && k + longest < run.len() {
            session.rollout(run.inputs.rows(k, k + longest), &mut work, &mut y);
            for (i, &step) in steps.iter().enumerate() {
                for (used, errors) in [(after_turn, &mut after_turns[i]), (k > end, &mut at_end[i])] {
                    if used {
                        let row = truth.row(k + step).iter().zip(&y[3 * (step - 1)..3 * step]);
                        for (square, (measured, predicted)) in errors.squares.iter_mut().zip(row) {
                            *square += (measured - predicted).powi(2);
                        }
                        errors.count += 1;
                    }
                }
            }
        }
        if changed {
            distances += distance(&first, session.weights());
            count += 1;
        }
        session.advance(run.inputs.row(k));
    }
    Figures {
        after_turns: after_turns.map(|errors| errors.mean(deviations)),
        end: at_end.map(|errors| errors.mean(deviations)),
        distance: distances / f64::from(count),
        mass: session.weights().first().zip(first.first()).map_or(f64::NAN, |(now, then)| now / then),
    }
}

/// RMS of the relative changes.
fn distance(first: &[f64], now: &[f64]) -> f64 {
    let squares = first.iter().zip(now).filter(|(a, _)| **a != 0.0).map(|(a, b)| (b / a - 1.0).powi(2));
    let (sum, count) = squares.fold((0.0, 0_u32), |(sum, count), x| (sum + x, count + 1));
    (sum / f64::from(count.max(1))).sqrt()
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a short time")]
fn samples(seconds: f64) -> usize {
    (seconds / DT).round() as usize
}
