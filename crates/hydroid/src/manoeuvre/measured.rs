//! Trials in logs, compared with the model's prediction from their first sample.

use std::f64::consts::TAU;
use std::io::{self, BufWriter, Write};

use rayon::prelude::*;
use serde::Serialize;

use super::error::ManoeuvreError;
use super::figure::{Figure, Figures, NO_SWAY, NO_SWAY_FIGURES, set_intervals};
use super::left_out::widen;
use super::recognised::{Recognised, RecognisedKind, recognise};
use super::track::Track;
use super::trials::{commands_outside, mark_extrapolated, not_valid, outside};
use super::turning_circle::TurningCircle;
use super::zigzag::Zigzag;
use crate::log::{Shortest, Trajectory};
use crate::model::{MOTION, Model};
use crate::plant::{Outside, PlantError, Simulation, current_before, find_roles};
use crate::progress::{Progress, report};

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
    /// Figures predicted from the first sample, under the measured commands. A zigzag is reversed at the measured headings,
    /// with the commands that were measured after each execute.
    pub predicted: Vec<Figure>,
    /// Current that the prediction assumes, north and east \[m/s\]: the estimate from the samples before the trial.
    pub current: [f64; 2],
    /// Whether the model was fitted to a run of this name.
    pub in_training: bool,
    /// Number of members of the ensemble or committee whose predictions give the intervals.
    pub members: usize,
    /// Outputs and inputs that leave the training range of the model.
    pub outside: Vec<Outside>,
    /// Measured and predicted track.
    #[serde(skip)]
    pub tracks: [Track; 2],
    /// Tracks of the members.
    #[serde(skip)]
    pub member_tracks: Vec<Track>,
}

/// Longest past that a prediction takes into account \[samples\].
const PAST: usize = 2_000;

/// Duration of a prediction relative to that of the measured trial.
const LONGER: f64 = 1.5;

pub(super) fn output(run: &Trajectory, name: &str) -> Option<usize> {
    run.outputs.channels().iter().position(|channel| channel.name == name)
}

/// Integral of the yaw rate from the first sample on \[rad\]; a missing value keeps the last one.
pub(super) fn heading(run: &Trajectory) -> Option<Vec<f64>> {
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

impl Comparison {
    /// The comparison of a ship whose lengths are `scale` times those of the vessel in the log, by Froude's law.
    fn scaled(mut self, scale: f64) -> Self {
        self.measured.iter_mut().chain(&mut self.predicted).for_each(|figure| figure.scale(scale));
        self.tracks.iter_mut().chain(&mut self.member_tracks).for_each(|track| track.scale(scale));
        self.current = self.current.map(|velocity| velocity * scale.sqrt());
        self
    }
}

/// The trials of runs beside the predictions of a model, as those of the ship if the boat has a scale.
///
/// # Errors
/// If the model is not a plant, or `progress` cancels.
pub fn compare(
    model: &Model,
    runs: &[Trajectory],
    progress: Progress<'_>,
) -> Result<Vec<Comparison>, ManoeuvreError> {
    let boat = find_roles(model);
    let scale = boat.particulars.scale.unwrap_or(1.0);
    let mut all = Vec::new();
    for (i, run) in runs.iter().enumerate() {
        let trials = recognise(run, &boat);
        let count = trials.len() as f64;
        for (j, trial) in trials.into_iter().enumerate() {
            report(progress, (i as f64 + j as f64 / count) / runs.len() as f64).map_err(PlantError::from)?;
            let members = Simulation::of_members(model)?;
            all.extend(comparison(model, members, run, trial)?.map(|found| found.scaled(scale)));
        }
    }
    report(progress, 1.0).map_err(PlantError::from)?;
    Ok(all)
}

/// The trials of a run beside the predictions of a model without its members.
pub(super) fn compare_alone(model: &Model, run: &Trajectory) -> Result<Vec<Comparison>, ManoeuvreError> {
    let trials = recognise(run, &find_roles(model)).into_iter();
    trials.filter_map(|trial| comparison(model, Vec::new(), run, trial).transpose()).collect()
}

fn comparison(
    model: &Model,
    members: Vec<Simulation>,
    run: &Trajectory,
    trial: Recognised,
) -> Result<Option<Comparison>, ManoeuvreError> {
    let start = trial.executes[0];
    let current = current_before(model, run, start);
    let Some(mut measured) = Track::measured(run, start, trial.end) else { return Ok(None) };
    measured.current = current;
    let side = trial.heading_deg.signum();
    let figures = |track: &Track, executes: &[usize]| match trial.kind {
        RecognisedKind::TurningCircle => TurningCircle::of(track, side).figures(),
        RecognisedKind::Zigzag => {
            Zigzag::of(track, executes, side, trial.heading_deg.abs().to_radians()).figures()
        }
    };
    let prediction = |simulation: Simulation| {
        let (mut track, executes) = predict(simulation.with_current(current), run, &trial, &measured);
        let reason = track.not_valid.as_ref();
        let reason = reason.map(|reason| format!("from {:.1} s on: {reason}", track.time_s(track.len())));
        let mut figures: Vec<Figure> =
            figures(&track, &executes).into_iter().map(|f| f.unless(reason.as_deref())).collect();
        if let Some(reason) = not_valid(model) {
            for figure in &mut figures {
                figure.withdraw(&reason);
            }
            track.not_valid = Some(reason);
        }
        (figures, track)
    };
    let (mut predicted, track): (Vec<Figure>, Track) = prediction(Simulation::new(model)?);
    let members: Vec<(Vec<Figure>, Track)> = members.into_par_iter().map(prediction).collect();
    let of_members: Vec<&[Figure]> = members.iter().map(|(figures, _)| &figures[..]).collect();
    let count = set_intervals(&mut predicted, &of_members, of_members.len());
    widen(&mut predicted, trial.kind, &model.description.trial_errors);
    let mut outside = outside(model, std::slice::from_ref(&track));
    let commands = (start..trial.end.max(start + 1)).map(|sample| run.inputs.row(sample));
    outside.extend(commands_outside(model, &commands.enumerate().map(|(k, row)| (k as f64 * run.dt, row))));
    mark_extrapolated(&mut predicted, &outside);
    let executes: Vec<usize> = trial.executes.iter().map(|sample| sample - start).collect();
    let provenance = &model.description.provenance;
    Ok(Some(Comparison {
        run: run.name.clone(),
        at_s: run.t0 + start as f64 * run.dt,
        measured: {
            let mut of_log = figures(&measured, &executes);
            if output(run, MOTION[1]).is_none() {
                for figure in &mut of_log {
                    figure.without_sway(&NO_SWAY_FIGURES, NO_SWAY);
                }
            }
            of_log
        },
        predicted,
        current,
        trial,
        in_training: provenance.training.contains(&run.name) || provenance.validation.contains(&run.name),
        members: count,
        outside,
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
        current: simulation.current(),
        ..Track::default()
    };
    let side = trial.heading_deg.signum();
    let mut reversals = vec![0];
    // A turn of the measured length, a zigzag with the measured number of commands.
    let mut last = usize::MAX;
    while predicted.len() <= longest.min(last) {
        // The commands since the last execute, as they were measured: with the ramps of a rudder, and its jitter.
        let part = reversals.len() - 1;
        let until = trial.executes.get(part + 1).map_or(end, |next| *next).max(trial.executes[part] + 1) - 1;
        let since = predicted.len() - 1 - reversals[part];
        simulation.advance(run.inputs.row((trial.executes[part] + since).min(until)));
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
