//! Commands: experiments, and paths that a controller with the model follows.

use std::ops::ControlFlow;
use std::str::FromStr as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};

use hydroid::boat::Property;
use hydroid::closed_loop::{ControlMethod, local_position};
use hydroid::config::control::{NamedModel, Setup};
use hydroid::identify::GivenRange;
use hydroid::key::key;
use hydroid::log::LogError;
use hydroid::plant::{find_roles, input_values};
use hydroid::recording::LiveColumn;
use hydroid_core::guidance::Path;

use super::{Boat, Level, Settings};
use crate::experiment::{self, Experiment, Explored, Fence, Kind, Seen, Step};
use crate::link::{Axis, Link};

/// Names of the experiments.
pub(super) const EXPERIMENTS: [&str; 7] =
    ["auto", "acceleration", "zigzag-20", "zigzag-10", "circle", "prbs", "chirp"];

/// Time between the steps of an experiment \[s\].
const STEP_S: f64 = 0.1;

/// Points of a path.
const POINTS: u32 = 400;

/// Who has the helm.
pub(super) enum Steering {
    /// Nobody.
    Off,
    Experiment {
        kind: Kind,
        experiment: Box<Experiment>,
        /// Time of its next step \[s\].
        next: f64,
        command: Vec<f64>,
    },
    /// The controller is being prepared.
    Preparing(Preparation),
    /// A controller on a path: its points north and east \[m\].
    Path(Vec<[f64; 2]>),
}

/// A thread that prepares a controller, and ends when nobody waits for it.
pub(super) struct Preparation {
    receiver: Receiver<Result<Box<Setup>, String>>,
    is_wanted: Arc<AtomicBool>,
}

impl Drop for Preparation {
    fn drop(&mut self) {
        self.is_wanted.store(false, Ordering::Relaxed);
    }
}

impl Steering {
    pub(super) fn end(&mut self) {
        *self = Self::Off;
    }
}

/// Limits and neutral value of an input in the unit of the model: stated, those of the boat, or those of the link.
///
/// # Errors
/// If one of them is not known.
fn axis(link: &impl Link, settings: &Settings, column: &LiveColumn) -> Result<crate::Axis, String> {
    let channel = &column.source.channel;
    let usual = link.limits([column.topic, column.field])?;
    let usual = usual.map(|raw| {
        let [a, b] = raw.map(|value| column.source.si(value));
        [a.min(b), a.max(b)]
    });
    let stated = settings.limits.get(&channel.name).copied();
    let mut boat = settings.boat.clone();
    boat.find(std::slice::from_ref(channel));
    let value = boat.value(channel, stated.or(usual)).map_err(|error| error.to_string())?;
    let limits = stated.unwrap_or(value.limits);
    let neutral = settings.neutral.get(&channel.name).copied();
    // The channels of a remote control have their neutral position in the middle.
    if neutral.is_none() && usual.is_none() && value.weak().any(|property| property == Property::Neutral) {
        let name = &channel.name;
        return Err(format!(
            "the neutral command of {name} is not known: add [boat.inputs.{name}] neutral = VALUE, or {}",
            key("neutral").is(format_args!("{name}=VALUE"))
        ));
    }
    Ok(crate::Axis::new(channel.name.clone(), limits, neutral.unwrap_or(value.neutral)))
}

/// Refuses limits of inputs that do not exist.
pub(super) fn check_limits(settings: &Settings, columns: &[LiveColumn]) -> Result<(), LogError> {
    let names: Vec<&str> = columns.iter().map(|column| column.source.channel.name.as_str()).collect();
    match settings.limits.keys().chain(settings.neutral.keys()).find(|name| !names.contains(&name.as_str())) {
        None => Ok(()),
        Some(name) => Err(LogError::Unusable {
            path: "the settings".to_owned(),
            reason: format!("limits or a neutral command are stated of {name}, which is not an input"),
            remedy: format!("the inputs are {}", names.join(", ")),
        }),
    }
}

/// The inputs of experiments.
///
/// # Errors
/// If limits or a neutral command are not known.
pub(super) fn inputs(
    link: &impl Link,
    settings: &Settings,
    columns: &[LiveColumn],
) -> Result<Vec<crate::Axis>, String> {
    columns.iter().map(|column| axis(link, settings, column)).collect()
}

/// What is explored of the commands so far: nothing.
///
/// # Errors
/// If it is not known which inputs push and turn.
pub(super) fn explored(
    link: &impl Link,
    settings: &Settings,
    columns: &[LiveColumn],
) -> Result<Explored, String> {
    let push = signed(&settings.push, columns, "push", "push the boat ahead")?;
    let turn = signed(&settings.turn, columns, "turn", "turn it to starboard")?;
    Explored::new(&inputs(link, settings, columns)?, &push, &turn)
}

/// The inputs as commands of the link.
pub(super) fn axes(
    link: &impl Link,
    settings: &Settings,
    columns: &[LiveColumn],
) -> Result<Vec<Axis>, String> {
    let of = |column: &LiveColumn| {
        let crate::Axis { name, low, high, rest, .. } = axis(link, settings, column)?;
        let [a, b, rest] = [low, high, rest].map(|value| column.source.raw(value));
        Ok(Axis { name, place: [column.topic, column.field], low: a.min(b), high: a.max(b), rest })
    };
    columns.iter().map(of).collect()
}

/// Places and signs of inputs by name; `-NAME` is reversed.
fn signed(
    names: &[String],
    columns: &[LiveColumn],
    option: &str,
    what: &str,
) -> Result<Vec<(usize, f64)>, String> {
    if names.is_empty() {
        let all: Vec<&str> = columns.iter().map(|column| column.source.channel.name.as_str()).collect();
        return Err(format!(
            "which inputs {what} is not stated: add --{option} LIST with some of {}",
            all.join(", ")
        ));
    }
    let place = |name: &String| {
        let (bare, sign) = name.strip_prefix('-').map_or((name.as_str(), 1.0), |bare| (bare, -1.0));
        let found = columns.iter().position(|column| column.source.channel.name == bare);
        found.map(|at| (at, sign)).ok_or_else(|| format!("there is no input {bare}"))
    };
    names.iter().map(place).collect()
}

/// An error with its causes.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let more = error.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        cause = error.source();
    }
    text
}

/// Time for which the course is extended to the geofence \[s\].
const AHEAD_S: u32 = 30;

/// Points of a path, for pictures and for the geofence.
fn points(path: &Path) -> impl Iterator<Item = [f64; 2]> + '_ {
    (0..=POINTS).map(|k| path.at(path.length() * f64::from(k) / f64::from(POINTS)).position)
}

impl<L: Link> Boat<L> {
    /// Whether commands are sent, or would be in a dry run.
    pub(super) fn is_commanding(&self) -> bool {
        self.link.is_commanding() || !matches!(self.steering, Steering::Off)
    }

    /// The geofence; `None` before the first position.
    pub(super) fn fence(&self) -> Option<Fence> {
        let limits = &self.settings.experiment;
        let origin = self.motion.origin_deg()?;
        let [north, east] = match limits.centre_deg {
            Some(centre) => local_position(origin, centre)?,
            None => [0.0; 2],
        };
        Some(Fence::Circle { north, east, radius: limits.fence_m })
    }

    /// Distance of the boat from the geofence \[m\], negative outside, and the time in which it reaches it on its present course
    /// \[s\], infinite if that is more than [`AHEAD_S`]; `None` before the first position.
    pub(super) fn margin(&self) -> Option<[f64; 2]> {
        let (fence, row) = (self.fence()?, self.motion.at(self.motion.time())?);
        let ([north, east, psi], [u, v, _]) = (row.pose, row.ground);
        let (sine, cosine) = psi.sin_cos();
        let [to_north, to_east] = [u * cosine - v * sine, u * sine + v * cosine];
        let margin = |s: f64| fence.margin(north + s * to_north, east + s * to_east);
        let reached = (0..=AHEAD_S).map(f64::from).find(|s| margin(*s) < 0.0);
        Some([margin(0.0), reached.unwrap_or(f64::INFINITY)]).filter(|[margin, _]| margin.is_finite())
    }

    /// Releases the helm. `level` is that of the message: information if it was asked for.
    pub(super) fn hands_off(&mut self, now_ns: i64, level: Level, reason: &str) {
        let was = !matches!(self.steering, Steering::Off);
        self.steering.end();
        (self.planned, self.pushing_since) = (None, None);
        if let Some(active) = &mut self.active {
            active.release();
        }
        let is_told = self.link.is_commanding();
        self.link.release(now_ns, reason);
        if was && !is_told {
            self.say(now_ns, level, format!("hands off: {reason}"));
        }
        self.hear_helm(now_ns, level);
    }

    /// Whether commands may begin.
    fn check_commands(&self, now_ns: i64) -> Result<(), String> {
        if !self.is_located(now_ns) {
            return Err(
                "position or heading are not measured at present: wait for GNSS and compass".to_owned()
            );
        }
        if let Some(why) = self.link.impossible() {
            return Err(why.to_owned());
        }
        let refusals = if self.settings.is_dry_run { Vec::new() } else { self.link.refusals(now_ns) };
        if refusals.is_empty() { Ok(()) } else { Err(refusals.join("; ")) }
    }

    /// Takes the helm, unless it is a dry run.
    fn begin_commands(&mut self, now_ns: i64) -> Result<(), String> {
        self.check_commands(now_ns)?;
        self.pushing_since = None;
        if self.settings.is_dry_run {
            return Ok(());
        }
        self.link.begin(now_ns).map_err(|refusals| refusals.join("; "))
    }

    pub(super) fn check_free(&self) -> Result<(), String> {
        if matches!(self.steering, Steering::Off) {
            Ok(())
        } else {
            Err("the helm is in use: stop it first".to_owned())
        }
    }

    /// Whether the boat is within the fence.
    fn check_fence(&self) -> Result<(), String> {
        let here = self.motion.at(self.motion.time()).map(|row| row.pose);
        let (Some(fence), Some([north, east, _])) = (self.fence(), here) else {
            return Err("there is no position yet: wait for the GNSS".to_owned());
        };
        let margin = fence.margin(north, east);
        if margin > 0.0 {
            return Ok(());
        }
        Err(format!(
            "the boat is {:.0} m outside of the geofence: take it inside, or move the fence",
            -margin
        ))
    }

    pub(super) fn begin_experiment(&mut self, name: &str, now_ns: i64) -> Result<String, String> {
        self.check_free()?;
        let kind = Kind::from_str(name)?;
        let columns = self.commands.columns();
        let limits = &self.settings.experiment;
        let settings = experiment::Settings {
            inputs: inputs(&self.link, &self.settings, columns)?,
            push: signed(&self.settings.push, columns, "push", "push the boat ahead")?,
            turn: signed(&self.settings.turn, columns, "turn", "turn it to starboard")?,
            fence: self.fence().ok_or("there is no position yet: wait for the GNSS")?,
            max_speed_m_s: limits.max_speed_m_s,
            max_yaw_rate_rad_s: limits.max_yaw_rate_rad_s,
            duration_s: limits.duration_s,
            dt_s: STEP_S,
            seed: limits.seed,
            level: experiment::Settings::DEFAULT_LEVEL,
        };
        let explored = self.explored.as_ref().map_err(Clone::clone)?;
        let experiment = Box::new(Experiment::new(kind, settings, explored)?);
        self.check_fence()?;
        self.check_commands(now_ns)?;
        // The disk may take a while: the helm is taken afterwards.
        if self.recording.is_none() {
            self.record(now_ns);
        }
        self.begin_commands(now_ns)?;
        self.steering =
            Steering::Experiment { kind, experiment, next: f64::NEG_INFINITY, command: Vec::new() };
        let dry = if self.settings.is_dry_run { " as a dry run, without commands" } else { "" };
        self.say(now_ns, Level::Info, format!("the experiment {kind} begins{dry}"));
        Ok(format!("the experiment {kind} begins{dry}"))
    }

    /// A step of the experiment, if it is due.
    pub(super) fn experiment(&mut self, t: f64, now_ns: i64) {
        let Steering::Experiment { kind, experiment, next, command } = &mut self.steering else { return };
        if t < *next {
            return;
        }
        *next = if t - *next < STEP_S { *next + STEP_S } else { t + STEP_S };
        let Some(row) = self.motion.at(t) else { return };
        let [north, east, psi] = row.pose;
        let [u, v, r] = row.ground;
        let kind = *kind;
        let step = experiment.step(&Seen { t, north, east, psi, u, v, r });
        if let (Some([push_s, turn_s]), Ok(explored)) = (experiment.time_scales(), &mut self.explored) {
            explored.set_time_scales(push_s, turn_s);
        }
        match step {
            Step::Command(values) => {
                command.clone_from(&values);
                self.command(&values, now_ns);
            }
            Step::Done(text) => {
                self.hands_off(now_ns, Level::Info, &format!("the experiment {kind} is complete: {text}"));
            }
            Step::Abort(text) => {
                self.hands_off(now_ns, Level::Warning, &format!("the experiment {kind} was aborted: {text}"));
            }
        }
    }

    /// Sends a command in the units of the model.
    fn command(&mut self, values: &[f64], now_ns: i64) {
        let raw: Vec<f64> = self
            .commands
            .columns()
            .iter()
            .zip(values)
            .map(|(column, value)| column.source.raw(*value))
            .collect();
        self.link.command(&raw, now_ns);
        // A dry run sends nothing.
        let is_neutral = |(value, rest): (&f64, &f64)| (value - rest).abs() <= 1e-6 * (1.0 + rest.abs());
        let pushes = !self.settings.is_dry_run && !raw.iter().zip(&self.rest).all(is_neutral);
        let t = super::seconds(self.begun_ns, now_ns);
        self.pushing_since = pushes.then(|| self.pushing_since.unwrap_or(t));
    }

    pub(super) fn begin_steering(&mut self, now_ns: i64) -> Result<String, String> {
        self.check_free()?;
        let active = self.active.as_ref().ok_or("there is no model on board: identify and adopt one")?;
        self.check_commands(now_ns)?;
        let mut options = self.settings.control.clone();
        let by_model = options.controller != ControlMethod::Autopilot;
        options.adapt = active.is_learning && by_model;
        if options.controller == ControlMethod::CrossEntropy {
            // A plan that takes longer than a step is late; the best one so far is used.
            let half_step_ms = 500.0 * active.model.description.dt / self.settings.time_scale;
            options.plan_time.get_or_insert(half_step_ms);
        }
        let model = &active.model;
        let boat = find_roles(model);
        let values = input_values(model).map_err(|error| error.to_string())?;
        for column in self.commands.columns() {
            let name = &column.source.channel.name;
            let Some(value) = values.iter().find(|value| value.name == *name) else { continue };
            let own = axis(&self.link, &self.settings, column)?;
            // In the unit of the boat of the model. What an option states follows, and counts.
            let raw = |value: f64| boat.raw(&column.source.channel, value).map_err(|error| error.to_string());
            let is_weak = |property| value.weak().any(|weak| weak == property);
            if self.settings.limits.contains_key(name) || is_weak(Property::Limits) {
                let [a, b] = [raw(own.low)?, raw(own.high)?];
                let range = GivenRange { low: a.min(b), high: a.max(b), unit: None };
                options.limit.insert(0, (name.clone(), range));
            }
            if self.settings.neutral.contains_key(name) || is_weak(Property::Neutral) {
                options.neutral.insert(0, (name.clone(), raw(own.rest)?));
            }
        }
        let named = NamedModel { name: active.name.clone(), model: active.model.clone() };
        let (sender, receiver) = std::sync::mpsc::channel();
        let is_wanted = Arc::new(AtomicBool::new(true));
        let wanted = Arc::clone(&is_wanted);
        let mut go_on = move |_| {
            if wanted.load(Ordering::Relaxed) { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        std::thread::Builder::new()
            .name("controller".to_owned())
            .spawn(move || {
                let setup = Setup::new(options, Some(named), None).and_then(|mut setup| {
                    setup.check_firm()?;
                    setup.tune(&mut go_on)?;
                    Ok(Box::new(setup))
                });
                let _ = sender.send(setup.map_err(|error| chain(&error)));
            })
            .map_err(|error| format!("there is no thread for the controller: {error}"))?;
        self.steering = Steering::Preparing(Preparation { receiver, is_wanted });
        self.say(now_ns, Level::Info, "the controller is being prepared");
        Ok("the controller is being prepared; steering begins when it is ready".to_owned())
    }

    /// Begins to steer when the controller is ready.
    pub(super) fn poll_steering(&mut self, now_ns: i64) {
        let Steering::Preparing(Preparation { receiver, .. }) = &self.steering else { return };
        let setup = match receiver.try_recv() {
            Err(TryRecvError::Empty) => return,
            Err(TryRecvError::Disconnected) => Err("its preparation ended without a result".to_owned()),
            Ok(setup) => setup,
        };
        self.steering.end();
        if let Err(error) = setup.and_then(|setup| self.follow_path(&setup, now_ns)) {
            self.say(now_ns, Level::Error, format!("the controller cannot steer: {error}"));
        }
    }

    fn follow_path(&mut self, setup: &Setup, now_ns: i64) -> Result<(), String> {
        let (Some(fence), Some(link)) = (self.fence(), self.motion.origin_deg()) else {
            return Err("there is no position yet".to_owned());
        };
        let path: Vec<[f64; 2]> = points(&setup.scenario.track.path).collect();
        // Way-points on the chart have their own origin; other paths have their middle in that of the fence.
        let origin = if let Some(origin) = setup.origin_deg {
            let [n, e] = local_position(origin, link).ok_or("the way-points are not near the boat")?;
            [-n, -e]
        } else {
            let middle = [0, 1].map(|axis| {
                let of = path.iter().map(|point| point[axis]);
                0.5 * (of.clone().fold(f64::INFINITY, f64::min) + of.fold(f64::NEG_INFINITY, f64::max))
            });
            let [north, east] = fence.interior();
            [north - middle[0], east - middle[1]]
        };
        let path: Vec<[f64; 2]> = path.iter().map(|[n, e]| [n + origin[0], e + origin[1]]).collect();
        let active = self.active.as_mut().ok_or("there is no model on board")?;
        let border = fence.border(origin);
        let pilot = setup.pilot(active.follower().adapter(), Some(border)).map_err(|error| chain(&error))?;
        let pilot = pilot.of_estimates();
        self.check_fence()?;
        self.begin_commands(now_ns)?;
        let active = self.active.as_mut().ok_or("there is no model on board")?;
        active.steer(pilot, origin).map_err(|error| error.to_string())?;
        self.steering = Steering::Path(path);
        self.say(now_ns, Level::Info, "hydroid steers");
        Ok(())
    }

    /// Sends the command of the controller after a sample.
    pub(super) fn steer(&mut self, now_ns: i64) {
        let Steering::Path(_) = self.steering else { return };
        let Some(active) = &self.active else { return };
        let Some(pilot) = active.pilot() else { return };
        let (status, command) = (pilot.status(), pilot.command().to_vec());
        let stop = active.follower().why_stopped();
        let [n, e, _] = active.sample().pose;
        let at = [n + active.path_origin[0], e + active.path_origin[1]];
        let [u, v, r] = pilot.motion().map(|place| active.sample().outputs[place]);
        let limits = self.settings.experiment;
        let is_outside = self.fence().is_some_and(|fence| fence.margin(at[0], at[1]) < 0.0);
        if at.iter().chain(&[u, v, r]).any(|x| !x.is_finite()) {
            self.hands_off(now_ns, Level::Warning, "position or motion are not known");
        } else if is_outside {
            self.hands_off(now_ns, Level::Warning, "the boat is outside the geofence");
        } else if u.hypot(v) > limits.max_speed_m_s || r.abs() > limits.max_yaw_rate_rad_s {
            self.hands_off(
                now_ns,
                Level::Warning,
                &format!(
                    "the speed of {:.1} m/s or the yaw rate of {r:.2} rad/s is above its limit",
                    u.hypot(v)
                ),
            );
        } else if let Some(stop) = stop {
            self.hands_off(now_ns, Level::Warning, &stop);
        } else if status == "arrived" {
            self.hands_off(now_ns, Level::Info, "the end of the path is reached");
        } else {
            self.command(&command, now_ns);
        }
    }
}
