//! Several trials of a plant, with intervals and criteria.

use std::io::{self, BufWriter, Write};

use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};

use super::approach::{Approach, Options};
use super::error::ManoeuvreError;
use super::figure::{Figure, Figures, NO_SWAY, NO_SWAY_FIGURES, set_intervals, stability};
use super::left_out::widen;
use super::pull_out::pull_out;
use super::recognised::RecognisedKind;
use super::speed_trials::{acceleration, stopping};
use super::spiral::spiral;
use super::track::Track;
use super::turning_circle::turning_circle;
use super::zigzag::zigzag;
use crate::key::key;
use crate::log::Shortest;
use crate::model::{MOTION, Model};
use crate::plant::{InputMap, Outside, PlantError, Simulation};
use crate::progress::Progress;

/// A trial with its parameters. The steering is positive to starboard, and 1 or -1 on the side to which it reaches farther
/// ([`InputMap::hard_over`]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "trial", rename_all = "kebab-case")]
pub enum TrialKind {
    /// Turning circle.
    TurningCircle {
        /// Steering.
        steering: f64,
    },
    /// Zigzag.
    Zigzag {
        /// Steering of the first execute.
        steering: f64,
        /// Change of heading at which the steering is reversed \[deg\].
        heading_deg: f64,
    },
    /// Pull-outs from turns to both sides.
    PullOut {
        /// Steering of the turns.
        steering: f64,
    },
    /// Direct spiral.
    Spiral {
        /// Largest steering.
        steering: f64,
        /// Number of steps from side to side.
        steps: u32,
    },
    /// Acceleration from rest.
    Acceleration,
    /// Stopping.
    Stopping,
}

/// A trial and its results.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// The trial.
    #[serde(flatten)]
    pub kind: TrialKind,
    /// Figures.
    pub figures: Vec<Figure>,
    /// Directional stability, for pull-out and spiral.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub directionally_stable: Option<bool>,
    /// Why it is not decided.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stability_not_decided: Option<String>,
    /// The curve of a spiral.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<super::SpiralPoint>,
    /// Why the motion is not valid from some time on; only figures that are reached before have a value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_valid: Option<String>,
    /// Outputs and inputs that leave the training range.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub outside: Vec<Outside>,
    /// Number of members whose trials give the intervals.
    pub members: usize,
    /// Tracks; two for a pull-out, none for a spiral.
    #[serde(skip)]
    pub tracks: Vec<Track>,
    /// Tracks of members.
    #[serde(skip)]
    pub member_tracks: Vec<Track>,
}

/// The trials of a plant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trials {
    /// Speed of the approach through the water \[m/s\], of the ship if a scale is stated.
    pub approach_speed_m_s: f64,
    /// Propulsion of the approach: 1 is full ahead. None for a vessel that no input pushes.
    pub propulsion: Option<f64>,
    /// Why there is no propulsion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_propulsion: Option<String>,
    /// Steering that holds the straight course: 1 is hard to starboard.
    pub neutral_steering: f64,
    /// Command of the approach.
    pub approach_command: Vec<f64>,
    /// Which inputs push and turn the vessel.
    pub inputs: InputMap,
    /// The trials.
    pub trials: Vec<Trial>,
    /// What is said of neutral values and limits that only follow from the logs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Trials that the vessel cannot do.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOut>,
    /// Options.
    #[serde(skip)]
    pub options: TrialOptions,
}

/// Trials of a kind that were asked for among all, and that the vessel cannot do.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeftOut {
    /// Kind of the trials.
    pub trial: &'static str,
    /// Reason.
    pub reason: String,
}

/// Options of [`trials`].
#[derive(Clone, Debug, PartialEq)]
pub struct TrialOptions {
    /// Approach.
    pub approach: Options,
    /// Longest trial, and longest step of a spiral \[s\].
    pub longest_s: f64,
    /// Velocity of the water, north and east \[m/s\]; the approach heads north.
    pub current: [f64; 2],
    /// Length of the ship \[m\], for the criteria of the IMO.
    pub length_m: Option<f64>,
    /// Scale of the vessel in the logs: lengths of the ship relative to those of the model.
    pub scale: f64,
}

impl Default for TrialOptions {
    fn default() -> Self {
        Self {
            approach: Options::default(),
            longest_s: 3_600.0,
            current: [0.0; 2],
            length_m: None,
            scale: 1.0,
        }
    }
}

/// Results of one simulation.
struct Outcome {
    figures: Vec<Figure>,
    stable: Option<bool>,
    points: Vec<super::SpiralPoint>,
    tracks: Vec<Track>,
    not_valid: Option<String>,
}

impl Outcome {
    /// The results of a ship whose lengths are `scale` times those of the vessel: by Froude's law, times and speeds are the
    /// square root of it larger.
    fn scaled(mut self, scale: f64) -> Self {
        let root = scale.sqrt();
        self.figures.iter_mut().for_each(|figure| figure.scale(scale));
        for point in &mut self.points {
            point.yaw_rate_deg_s /= root;
            point.speed_m_s *= root;
        }
        self.tracks.iter_mut().for_each(|track| track.scale(scale));
        self
    }
}

impl TrialOptions {
    /// What is said of the scale and of the criteria.
    fn notes(&self, speed_m_s: f64) -> impl Iterator<Item = String> {
        let Self { scale, length_m, .. } = *self;
        let scaled = (scale != 1.0).then(|| {
            format!(
                "figures are those of the ship, by Froude's law: lengths {scale} times, times and speeds {:.4} times those of the model; the larger friction of the model is not corrected. Commands are those of the model. Where the model extrapolates or is not valid, times and speeds are those of the model",
                scale.sqrt()
            )
        });
        let of_ships = || {
            let is_small = length_m.is_some_and(|length| length < LEAST_LENGTH_M);
            is_small.then(|| {
                format!("the criteria are those of ships of {LEAST_LENGTH_M} m and more (MSC.137(76), section 1.2)")
            })
        };
        scaled.into_iter().chain(self.no_criterion(speed_m_s).or_else(of_ships))
    }

    /// Why a ship of the stated length is not judged at a speed.
    fn no_criterion(&self, speed_m_s: f64) -> Option<String> {
        let length = self.length_m?;
        let number = speed_m_s / (STANDARD_GRAVITY * length).sqrt();
        if self.current != [0.0; 2] {
            return Some("no criterion is judged in a current: criteria are those of calm water (MSC.137(76), section 4)".to_owned());
        }
        (number.is_nan() || number < LEAST_FROUDE).then(|| {
            format!(
                "no criterion is judged: {speed_m_s:.3} m/s is no test speed of a ship of {length} m (Froude number {number:.4}). If the logs are those of a model, state its scale with {}",
                key("scale")
            )
        })
    }
}

/// Standard acceleration of free fall \[m/s^2\].
const STANDARD_GRAVITY: f64 = 9.80665;

/// Froude number below which a speed is no test speed of a ship: that of the slowest tankers is above 0.1, and a model that is
/// taken for its ship is off by the square root of its scale.
const LEAST_FROUDE: f64 = 0.05;

/// Shortest ship for which the criteria are made \[m\].
const LEAST_LENGTH_M: f64 = 100.0;

/// Sample time of vessels with given parameters \[s\]; that of an identified model is its own.
const STEP_S: f64 = 0.01;

/// Runs trials of a model, and of each member of its ensemble or committee for the intervals.
///
/// # Errors
/// If a trial of the model cannot be run; members that cannot are left out of the intervals.
pub fn trials(
    model: &Model,
    map: &InputMap,
    kinds: &[TrialKind],
    options: &TrialOptions,
    progress: Progress<'_>,
) -> Result<Option<Trials>, ManoeuvreError> {
    if !(options.longest_s.is_finite() && options.longest_s > 0.0) {
        let needed = "seconds greater than 0 are needed";
        return Err(ManoeuvreError::Option { what: "the longest trial", value: options.longest_s, needed });
    }
    if !(options.scale.is_finite() && options.scale > 0.0) {
        let needed = "a number greater than 0 is needed, as 45.7 for a model of 1 : 45.7";
        return Err(ManoeuvreError::Option { what: "the scale", value: options.scale, needed });
    }
    let model = &model.clone().at_step(STEP_S).map_err(PlantError::from)?;
    let approach = |simulation: Simulation| {
        Approach::new(model, map, simulation.with_current(options.current), &options.approach)
    };
    let own = approach(Simulation::new(model)?).map_err(|error| not_identified(model).unwrap_or(error))?;
    let members = Simulation::of_members(model)?;
    let all = members.len();
    let members: Vec<Approach> = members.into_par_iter().filter_map(|member| approach(member).ok()).collect();
    let mut results = Vec::with_capacity(kinds.len());
    for (done, kind) in kinds.iter().enumerate() {
        if progress(done as f64 / kinds.len() as f64).is_break() {
            return Ok(None);
        }
        let outcome = kind.run(&own, map, options.longest_s)?;
        let others: Vec<Outcome> =
            members.par_iter().filter_map(|member| kind.run(member, map, options.longest_s).ok()).collect();
        results.push(trial(model, *kind, outcome, (others, all), (map, own.propulsion), options));
    }
    if progress(1.0).is_break() {
        return Ok(None);
    }
    let approach_speed_m_s = own.speed_m_s * options.scale.sqrt();
    let mut notes = map.notes();
    notes.extend(options.notes(approach_speed_m_s));
    if let Some(reason) = no_sway(model) {
        notes.push(format!(
            "distances are those of a vessel that does not move sideways, and are not judged: {reason}"
        ));
    }
    if model.description.provenance.not_for_trials {
        notes.push(
            "the identification found that this model is not for trials and control; its report states why"
                .to_owned(),
        );
    }
    let stops = |trial: &&Trial| {
        trial.figures.iter().any(|figure| {
            figure.name == "stopping_time_s" && figure.value.is_none() && figure.not_valid.is_none()
        })
    };
    notes.extend(results.iter().find(stops).map(|_| {
        format!(
            "the vessel does not stop within {} s with its lowest propulsion ({}): if it can be stopped or reversed, state the limits ({})",
            options.longest_s,
            commands_text(map, &map.command(-map.astern(), own.steering)),
            key("limit").is("NAME=LOW:HIGH")
        )
    }));
    let is_judged = results.iter().flat_map(|trial| &trial.figures).any(|figure| figure.criterion.is_some());
    if let (Some(_), None, false) = (options.length_m, options.no_criterion(approach_speed_m_s), is_judged) {
        notes.push(format!(
            "no criterion is judged: those of MSC.137(76) are for turns with 35 deg of rudder or hard over, zigzags 10/10 and 20/20 with rudder angles, and a full astern stop. The steering here is stated in {}",
            map.steering().unit
        ));
    }
    Ok(Some(Trials {
        approach_speed_m_s,
        propulsion: map.no_propulsion().is_none().then_some(own.propulsion),
        no_propulsion: map.no_propulsion(),
        neutral_steering: own.steering,
        approach_command: map.command(own.propulsion, own.steering),
        inputs: map.clone(),
        trials: results,
        notes,
        left_out: Vec::new(),
        options: options.clone(),
    }))
}

/// Commands with their names and units.
fn commands_text(map: &InputMap, command: &[f64]) -> String {
    let each = map.names.iter().zip(&map.units).zip(command);
    let each = each.map(|((name, unit), value)| format!("{name} {value:.3} {unit}").trim_end().to_owned());
    each.collect::<Vec<_>>().join(", ")
}

/// Why a model does not know the sway velocity.
fn no_sway(model: &Model) -> Option<String> {
    let is_known =
        model.is_vessel() || model.description.outputs.iter().any(|port| port.channel.name == MOTION[1]);
    if is_known { model.not_identified(&[MOTION[1]]) } else { Some(NO_SWAY.to_owned()) }
}

/// Why nothing that follows from a model is valid: it does not know its speed or its yaw rate.
pub(crate) fn not_valid(model: &Model) -> Option<String> {
    Some(format!("from the start on: {}", model.not_identified(&[MOTION[0], MOTION[2]])?))
}

/// The error of a model that does not know its speed or its yaw rate, and has no approach.
pub(crate) fn not_identified(model: &Model) -> Option<ManoeuvreError> {
    let reason = model.not_identified(&[MOTION[0], MOTION[2]])?;
    Some(ManoeuvreError::NotIdentified { reason })
}

fn trial(
    model: &Model,
    kind: TrialKind,
    outcome: Outcome,
    (others, all): (Vec<Outcome>, usize),
    (map, propulsion): (&InputMap, f64),
    options: &TrialOptions,
) -> Trial {
    let mut outside = outside(model, &outcome.tracks);
    let inputs = inputs_outside(model, map, kind, propulsion, &outcome.tracks);
    outside.extend(inputs.iter().cloned());
    let mut outcome = outcome;
    mark_extrapolated(&mut outcome.figures, &outside);
    let beyond = beyond(&mut outcome.figures, &inputs);
    outcome.not_valid = outcome.not_valid.or(beyond);
    let not_valid = not_valid(model);
    let (outcome, others) = (outcome.scaled(options.scale), others.into_iter());
    let others: Vec<Outcome> = others.map(|other| other.scaled(options.scale)).collect();
    let mut figures = outcome.figures;
    let figures_of_members: Vec<&[Figure]> = others.iter().map(|other| &other.figures[..]).collect();
    let members = set_intervals(&mut figures, &figures_of_members, all);
    let recognised = match kind {
        TrialKind::TurningCircle { .. } => Some(RecognisedKind::TurningCircle),
        TrialKind::Zigzag { .. } => Some(RecognisedKind::Zigzag),
        _ => None,
    };
    if let Some(kind) = recognised {
        widen(&mut figures, kind, &model.description.trial_errors);
    }
    let no_sway = no_sway(model);
    for figure in &mut figures {
        if let Some(reason) = &no_sway {
            figure.without_sway(&NO_SWAY_FIGURES[..1], reason);
        }
        if let Some(reason) = &not_valid {
            figure.withdraw(reason);
        }
    }
    if let Some(length) = options.length_m {
        let speed = outcome.tracks.first().map_or(f64::NAN, |track| track.speed(track.execute));
        if options.no_criterion(speed).is_none() {
            kind.judge(&mut figures, map, length, speed);
            let distances = figures
                .iter_mut()
                .filter(|figure| no_sway.is_some() && NO_SWAY_FIGURES.contains(&&*figure.name));
            distances.for_each(|figure| (figure.criterion, figure.not_judged) = (None, None));
        }
    }
    // What follows from given parameters is as certain as they are; estimates have errors that no interval holds.
    let is_given = model.is_vessel() && !model.has_estimates();
    for criterion in figures.iter_mut().filter_map(|figure| figure.criterion.as_mut()).filter(|_| is_given) {
        criterion.is_certain.get_or_insert(true);
    }
    let of_members: Vec<Option<bool>> = others.iter().map(|other| other.stable).collect();
    let (stable, mut not_decided) =
        stability(outcome.stable.filter(|_| not_valid.is_none()), &of_members, all);
    if matches!(kind, TrialKind::Spiral { .. })
        && outcome.stable.or(stable).is_none()
        && outcome.not_valid.is_none()
    {
        not_decided = Some("the yaw rate does not grow with the steering everywhere".to_owned());
    }
    Trial {
        kind,
        figures,
        not_valid: not_valid.clone().or(outcome.not_valid),
        outside,
        directionally_stable: stable,
        stability_not_decided: not_decided.filter(|_| not_valid.is_none()),
        points: outcome.points,
        members,
        tracks: outcome.tracks,
        member_tracks: others.into_iter().flat_map(|other| other.tracks).collect(),
    }
}

/// Marks the figures that are known only after an output or an input has left the training range.
pub(super) fn mark_extrapolated(figures: &mut [Figure], outside: &[Outside]) {
    let from_s = outside.iter().map(|outside| outside.from_s).fold(f64::INFINITY, f64::min);
    for figure in figures {
        figure.extrapolated = figure.at_s.unwrap_or(f64::MAX) > from_s;
    }
}

/// Withdraws the figures that are known only after an input has left the range in which the model can be believed, and states
/// the reason.
pub(super) fn beyond(figures: &mut [Figure], inputs: &[Outside]) -> Option<String> {
    let beyond = inputs.iter().filter(|outside| !outside.is_believed());
    let first = beyond.min_by(|a, b| a.from_s.total_cmp(&b.from_s))?;
    let reason = first.reason();
    for figure in figures.iter_mut().filter(|figure| figure.not_valid.is_none()) {
        if figure.at_s.unwrap_or(f64::MAX) > first.from_s {
            figure.withdraw(&reason);
        }
    }
    Some(reason)
}

/// Outputs that leave the training range along tracks.
pub(super) fn outside(model: &Model, tracks: &[Track]) -> Vec<Outside> {
    // A vessel with given parameters has no training range.
    if model.is_vessel() {
        return Vec::new();
    }
    let channel = |(i, name): (usize, &&str)| {
        let port = model.description.outputs.iter().find(|port| port.channel.name == *name)?;
        let samples = tracks.iter().flat_map(|track| {
            let time = |sample: usize| sample.saturating_sub(track.execute) as f64 * track.dt;
            track.nu.iter().enumerate().map(move |(sample, nu)| (time(sample), nu[i]))
        });
        Outside::of(port, samples)
    };
    MOTION.iter().enumerate().filter_map(channel).collect()
}

/// Inputs that the trial commands beyond the range of the training, as with the rudder hard over. A spiral has no track, and
/// is outside from its start.
fn inputs_outside(
    model: &Model,
    map: &InputMap,
    kind: TrialKind,
    propulsion: f64,
    tracks: &[Track],
) -> Vec<Outside> {
    // Time since the order, and command.
    let mut commands: Vec<(f64, Vec<f64>)> = Vec::new();
    for track in tracks {
        let mut before = f64::NAN;
        for (k, &s) in track.steering.iter().enumerate() {
            if s != before {
                commands.push((track.time_s(k).max(0.0), map.command(track.propulsion, s)));
            }
            before = s;
        }
    }
    if let TrialKind::Spiral { steering, .. } = kind {
        commands.extend([steering, -steering].map(|s| (0.0, map.command(propulsion, s))));
    }
    Outside::of_commands(model, &commands.iter().map(|(t, command)| (*t, &command[..])))
}

impl Trials {
    /// The document `trials.json`: the trials with their titles, the name and kind of the plant, how the steering is stated,
    /// and the options.
    pub fn document(&self, plant: &str, model: &Model) -> Value {
        let options = &self.options;
        let trial = |trial: &Trial| {
            let mut value = json!(trial);
            value["title"] = json!(trial.kind.title(&self.inputs));
            value
        };
        let mut document = json!(self);
        document["trials"] = self.trials.iter().map(trial).collect();
        document["plant"] = json!(plant);
        document["kind"] = json!(model.kind());
        document["steering"] = json!(self.inputs.steering());
        if !model.description.boat.particulars.is_empty() {
            document["particulars"] = json!(model.description.boat.particulars);
        }
        document["length_m"] = json!(options.length_m);
        document["current"] = json!(options.current);
        document["scale"] = json!(options.scale);
        document
    }

    /// Whether all trials are valid, and no criterion was missed.
    pub fn passed(&self) -> bool {
        let passed = |figure: &Figure| figure.criterion.is_none_or(|criterion| criterion.passed);
        self.trials.iter().all(|trial| trial.not_valid.is_none() && trial.figures.iter().all(passed))
    }

    /// Writes the tracks as CSV: number and name of the trial, time since the order, commands, pose and velocities over
    /// ground.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write_csv(&self, writer: impl Write) -> io::Result<()> {
        let mut out = BufWriter::with_capacity(1 << 16, writer);
        write!(out, "trial,name,t [s]")?;
        for (name, unit) in self.inputs.names.iter().zip(&self.inputs.units) {
            write!(out, ",{name} [{unit}]")?;
        }
        writeln!(out, ",x [m],y [m],psi [rad],u [m/s],v [m/s],r [rad/s]")?;
        let mut command = vec![0.0; self.inputs.names.len()];
        let tracks =
            self.trials.iter().flat_map(|trial| trial.tracks.iter().map(move |track| (trial, track)));
        for (number, (trial, track)) in tracks.enumerate() {
            let title = trial.kind.title(&self.inputs).replace(',', ";");
            for k in 0..track.len() {
                write!(out, "{number},{title},{}", Shortest(track.time_s(k)))?;
                self.inputs.write_command(track.propulsion, track.steering[k], &mut command);
                for value in command.iter().chain(&track.eta[k]).chain(&track.nu[k]) {
                    write!(out, ",{}", Shortest(*value))?;
                }
                writeln!(out)?;
            }
        }
        out.flush()
    }
}

impl TrialKind {
    fn run(&self, approach: &Approach, map: &InputMap, longest_s: f64) -> Result<Outcome, ManoeuvreError> {
        let outcome = |figures: Vec<Figure>, stable, tracks: Vec<Track>| {
            let not_valid = tracks.iter().find_map(|track| {
                let reason = track.not_valid.as_ref()?;
                Some(format!("from {:.1} s on: {reason}", track.time_s(track.len()).max(0.0)))
            });
            let figures = figures.into_iter().map(|figure| figure.unless(not_valid.as_deref())).collect();
            Ok(Outcome { figures, stable, points: Vec::new(), tracks, not_valid })
        };
        match *self {
            Self::TurningCircle { steering } => {
                let (circle, track) = turning_circle(approach, map, steering, longest_s);
                outcome(circle.figures(), None, vec![track])
            }
            Self::Zigzag { steering, heading_deg } => {
                let (result, track) = zigzag(approach, map, steering, heading_deg.to_radians(), longest_s);
                outcome(result.figures(), None, vec![track])
            }
            Self::PullOut { steering } => {
                let (result, tracks) = pull_out(approach, map, steering, longest_s);
                outcome(result.figures(), result.stable, tracks.into())
            }
            Self::Spiral { steering, steps } => {
                let result = spiral(approach, map, steering, steps, longest_s)?;
                let not_valid = result.not_valid.as_ref().map(|reason| {
                    let turns = result.points.len();
                    format!("after {turns} of {} turns: {reason}", 2 * steps + 1)
                });
                let figures = result.figures().into_iter().map(|f| f.unless(not_valid.as_deref())).collect();
                let (stable, points) = (result.stable, result.points);
                Ok(Outcome { figures, stable, points, tracks: Vec::new(), not_valid })
            }
            Self::Acceleration => {
                let (result, track) = acceleration(approach, map, longest_s);
                outcome(result.figures(), None, vec![track])
            }
            Self::Stopping => {
                let (result, track) = stopping(approach, map, longest_s);
                outcome(result.figures(), None, vec![track])
            }
        }
    }

    /// Criteria of IMO resolution MSC.137(76) for a ship of a length at a speed: turning ability with 35 degrees of rudder
    /// or hard over, unless that only follows from the logs, initial turning and course keeping by the zigzags 10/10 and 20/20, stopping full astern.
    fn judge(&self, figures: &mut [Figure], map: &InputMap, length: f64, speed: f64) {
        let angle = |s: f64| {
            let steering = map.steering();
            (steering.unit == "deg").then_some(s.abs() * steering.full)
        };
        let is = |value: f64, nominal: f64| (value - nominal).abs() < 0.05;
        let mut limit = |name: &str, limit: f64| {
            figures.iter_mut().filter(|figure| figure.name == name).for_each(|figure| figure.limit(limit));
        };
        // Time to sail the length of the ship.
        let time = length / speed;
        match *self {
            Self::TurningCircle { steering } => {
                let is_hard_over = (steering.abs() / map.hard_over(steering) - 1.0).abs() < 1e-6;
                let turns = map.values.iter().zip(&map.turn).filter(|(_, turn)| **turn != 0.0);
                let is_known = turns.map(|(value, _)| value).all(|value| value.weak().next().is_none());
                let hard = angle(steering).is_some_and(|angle| is(angle, 35.0)) || is_hard_over && is_known;
                if hard {
                    limit("advance_m", 4.5 * length);
                    limit("tactical_diameter_m", 5.0 * length);
                }
            }
            Self::Zigzag { steering, heading_deg } => {
                let Some(angle) = angle(steering) else { return };
                if is(angle, 10.0) && is(heading_deg, 10.0) {
                    limit("initial_turning_distance_m", 2.5 * length);
                    limit("first_overshoot_deg", (5.0 + 0.5 * time).clamp(10.0, 20.0));
                    limit("second_overshoot_deg", (17.5 + 0.75 * time).clamp(25.0, 40.0));
                }
                if is(angle, 20.0) && is(heading_deg, 20.0) {
                    limit("first_overshoot_deg", 25.0);
                }
            }
            Self::Stopping if map.astern() > 0.0 => limit("track_reach_m", 15.0 * length),
            _ => {}
        }
    }

    /// Name of the trial, with its parameters in the unit of the steering.
    pub fn title(&self, map: &InputMap) -> String {
        let steering = map.steering();
        let stated = |s: f64| format!("{} {}", (1e3 * s.abs() * steering.full).round() / 1e3, steering.unit);
        let side = |s: f64| if s > 0.0 { "starboard" } else { "port" };
        match *self {
            Self::TurningCircle { steering } => {
                format!("turning circle, {} to {}", stated(steering), side(steering))
            }
            Self::Zigzag { steering, heading_deg } => format!(
                "zigzag, {} / {} deg, first to {}",
                stated(steering),
                (1e3 * heading_deg).round() / 1e3,
                side(steering)
            ),
            Self::PullOut { steering } => format!("pull-out from {}", stated(steering)),
            Self::Spiral { steering, .. } => format!("spiral, {}", stated(steering)),
            Self::Acceleration => String::from("acceleration from rest"),
            Self::Stopping => String::from("stopping"),
        }
    }
}
