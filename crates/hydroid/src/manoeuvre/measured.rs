//! Trials in logs, compared with the model's prediction from their first sample.

use std::f64::consts::TAU;
use std::io::{self, BufWriter, Write};

use rayon::prelude::*;
use serde::Serialize;

use super::error::ManoeuvreError;
use super::figure::{Figure, Figures, NO_SWAY, NO_SWAY_FIGURES, set_intervals};
use super::left_out::widen;
use super::located::{self, Located};
use super::recognised::{Recognised, RecognisedKind, recognise};
use super::track::Track;
use super::trials::{beyond, mark_extrapolated, not_valid, outside};
use super::turning_circle::TurningCircle;
use super::zigzag::Zigzag;
use crate::log::{Shortest, Trajectory, turn_ratio};
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
    /// Figures of the measured motion; their intervals hold the noise of the positions.
    pub measured: Vec<Figure>,
    /// Positions that the measured path is taken from; without them it is the integral of the velocities.
    pub positions: Option<Located>,
    /// Why the positions of the log are not used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_positions: Option<String>,
    /// Figures predicted from the first sample, under the measured commands. A zigzag is reversed at the measured headings,
    /// with the commands that were measured after each execute.
    pub predicted: Vec<Figure>,
    /// What makes figures of the log doubtful.
    pub doubts: Vec<String>,
    /// Comparison errors of the figures that have both values.
    pub errors: Vec<ComparisonError>,
    /// The approach.
    pub approach: MeasuredApproach,
    /// Current that the prediction assumes, north and east \[m/s\]: that of a measured turn, else the estimate of the model from the
    /// samples before the trial.
    pub current: [f64; 2],
    /// Whether the current is that of the measured turn.
    pub current_of_turn: bool,
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

/// The approach of a measured trial.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeasuredApproach {
    /// Mean speed over ground before the order \[m/s\].
    pub speed_m_s: f64,
    /// Time over which it is a mean \[s\]: a tenth of the duration of the trial. 0 if the log begins with the order.
    pub over_s: f64,
    /// Change of the speed in this time, relative to it; `None` if the log begins with the order, or at rest.
    pub change: Option<f64>,
    /// Whether the log begins later than a tenth of the duration of the trial before the order.
    #[serde(skip)]
    is_short: bool,
}

/// Change of the speed of an approach that is not steady.
const STEADY: f64 = 0.1;

impl MeasuredApproach {
    fn is_unsteady(&self) -> bool {
        !self.is_short && self.change.is_some_and(|change| change.abs() > STEADY)
    }

    /// Why it is not known to be steady.
    fn doubt(&self) -> Option<String> {
        if self.is_short {
            return Some(format!(
                "the log begins {:.1} s before the order: whether the approach is steady is not known",
                self.over_s
            ));
        }
        let change = self.change.filter(|_| self.is_unsteady())?;
        Some(format!(
            "the approach is not steady: the speed changes by {:.0} % in the {:.1} s before the order",
            100.0 * change,
            self.over_s
        ))
    }

    /// The approach of a track of which a sample is the order. The track is left from there on.
    fn of(track: &mut Track, order: usize) -> Self {
        // Before the order the velocities are means; from the order on they change, and a straight line shows the first ones.
        let samples = if order > 0 { order } else { track.len().div_ceil(20).max(3).min(track.len()) };
        let lines = [0, 1].map(|i| line((0..samples).map(|k| (k as f64, track.nu[k][i]))));
        let middle = if order > 0 { 0.5 * (samples - 1) as f64 } else { 0.0 };
        let [u, v] = lines.map(|[start, slope]| start + middle * slope);
        let speed = u.hypot(v);
        let change = (u * lines[0][1] + v * lines[1][1]) / speed * samples as f64 / speed;
        track.keep(order, track.len() - 1);
        let [x, y, _] = track.eta[0];
        track.eta.iter_mut().for_each(|eta| (eta[0], eta[1]) = (eta[0] - x, eta[1] - y));
        track.approach = Some([u, v]);
        Self {
            speed_m_s: speed,
            over_s: order as f64 * track.dt,
            change: (order > 0).then_some(change).filter(|change| change.is_finite()),
            is_short: order < 3 || 11 * order < track.len(),
        }
    }
}

/// Why the headings of a run, or its yaw rates, are doubtful.
fn heading_doubt(run: &Trajectory) -> Option<String> {
    let ratio = turn_ratio(std::slice::from_ref(run), output(run, MOTION[2])?)?;
    ((ratio - 1.0).abs() > DIFFERENT_RATE).then(|| {
        format!("the heading of the log changes by {ratio:.3} times the integral of the yaw rate: one of them is wrong. The figures have the yaw rate, and the compass in the mean")
    })
}

/// Why positions are doubtful that seem to be late.
fn late_doubt(positions: &Located) -> Option<String> {
    let late_s = positions.late_s?;
    let word = if late_s > 0.0 { "later" } else { "earlier" };
    Some(format!(
        "the positions of the log are {:.2} s {word} than the velocities, and so are the places of the figures: check the clock of the receiver",
        late_s.abs()
    ))
}

/// That velocities are through the water where positions show the current.
fn water_doubt(positions: &Located, current: [f64; 2]) -> Option<String> {
    let apart = (positions.drift[0] - current[0]).hypot(positions.drift[1] - current[1]);
    (apart < 0.5 * current[0].hypot(current[1])).then(|| {
        "the velocities of the log are through the water, and the prediction takes them for those over ground".to_owned()
    })
}

/// That a prediction turns to the other side than the vessel did.
fn other_side(predicted: &Track, trial: &Recognised) -> Option<String> {
    let side = trial.heading_deg.signum();
    let turned = (0..predicted.len()).map(|k| predicted.turned(k, side).to_degrees());
    let (least, most) = turned.fold((0.0, 0.0), |(low, high): (f64, f64), x| (low.min(x), high.max(x)));
    (-least > 0.5 * trial.heading_deg.abs() && most < 0.1 * trial.heading_deg.abs()).then(|| {
        "the prediction turns to the other side: the steering of this log has the opposite sign to that in the logs of the model"
            .to_owned()
    })
}

/// The current in the last whole turn of 450 degrees or more, north and east: the velocity over ground is a steady one in the body
/// frame and a drift. It is none if the drift does not halve the residuals: the speed still falls in a part of a turn, which a
/// drift may explain.
fn current_of_turn(track: &Track, order: usize) -> Option<[f64; 2]> {
    let turned = |k: usize| (track.eta[k][2] - track.eta[order][2]).abs();
    let end = turned(track.len() - 1);
    let from = (order..track.len()).find(|k| end >= 1.25 * TAU && turned(*k) >= end - TAU)?;
    // Complex sums: the velocity over ground is w e^(i psi) + c.
    let (mut phase, mut drift, mut product, mut squares, mut count) =
        ([0.0; 2], [0.0; 2], [0.0; 2], 0.0, 0.0);
    for k in from..track.len() {
        let ([u, v, _], (sin, cos)) = (track.nu[k], track.eta[k][2].sin_cos());
        let ground = [u * cos - v * sin, u * sin + v * cos];
        for (sum, value) in [(&mut phase, [cos, sin]), (&mut drift, ground), (&mut product, [u, v])] {
            (sum[0], sum[1]) = (sum[0] + value[0], sum[1] + value[1]);
        }
        squares += u * u + v * v;
        count += 1.0;
    }
    let [phase, drift, product] = [phase, drift, product].map(|sum| sum.map(|x| x / count));
    let squares = squares / count;
    // Of the means: product = w + c conj(phase), drift = w phase + c.
    let across = 1.0 - phase[0] * phase[0] - phase[1] * phase[1];
    let steady_drift =
        [product[0] * phase[0] - product[1] * phase[1], product[0] * phase[1] + product[1] * phase[0]];
    let current = [0, 1].map(|i| (drift[i] - steady_drift[i]) / across);
    let conjugate =
        [current[0] * phase[0] + current[1] * phase[1], current[1] * phase[0] - current[0] * phase[1]];
    let water = [0, 1].map(|i| product[i] - conjugate[i]);
    let without = squares - product[0] * product[0] - product[1] * product[1];
    let explained =
        water[0] * product[0] + water[1] * product[1] + current[0] * drift[0] + current[1] * drift[1];
    (across > 0.1 && squares - explained < 0.25 * without && without > 1e-4 * squares).then_some(current)
}

/// The comparison error of a figure, and the uncertainty of the comparison (ITTC 7.5-02-06-04; ASME V&V 20): a smaller error may be
/// that of the measurement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparisonError {
    /// Name of the figure.
    pub name: String,
    /// `E`: measured less predicted value.
    pub error: f64,
    /// `U`: the root of the sum of the squares of half the intervals of both. `None` without either of them.
    pub uncertainty: Option<f64>,
}

impl ComparisonError {
    fn of(measured: &Figure, predicted: &Figure) -> Option<Self> {
        let half = |figure: &Figure| figure.interval.map(|[low, high]| 0.5 * (high - low));
        let uncertainty = half(measured).zip(half(predicted)).map(|(a, b)| a.hypot(b));
        Some(Self { name: measured.name.clone(), error: measured.value? - predicted.value?, uncertainty })
    }
}

/// Longest past that a prediction takes into account \[samples\].
const PAST: usize = 2_000;

/// Difference of the rates of positions and velocities that is stated.
const DIFFERENT_RATE: f64 = 0.02;

/// Duration of a prediction relative to that of the measured trial.
const LONGER: f64 = 1.5;

pub(super) fn output(run: &Trajectory, name: &str) -> Option<usize> {
    run.outputs.channels().iter().position(|channel| channel.name == name)
}

/// A column with its missing values on straight lines between their neighbours; those at the ends are the nearest ones.
pub(super) fn filled(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    let mut known: Option<usize> = None;
    for k in 0..values.len() {
        if !values[k].is_finite() {
            continue;
        }
        let from = known.map_or(0, |before| before + 1);
        let before = known.map_or(values[k], |before| values[before]);
        for gap in from..k {
            let share = (gap + 1 - from) as f64 / (k + 1 - from) as f64;
            values[gap] = before + share * (values[k] - before);
        }
        known = Some(k);
    }
    let last = known.map_or(0.0, |last| values[last]);
    values[known.map_or(0, |last| last + 1)..].fill(last);
    values
}

/// Integral of the yaw rate from the first sample on \[rad\].
pub(super) fn heading(run: &Trajectory) -> Option<Vec<f64>> {
    let rates = filled(run.outputs.column(output(run, MOTION[2])?));
    let mut psi = 0.0;
    let steps = rates.windows(2).map(|pair| {
        psi += 0.5 * (pair[0] + pair[1]) * run.dt;
        psi
    });
    Some(std::iter::once(0.0).chain(steps).take(rates.len()).collect())
}

impl Track {
    /// The measured motion from one sample to another. The heading is the integral of the yaw rate, corrected by a straight
    /// line through its differences from the measured heading, if there is one; the path is the integral of the body
    /// velocities over ground. Missing values are on straight lines between their neighbours. `None` without surge or yaw rate.
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
        let column = |name: &str| output(&part, name).map(|column| filled(part.outputs.column(column)));
        let (surge, yaw) = (column(MOTION[0])?, column(MOTION[2])?);
        let sway = column(MOTION[1]).unwrap_or_else(|| vec![0.0; surge.len()]);
        let mut track = Self { dt: run.dt, steering: vec![f64::NAN; psi.len()], ..Self::default() };
        for (k, psi) in psi.iter().copied().enumerate() {
            let [mut x, mut y, last] = track.eta.last().copied().unwrap_or([0.0, 0.0, psi]);
            if k > 0 {
                let [along, across] = [&surge, &sway].map(|of| 0.5 * (of[k - 1] + of[k]) * run.dt);
                let (sin, cos) = (0.5 * (last + psi)).sin_cos();
                x += along * cos - across * sin;
                y += along * sin + across * cos;
            }
            track.eta.push([x, y, psi]);
            track.nu.push([surge[k], sway[k], yaw[k]]);
        }
        Some(track)
    }
}

/// Intercept and slope of the straight line through points.
pub(super) fn line(points: impl Iterator<Item = (f64, f64)> + Clone) -> [f64; 2] {
    let count = points.clone().count().max(1) as f64;
    let (x, y) = points.clone().fold((0.0, 0.0), |sum, p| (sum.0 + p.0, sum.1 + p.1));
    let (x, y) = (x / count, y / count);
    let (xx, xy) =
        points.fold((0.0, 0.0), |sum, p| (sum.0 + (p.0 - x) * (p.0 - x), sum.1 + (p.0 - x) * (p.1 - y)));
    let slope = if xx > 0.0 { xy / xx } else { 0.0 };
    [y - slope * x, slope]
}

impl Comparison {
    /// What the measured path is taken from, in words, and with a remedy where it is doubtful.
    pub fn path_words(&self) -> String {
        if let Some(Located { fixes, outliers, deviation_m, turned_deg, aside_deg, rate, .. }) =
            &self.positions
        {
            let parts = [
                Some(format!("{fixes} positions with a standard deviation of {deviation_m:.3} m")),
                (*outliers > 0).then(|| format!(", {outliers} outliers left out")),
                (*turned_deg != 0.0)
                    .then(|| format!(", whose axes are turned by {turned_deg:.1} deg against the heading")),
                aside_deg.map(|aside| {
                    let side = if aside > 0.0 { "starboard" } else { "port" };
                    format!(
                        ", whose course in the approach is {:.1} deg to {side} of the heading: distances are along and across it",
                        aside.abs()
                    )
                }),
                ((rate - 1.0).abs() > DIFFERENT_RATE).then(|| {
                    let ratio = 1.0 / rate;
                    format!(
                        "; the velocities of the log, which the model predicts, are {ratio:.3} times theirs"
                    )
                }),
            ];
            return parts.into_iter().flatten().collect();
        }
        let integral = "the integral of the velocities";
        match &self.no_positions {
            Some(reason) => format!("{integral}; the positions of the log are not used, because {reason}"),
            None => format!("{integral}; the run has no single position beside them"),
        }
    }

    /// The comparison of a ship whose lengths are `scale` times those of the vessel in the log, by Froude's law.
    fn scaled(mut self, scale: f64) -> Self {
        self.measured.iter_mut().chain(&mut self.predicted).for_each(|figure| figure.scale(scale));
        self.tracks.iter_mut().chain(&mut self.member_tracks).for_each(|track| track.scale(scale));
        self.current = self.current.map(|velocity| velocity * scale.sqrt());
        self.approach.speed_m_s *= scale.sqrt();
        self.approach.over_s *= scale.sqrt();
        self.doubts.splice(0..0, self.approach.doubt());
        let pairs = self.measured.iter().zip(&self.predicted);
        self.errors =
            pairs.filter_map(|(measured, predicted)| ComparisonError::of(measured, predicted)).collect();
        if let Some(positions) = &mut self.positions {
            positions.deviation_m *= scale;
            positions.late_s = positions.late_s.map(|late_s| late_s * scale.sqrt());
            positions.drift = positions.drift.map(|velocity| velocity * scale.sqrt());
        }
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

/// A measured trial.
struct Measurement {
    track: Track,
    /// Draws from the distribution of the track given the positions.
    draws: Vec<Track>,
    positions: Option<Located>,
    no_positions: Option<String>,
    approach: MeasuredApproach,
    current_of_turn: bool,
    has_sway: bool,
}

impl Measurement {
    fn of(model: &Model, run: &Trajectory, trial: &Recognised) -> Option<Self> {
        let start = trial.executes[0];
        let order = start.min((trial.end - start).div_ceil(10));
        let mut track = Track::measured(run, start - order, trial.end)?;
        let has_sway = output(run, MOTION[1]).is_some();
        let is_turn = trial.kind == RecognisedKind::TurningCircle;
        let of_turn = |track: &Track| if is_turn { current_of_turn(track, order) } else { None };
        let estimate = current_before(model, run, start);
        let (mut positions, mut no_positions, mut draws) = (None, None, Vec::new());
        match located::path(run, start - order, trial.end) {
            Some(Ok(mut path)) => {
                // The axes are known before a current only with a sway velocity.
                let current = if has_sway { of_turn(&path.track).unwrap_or(estimate) } else { [0.0; 2] };
                if located::align(&mut path, order, current) || !path.is_turned {
                    (track, positions, draws) = (path.track, Some(path.located), path.draws);
                } else {
                    let reason = "without a sway velocity and a straight approach their axes are not known";
                    no_positions = Some(reason.to_owned());
                }
            }
            Some(Err(reason)) => no_positions = Some(reason),
            None => {}
        }
        let of_turn = of_turn(&track);
        track.current = of_turn.unwrap_or(estimate);
        let approach = MeasuredApproach::of(&mut track, order);
        for draw in &mut draws {
            draw.current = track.current;
            MeasuredApproach::of(draw, order);
        }
        let current_of_turn = of_turn.is_some();
        Some(Self { track, draws, positions, no_positions, approach, current_of_turn, has_sway })
    }

    /// The figures of the trial, by a function of its track.
    fn figures(&self, of: impl Fn(&Track) -> Vec<Figure>) -> Vec<Figure> {
        let mut figures = of(&self.track);
        let draws: Vec<Vec<Figure>> = self.draws.iter().map(of).collect();
        let draws: Vec<&[Figure]> = draws.iter().map(|figures| &figures[..]).collect();
        set_intervals(&mut figures, &draws, draws.len());
        for figure in &mut figures {
            figure.no_interval = None;
            // The bias of the gyro is not known.
            if figure.name == "steady_yaw_rate_deg_s" {
                figure.interval = None;
            }
            if !self.has_sway && self.positions.is_none() {
                figure.without_sway(&NO_SWAY_FIGURES, NO_SWAY);
            }
            if figure.name == "speed_loss_percent" && self.approach.is_unsteady() {
                figure.withdraw("the approach is not steady");
            }
        }
        figures
    }
}

fn comparison(
    model: &Model,
    members: Vec<Simulation>,
    run: &Trajectory,
    trial: Recognised,
) -> Result<Option<Comparison>, ManoeuvreError> {
    let start = trial.executes[0];
    let Some(measurement) = Measurement::of(model, run, &trial) else { return Ok(None) };
    let measured = &measurement.track;
    let current = measured.current;
    let side = trial.heading_deg.signum();
    let figures = |track: &Track, executes: &[usize]| match trial.kind {
        RecognisedKind::TurningCircle => TurningCircle::of(track, side).figures(),
        RecognisedKind::Zigzag => {
            Zigzag::of(track, executes, side, trial.heading_deg.abs().to_radians()).figures()
        }
    };
    let prediction = |simulation: Simulation| {
        let (mut track, executes) = predict(simulation.with_current(current), run, &trial, measured);
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
    let (mut predicted, mut track): (Vec<Figure>, Track) = prediction(Simulation::new(model)?);
    let members: Vec<(Vec<Figure>, Track)> = members.into_par_iter().map(prediction).collect();
    let of_members: Vec<&[Figure]> = members.iter().map(|(figures, _)| &figures[..]).collect();
    let count = set_intervals(&mut predicted, &of_members, of_members.len());
    widen(&mut predicted, trial.kind, &model.description.trial_errors);
    let mut outside = outside(model, std::slice::from_ref(&track));
    let commands = (start..trial.end.max(start + 1)).map(|sample| run.inputs.row(sample));
    let inputs = Outside::of_commands(model, &commands.enumerate().map(|(k, row)| (k as f64 * run.dt, row)));
    outside.extend(inputs.iter().cloned());
    mark_extrapolated(&mut predicted, &outside);
    let beyond = beyond(&mut predicted, &inputs);
    track.not_valid = track.not_valid.or(beyond);
    let executes: Vec<usize> = trial.executes.iter().map(|sample| sample - start).collect();
    let of_log = measurement.figures(|track| figures(track, &executes));
    let pairs = of_log.iter().zip(&predicted);
    let errors = pairs.filter_map(|(measured, predicted)| ComparisonError::of(measured, predicted)).collect();
    let Measurement { track: measured, positions, no_positions, approach, current_of_turn, .. } = measurement;
    let of_water = positions.as_ref().filter(|_| current_of_turn);
    let doubts = [
        trial.straight_doubt(),
        heading_doubt(run),
        positions.as_ref().and_then(late_doubt),
        of_water.and_then(|positions| water_doubt(positions, current)),
        other_side(&track, &trial),
    ];
    let doubts = doubts.into_iter().flatten().collect();
    let provenance = &model.description.provenance;
    Ok(Some(Comparison {
        run: run.name.clone(),
        at_s: run.t0 + start as f64 * run.dt,
        measured: of_log,
        positions,
        no_positions,
        errors,
        doubts,
        approach,
        current_of_turn,
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A turn of two rounds after a straight course, whose speed falls from 2 to 1.2 m/s in the first quarter, in a current.
    fn turn(current: [f64; 2], gain_m_s2: f64) -> (Track, usize) {
        let (dt, order) = (0.5, 40);
        let mut track = Track { dt, ..Track::default() };
        let (mut eta, mut r) = ([0.0, 0.0, 0.7], 0.0);
        for k in 0..340_u32 {
            let since = (f64::from(k) - order as f64) * dt;
            let slow = if since < 0.0 { 0.0 } else { 1.0 - (-since / 4.0).exp() };
            let water = [2.0 - 0.8 * slow + gain_m_s2 * since.min(0.0), -0.4 * slow];
            let (sin, cos) = f64::sin_cos(eta[2]);
            let ground =
                [water[0] * cos - water[1] * sin + current[0], water[0] * sin + water[1] * cos + current[1]];
            track.eta.push(eta);
            track.nu.push([ground[0] * cos + ground[1] * sin, ground[1] * cos - ground[0] * sin, r]);
            track.steering.push(0.0);
            r = 0.1 * slow;
            eta = [eta[0] + dt * ground[0], eta[1] + dt * ground[1], eta[2] + dt * r];
        }
        (track, order)
    }

    #[test]
    fn a_turn_shows_the_current_in_which_it_was_sailed() {
        for current in [[0.3, -0.2], [-0.6, 0.0], [0.0, 0.1]] {
            let (track, order) = turn(current, 0.0);
            let found = current_of_turn(&track, order).unwrap();
            assert!((0..2).all(|i| (found[i] - current[i]).abs() < 0.02), "{found:?} for {current:?}");
        }
        let (calm, order) = turn([0.0; 2], 0.0);
        assert_eq!(current_of_turn(&calm, order), None);
        let (mut short, order) = turn([0.3, 0.0], 0.0);
        short.keep(0, 160);
        assert_eq!(current_of_turn(&short, order), None, "one round is not enough");
    }

    #[test]
    fn the_approach_is_a_mean_and_its_change_is_stated() {
        let (mut track, order) = turn([0.0; 2], 0.0);
        let approach = MeasuredApproach::of(&mut track, order);
        assert!((approach.speed_m_s - 2.0).abs() < 1e-9 && approach.doubt().is_none(), "{approach:?}");
        assert_eq!(track.eta[0][..2], [0.0; 2]);
        let circle = TurningCircle::of(&track, 1.0);
        assert!((circle.approach_speed_m_s - 2.0).abs() < 1e-9);
        let (mut track, order) = turn([0.0; 2], 0.04);
        let approach = MeasuredApproach::of(&mut track, order);
        assert!((approach.change.unwrap() - 0.8 / 1.6).abs() < 0.05, "{approach:?}");
        assert!(approach.doubt().unwrap().contains("is not steady"));
        let (mut track, order) = turn([0.0; 2], 0.0);
        track.keep(order, track.len() - 1);
        let approach = MeasuredApproach::of(&mut track, 0);
        assert!((approach.speed_m_s - 2.0).abs() < 0.1, "{approach:?}");
        assert!(approach.doubt().unwrap().contains("begins 0.0 s before the order"));
    }

    #[test]
    fn missing_values_are_on_straight_lines_between_their_neighbours() {
        let none = f64::NAN;
        let all = filled([none, 1.0, none, none, 4.0, none].into_iter());
        assert_eq!(all, [1.0, 1.0, 2.0, 3.0, 4.0, 4.0]);
    }
}
