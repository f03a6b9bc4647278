//! Trials in logs: recognised by commands and heading, and compared with the model's prediction from their first sample.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::io::{self, BufWriter, Write};

use rayon::prelude::*;
use serde::Serialize;

use super::error::ManoeuvreError;
use super::figure::{Figure, Figures, set_intervals};
use super::track::Track;
use super::turning_circle::TurningCircle;
use super::zigzag::Zigzag;
use crate::log::{Shortest, Trajectory};
use crate::model::{MOTION, Model};
use crate::plant::{PlantError, Simulation, current_before};
use crate::progress::{Progress, report};

/// A trial in a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Recognised {
    /// Kind of the trial.
    pub kind: RecognisedKind,
    /// Samples at which the commands change, the first of which begins the trial.
    pub executes: Vec<usize>,
    /// Last sample.
    pub end: usize,
    /// Change of the heading in a turn, or at which a zigzag is reversed (the mean) \[deg\]; positive if the vessel turns to
    /// starboard first.
    pub heading_deg: f64,
}

/// Kind of a recognised trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RecognisedKind {
    /// A turn by at least 90 degrees under constant commands.
    TurningCircle,
    /// Commands that alternate between two values, and are reversed at about the same change of heading to either side.
    Zigzag,
}

/// A trial in a log beside its prediction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Name of the run.
    pub run: String,
    /// Time of its first sample in the run \[s\].
    pub at_s: f64,
    /// The trial.
    #[serde(flatten)]
    pub trial: Recognised,
    /// Figures of the measured motion.
    pub measured: Vec<Figure>,
    /// Figures predicted from the first sample, under the measured commands. A zigzag is reversed at the measured headings.
    pub predicted: Vec<Figure>,
    /// Current that the prediction assumes, north and east \[m/s\]: the estimate from the samples before the trial.
    pub current: [f64; 2],
    /// Whether the model was fitted to this run.
    pub in_training: bool,
    /// Number of members of the ensemble or committee whose predictions give the intervals.
    pub members: usize,
    /// Measured and predicted track.
    #[serde(skip)]
    pub tracks: [Track; 2],
    /// Tracks of the members.
    #[serde(skip)]
    pub member_tracks: Vec<Track>,
}

impl Recognised {
    /// Kind and size of the trial in words: `zigzag of 20 deg, first to port`.
    pub fn title(&self) -> String {
        let side = if self.heading_deg > 0.0 { "starboard" } else { "port" };
        let size = self.heading_deg.abs();
        match self.kind {
            RecognisedKind::TurningCircle => format!("turn by {size:.0} deg to {side}"),
            RecognisedKind::Zigzag => format!("zigzag of {size:.0} deg, first to {side}"),
        }
    }
}

/// Change of a command, relative to its range, that is a new command.
const SAME: f64 = 0.01;

/// Least number of commands of a zigzag.
const LEAST_COMMANDS: usize = 3;

/// Least change of heading at which a zigzag is reversed \[rad\].
const LEAST_HEADING: f64 = 0.03;

/// Longest past that a prediction takes into account \[samples\].
const PAST: usize = 2_000;

/// Duration of a prediction relative to that of the measured trial.
const LONGER: f64 = 1.5;

/// A part of a run with constant commands: first and last sample.
#[derive(Clone, Copy, Debug)]
struct Held {
    from: usize,
    to: usize,
}

/// Turning circles and zigzags in a run. A run without the yaw rate `r` has none.
pub fn recognise(run: &Trajectory) -> Vec<Recognised> {
    let Some(heading) = heading(run) else { return Vec::new() };
    let held = held(run);
    let ranges = ranges(run);
    let same = |a: &Held, b: &Held| {
        let (a, b) = (run.inputs.row(a.from), run.inputs.row(b.from));
        a.iter().zip(b).zip(&ranges).all(|((a, b), range)| (a - b).abs() <= SAME * range)
    };
    let mut found = Vec::new();
    let mut i = 0;
    while i < held.len() {
        let zigzag = zigzag_length(&held[i..], &heading, same);
        if zigzag >= LEAST_COMMANDS {
            let part = &held[i..i + zigzag];
            let start = heading[part[0].from];
            let at = |held: &Held| heading[held.from] - start;
            let first = at(&part[1]);
            let mean = part[1..].iter().map(|held| at(held).abs()).sum::<f64>() / (zigzag - 1) as f64;
            found.push(Recognised {
                kind: RecognisedKind::Zigzag,
                executes: part.iter().map(|held| held.from).collect(),
                end: part[zigzag - 1].to,
                heading_deg: (mean * first.signum()).to_degrees(),
            });
            i += zigzag;
            continue;
        }
        let change = heading[held[i].to] - heading[held[i].from];
        if change.abs() >= FRAC_PI_2 {
            found.push(Recognised {
                kind: RecognisedKind::TurningCircle,
                executes: vec![held[i].from],
                end: held[i].to,
                heading_deg: change.to_degrees(),
            });
        }
        i += 1;
    }
    found
}

/// Number of parts at the beginning that are a zigzag.
fn zigzag_length(held: &[Held], heading: &[f64], same: impl Fn(&Held, &Held) -> bool) -> usize {
    let Some(first) = held.first() else { return 0 };
    let turned = |k: usize| heading[held[k].from] - heading[first.from];
    let mut length = 1;
    while length < held.len() {
        let reversed = !same(&held[length], &held[length - 1]);
        let alternates = length < 2 || same(&held[length], &held[length - 2]);
        let (now, first) = (turned(length), turned(1));
        let alike = (0.5 * first.abs()..=2.0 * first.abs()).contains(&now.abs());
        let sides = now.abs() >= LEAST_HEADING
            && alike
            && (length < 2 || now.signum() != turned(length - 1).signum());
        if !(reversed && alternates && sides) {
            break;
        }
        length += 1;
    }
    length
}

/// Parts with constant commands.
fn held(run: &Trajectory) -> Vec<Held> {
    let ranges = ranges(run);
    let mut all: Vec<Held> = Vec::new();
    for k in 0..run.len() {
        let same = all.last().is_some_and(|held| {
            let (first, now) = (run.inputs.row(held.from), run.inputs.row(k));
            first.iter().zip(now).zip(&ranges).all(|((a, b), range)| (a - b).abs() <= SAME * range)
        });
        match all.last_mut() {
            Some(held) if same => held.to = k,
            _ => {
                // The command of the last sample of a part acts up to the first one of the next.
                if let Some(before) = all.last_mut() {
                    before.to = k;
                }
                all.push(Held { from: k, to: k });
            }
        }
    }
    all
}

fn ranges(run: &Trajectory) -> Vec<f64> {
    let range = |c: usize| {
        let (low, high) = run
            .inputs
            .column(c)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        high - low
    };
    (0..run.inputs.width()).map(range).collect()
}

fn output(run: &Trajectory, name: &str) -> Option<usize> {
    run.outputs.channels().iter().position(|channel| channel.name == name)
}

/// Integral of the yaw rate from the first sample on \[rad\]; a missing value keeps the last one.
fn heading(run: &Trajectory) -> Option<Vec<f64>> {
    let r = output(run, MOTION[2])?;
    let mut heading = Vec::with_capacity(run.len());
    let (mut psi, mut before) = (0.0, 0.0);
    for (k, rate) in run.outputs.column(r).enumerate() {
        let rate = if rate.is_finite() { rate } else { before };
        if k > 0 {
            psi += 0.5 * (before + rate) * run.dt;
        }
        before = rate;
        heading.push(psi);
    }
    Some(heading)
}

impl Track {
    /// The measured motion from one sample to another. The heading is the integral of the yaw rate, corrected by a straight
    /// line through its differences from the measured heading, if there is one; the path is the integral of the body
    /// velocities over ground. Missing values are the last ones. `None` without surge or yaw rate.
    pub fn measured(run: &Trajectory, from: usize, to: usize) -> Option<Self> {
        let part = run.slice(from, to + 1);
        let mut psi = heading(&part)?;
        if let Some(measured) = &part.heading {
            let known: Vec<(f64, f64)> = measured
                .iter()
                .zip(&psi)
                .enumerate()
                .filter(|(_, (measured, _))| measured.is_finite())
                .map(|(k, (measured, psi))| (k as f64, measured - psi))
                .collect();
            if let Some(&(_, first)) = known.first() {
                let near = |x: f64| x - TAU * ((x - first) / TAU).round();
                let line = line(known.iter().map(|&(k, difference)| (k, near(difference))));
                for (k, psi) in psi.iter_mut().enumerate() {
                    *psi += line[0] + line[1] * k as f64;
                }
            }
        }
        let columns = [output(run, MOTION[0]), output(run, MOTION[1]), output(run, MOTION[2])];
        let (u, r) = (columns[0]?, columns[2]?);
        let mut track = Self { dt: run.dt, ..Self::default() };
        let mut nu = [0.0; 3];
        for (k, psi) in psi.iter().copied().enumerate() {
            let before = nu;
            let row = part.outputs.row(k);
            for (own, column) in nu.iter_mut().zip([Some(u), columns[1], Some(r)]) {
                *own = column.map(|column| row[column]).filter(|x| x.is_finite()).unwrap_or(*own);
            }
            let [mut x, mut y, last] = track.eta.last().copied().unwrap_or([0.0, 0.0, psi]);
            if k > 0 {
                let [surge, sway] = [0, 1].map(|i| 0.5 * (before[i] + nu[i]) * run.dt);
                let (sin, cos) = (0.5 * (last + psi)).sin_cos();
                x += surge * cos - sway * sin;
                y += surge * sin + sway * cos;
            }
            track.eta.push([x, y, psi]);
            track.nu.push(nu);
            track.steering.push(f64::NAN);
        }
        Some(track)
    }
}

/// Intercept and slope of the straight line through points.
fn line(points: impl Iterator<Item = (f64, f64)> + Clone) -> [f64; 2] {
    let count = points.clone().count().max(1) as f64;
    let (x, y) = points.clone().fold((0.0, 0.0), |sum, p| (sum.0 + p.0, sum.1 + p.1));
    let (x, y) = (x / count, y / count);
    let (xx, xy) =
        points.fold((0.0, 0.0), |sum, p| (sum.0 + (p.0 - x) * (p.0 - x), sum.1 + (p.0 - x) * (p.1 - y)));
    let slope = if xx > 0.0 { xy / xx } else { 0.0 };
    [y - slope * x, slope]
}

/// The trials of runs beside the predictions of a model.
///
/// # Errors
/// If the model is not a plant, or `progress` cancels.
pub fn compare(
    model: &Model,
    runs: &[Trajectory],
    progress: Progress<'_>,
) -> Result<Vec<Comparison>, ManoeuvreError> {
    let mut all = Vec::new();
    for (i, run) in runs.iter().enumerate() {
        let trials = recognise(run);
        let count = trials.len() as f64;
        for (j, trial) in trials.into_iter().enumerate() {
            report(progress, (i as f64 + j as f64 / count) / runs.len() as f64).map_err(PlantError::from)?;
            let current = current_before(model, run, trial.executes[0]);
            all.extend(comparison(model, run, trial, current)?);
        }
    }
    report(progress, 1.0).map_err(PlantError::from)?;
    Ok(all)
}

fn comparison(
    model: &Model,
    run: &Trajectory,
    trial: Recognised,
    current: [f64; 2],
) -> Result<Option<Comparison>, ManoeuvreError> {
    let start = trial.executes[0];
    let Some(measured) = Track::measured(run, start, trial.end) else { return Ok(None) };
    let side = trial.heading_deg.signum();
    let figures = |track: &Track, executes: &[usize]| match trial.kind {
        RecognisedKind::TurningCircle => TurningCircle::of(track, side).figures(),
        RecognisedKind::Zigzag => {
            Zigzag::of(track, executes, side, trial.heading_deg.abs().to_radians()).figures()
        }
    };
    let prediction = |simulation: Simulation| {
        let (track, executes) = predict(simulation.with_current(current), run, &trial, &measured);
        let reason = track.not_valid.as_ref();
        let reason = reason.map(|reason| format!("from {:.1} s on: {reason}", track.time_s(track.len())));
        let figures = figures(&track, &executes).into_iter().map(|f| f.unless(reason.as_deref())).collect();
        (figures, track)
    };
    let (mut predicted, track): (Vec<Figure>, Track) = prediction(Simulation::new(model)?);
    let members: Vec<(Vec<Figure>, Track)> =
        Simulation::of_members(model)?.into_par_iter().map(prediction).collect();
    let of_members: Vec<&[Figure]> = members.iter().map(|(figures, _)| &figures[..]).collect();
    let count = set_intervals(&mut predicted, &of_members);
    let executes: Vec<usize> = trial.executes.iter().map(|sample| sample - start).collect();
    let provenance = &model.description.provenance;
    Ok(Some(Comparison {
        run: run.name.clone(),
        at_s: run.t0 + start as f64 * run.dt,
        measured: figures(&measured, &executes),
        predicted,
        current,
        trial,
        in_training: provenance.training.contains(&run.name) || provenance.validation.contains(&run.name),
        members: count,
        tracks: [measured, track],
        member_tracks: members.into_iter().map(|(_, track)| track).collect(),
    }))
}

/// The prediction of a trial from its first sample, and its samples at which the commands change.
fn predict(
    mut simulation: Simulation,
    run: &Trajectory,
    trial: &Recognised,
    measured: &Track,
) -> (Track, Vec<usize>) {
    let (start, end) = (trial.executes[0], trial.end);
    simulation.start_in(run, start, PAST, measured.eta[0]);
    let headings: Vec<f64> =
        trial.executes.iter().map(|&sample| measured.turned(sample - start, 1.0)).collect();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let longest = ((end - start) as f64 * LONGER) as usize;
    let mut predicted = Track {
        dt: run.dt,
        eta: vec![simulation.eta()],
        nu: vec![simulation.nu_over_ground()],
        steering: vec![f64::NAN],
        ..Track::default()
    };
    let side = trial.heading_deg.signum();
    let mut reversals = vec![0];
    // A turn of the measured length, a zigzag with the measured number of commands.
    let mut last = usize::MAX;
    while predicted.len() <= longest.min(last) {
        let held = run.inputs.row(trial.executes[reversals.len() - 1]);
        simulation.advance(held);
        predicted.not_valid = simulation.not_valid();
        if predicted.not_valid.is_some() {
            break;
        }
        predicted.eta.push(simulation.eta());
        predicted.nu.push(simulation.nu_over_ground());
        predicted.steering.push(f64::NAN);
        let now = predicted.len() - 1;
        let next = reversals.len();
        if next < headings.len() {
            let to = if next % 2 == 1 { side } else { -side };
            if predicted.turned(now, to) >= to * headings[next] {
                reversals.push(now);
                if next + 1 == headings.len() {
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
                    let rest = ((end - trial.executes[next]) as f64 * LONGER) as usize;
                    last = now + rest;
                }
            }
        }
    }
    (predicted, reversals)
}

/// Writes the tracks of comparisons as CSV: number, run and title of the trial, whether the row was measured or predicted,
/// time since the first sample of the trial, pose and velocities over ground.
///
/// # Errors
/// If the writer fails.
pub fn write_comparisons_csv(comparisons: &[Comparison], writer: impl Write) -> io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 16, writer);
    writeln!(out, "trial,run,name,source,t [s],x [m],y [m],psi [rad],u [m/s],v [m/s],r [rad/s]")?;
    for (number, comparison) in comparisons.iter().enumerate() {
        let [run, title] = [&comparison.run, &comparison.trial.title()].map(|text| text.replace(',', ";"));
        for (source, track) in ["measured", "predicted"].into_iter().zip(&comparison.tracks) {
            for k in 0..track.len() {
                write!(out, "{number},{run},{title},{source},{}", Shortest(track.time_s(k)))?;
                for value in track.eta[k].iter().chain(&track.nu[k]) {
                    write!(out, ",{}", Shortest(*value))?;
                }
                writeln!(out)?;
            }
        }
    }
    out.flush()
}
