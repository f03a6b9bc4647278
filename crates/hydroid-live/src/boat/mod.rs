//! A session on board: what the autopilot reports, models that follow, experiments and steering.
//!
//! [`Boat`] is the session without input and output. It takes messages and actions with their times, and gives messages to
//! send and what there is to say; the same sequence gives the same results. [`Service`] joins it with a link and a page.
//!
//! | part | content |
//! | --- | --- |
//! | `settings` | [`Settings`] |
//! | `actions` | what the operator asks for |
//! | `position_check` | test of each position against the prediction |
//! | `on_board` | a model with its adapter along the samples |
//! | `steering` | experiments and paths as commands |
//! | `recording` | file and topics of a session |
//! | `view` | the state as JSON, for the page |
//! | `run` | threads, link, page |

mod actions;
mod on_board;
mod position_check;
mod recording;
mod run;
mod settings;
mod steering;
mod view;

use std::collections::VecDeque;
use std::path::PathBuf;
use std::str::FromStr as _;
use std::sync::mpsc::{Receiver, TryRecvError};

use hydroid::log::LogError;
use hydroid::model::Model;
use hydroid::plant::{InputMap, LEAST_SHARE};
use hydroid::recording::{LiveInputs, LiveMotion, LiveTopics};

use crate::experiment::Explored;
use crate::link::{Event, HelmEvent, Link, Row};
use on_board::OnBoard;
use position_check::PositionCheck;
use recording::Recording;
use steering::Steering;

pub use actions::Action;
pub use on_board::OnBoardError;
pub use run::{Identified, Identify, Open, Service, ServiceError};
pub use settings::{ExperimentLimits, Settings};
pub use view::{Level, Predicted};

/// Time between attempts to begin a planned experiment \[ns\].
const PLAN_NS: i64 = 1_000_000_000;

/// Messages that are kept for the view.
const SAID: usize = 200;

/// Something to say.
#[derive(Clone, Debug, PartialEq)]
pub struct Said {
    pub id: u64,
    /// Nanoseconds since 1970.
    pub at_ns: i64,
    pub level: Level,
    pub text: String,
}

/// A session on board.
pub struct Boat<L> {
    settings: Settings,
    begun_ns: i64,
    link: L,
    autopilot_name: Option<String>,
    state: Option<crate::link::State>,
    lost_since_ns: Option<i64>,
    topics: LiveTopics,
    motion: LiveMotion,
    position_check: Option<PositionCheck>,
    /// Whether it was said that the position has jumped.
    told_jump: bool,
    /// Whether it was said that the boat is outside of the geofence.
    told_outside: bool,
    /// Neutral commands of the inputs, as they are sent; empty if they are not known.
    rest: Vec<f64>,
    /// Time since which commands have not been neutral \[s\].
    pushing_since: Option<f64>,
    /// The latest time that was given.
    now_ns: i64,
    planned_ns: i64,
    commands: LiveInputs,
    explored: Result<Explored, String>,
    explored_to: f64,
    /// Mean delay of the rows of each topic \[ns\].
    delays_ns: Vec<f64>,
    /// An experiment that begins as soon as it may, and why it did not yet.
    planned: Option<(String, String)>,
    steering: Steering,
    active: Option<OnBoard>,
    previous: Option<OnBoard>,
    offered: Option<(OnBoard, String)>,
    identifying: Option<Receiver<Result<Identified, String>>>,
    identify: Option<Identify>,
    recording: Option<Recording>,
    recordings: Vec<PathBuf>,
    trouble: String,
    /// Messages that were left out.
    lost: u64,
    said: VecDeque<Said>,
    count: u64,
    /// Words of the last remark on a sample.
    remark: String,
}

/// Distance from the geofence at which a boat that has left it is inside again \[m\].
const INSIDE_M: f64 = 2.0;

/// A remark without its numbers: the same one with others is not news.
fn words(remark: &str) -> String {
    remark.chars().filter(|c| !c.is_ascii_digit()).collect()
}

/// A time of the session in seconds.
fn seconds(begun_ns: i64, at_ns: i64) -> f64 {
    at_ns.saturating_sub(begun_ns) as f64 / 1e9
}

impl<L: Link> Boat<L> {
    /// Before the first message; `now_ns` is in nanoseconds since 1970.
    pub fn new(settings: Settings, mut link: L, now_ns: i64) -> Result<Self, LogError> {
        let fields = |topic: &crate::link::Topic| topic.fields.iter().map(|field| (field.name, field.unit));
        let all = link.topics().iter();
        let topics = LiveTopics::new("the link", all.map(|topic| (topic.name, fields(topic))));
        let Some(sensors) = &settings.selection.sensors else {
            return Err(LogError::Unusable {
                path: "the settings".to_owned(),
                reason: "no sensors are named".to_owned(),
                remedy: "name them in the section [log.sensors], such as latitude = \"GPS_RAW_INT.lat\"; `hydroid live --print-config` writes an example".to_owned(),
            });
        };
        let motion = LiveMotion::new(&topics, sensors)?;
        let position_check = PositionCheck::new(&topics, sensors)?;
        let commands = LiveInputs::new(&topics, &settings.selection)?;
        steering::check_limits(&settings, commands.columns())?;
        let count = link.topics().len();
        let is_used = |topic: &usize| {
            motion.uses(*topic) || commands.columns().iter().any(|column| column.topic == *topic)
        };
        let used: Vec<usize> = (0..count).filter(is_used).collect();
        let axes = steering::axes(&link, &settings, commands.columns());
        let rest = axes.iter().flatten().map(|axis| axis.rest).collect();
        link.prepare(&used, axes);
        let explored = steering::explored(&link, &settings, commands.columns());
        Ok(Self {
            link,
            begun_ns: now_ns,
            autopilot_name: None,
            state: None,
            lost_since_ns: None,
            topics,
            motion,
            position_check,
            told_jump: false,
            told_outside: false,
            rest,
            pushing_since: None,
            now_ns,
            planned_ns: i64::MIN,
            commands,
            explored,
            explored_to: f64::NAN,
            delays_ns: vec![f64::NAN; count],
            planned: None,
            steering: Steering::Off,
            active: None,
            previous: None,
            offered: None,
            identifying: None,
            identify: None,
            recording: None,
            recordings: Vec::new(),
            trouble: String::new(),
            lost: 0,
            said: VecDeque::new(),
            count: 0,
            remark: String::new(),
            settings,
        })
    }

    /// What identifies a model from recordings when the operator asks for it.
    pub fn identify_by(&mut self, identify: Identify) {
        self.identify = Some(identify);
    }

    /// Takes a model on board from now on.
    pub fn take_on(&mut self, name: &str, model: &Model) -> Result<(), OnBoardError> {
        let on_board = OnBoard::new(name, model, &self.topics, &self.settings.horizons_s)?;
        self.check_inputs(&on_board)?;
        self.activate(on_board)?;
        Ok(())
    }

    /// The commands of a model must be those of the settings: the helm is made for them.
    fn check_inputs(&self, on_board: &OnBoard) -> Result<(), LogError> {
        // Name, and values at zero and one: column, offset and factor.
        let described = |columns: &[hydroid::recording::LiveColumn]| {
            let of = |column: &hydroid::recording::LiveColumn| {
                let [zero, one] = [0.0, 1.0].map(|value| column.source.raw(value));
                let name = &column.source.channel.name;
                format!("{name} ({} from {zero} for 0 to {one} for 1)", column.name)
            };
            columns.iter().map(of).collect::<Vec<_>>().join(", ")
        };
        let (own, of) = (described(self.commands.columns()), described(on_board.commands()));
        if own == of {
            return Ok(());
        }
        Err(LogError::Unusable {
            path: on_board.name.clone(),
            reason: format!("its inputs are {of}, and those of the settings {own}"),
            remedy: "write the inputs in the section [log] as they were when the model was identified"
                .to_owned(),
        })
    }

    fn activate(&mut self, on_board: OnBoard) -> Result<(), LogError> {
        if let Some(sensors) = on_board.sensors() {
            self.motion.change_sensors(&self.topics, sensors)?;
            self.position_check = PositionCheck::new(&self.topics, sensors)?;
        }
        self.take_roles(&on_board.model);
        self.previous = self.active.replace(on_board);
        self.update_learning();
        Ok(())
    }

    /// Inputs push and turn the boat as the model knows, unless the settings state it. Experiments need no small shares, such as
    /// that of a bow thruster which holds the course while two propellers push.
    fn take_roles(&mut self, model: &Model) {
        let (push, turn) = (&self.settings.push, &self.settings.turn);
        if !push.is_empty() && !turn.is_empty() {
            return;
        }
        let Ok(map) = InputMap::with(model, push, turn) else { return };
        let names = |shares: &[f64]| {
            let least = LEAST_SHARE * shares.iter().fold(0.0_f64, |most, share| most.max(share.abs()));
            let share = |(name, share): (&String, &f64)| match *share {
                share if share > least => Some(name.clone()),
                share if share < -least => Some(format!("-{name}")),
                _ => None,
            };
            map.names.iter().zip(shares).filter_map(share).collect()
        };
        (self.settings.push, self.settings.turn) = (names(&map.push), names(&map.turn));
        self.explored = steering::explored(&self.link, &self.settings, self.commands.columns());
    }

    /// Says something to the crew, and records it.
    fn say(&mut self, at_ns: i64, level: Level, text: impl Into<String>) {
        let text = text.into();
        if let Some(recording) = &self.recording {
            recording.event(at_ns, &text);
        }
        self.count += 1;
        self.said.push_back(Said { id: self.count, at_ns, level, text });
        if self.said.len() > SAID {
            self.said.pop_front();
        }
    }

    /// What was said after a number.
    pub fn said_after(&self, id: u64) -> impl Iterator<Item = &Said> {
        self.said.iter().filter(move |said| said.id > id)
    }

    /// Takes a message of the link. True if a model has a new sample.
    pub fn receive(&mut self, message: &L::Message, received_ns: i64) -> bool {
        // A message that was received before the last tick and taken after it does not turn the time back.
        self.now_ns = self.now_ns.max(received_ns);
        let mut events = Vec::new();
        self.link.receive(message, received_ns, self.now_ns, &mut |event| events.push(event));
        let mut followed = false;
        for event in events {
            followed |= self.take(event, self.now_ns);
        }
        self.hear_helm(self.now_ns, Level::Warning);
        followed
    }

    fn take(&mut self, event: Event, now_ns: i64) -> bool {
        match event {
            Event::Row(row) => return self.row(&row),
            Event::Message { topic, sent_ns, received_ns, bytes } => {
                if let Some(recording) = &self.recording {
                    recording.message(topic, received_ns, sent_ns, bytes);
                }
            }
            Event::Found(name) => {
                self.say(now_ns, Level::Info, format!("found {name}"));
                self.autopilot_name = Some(name);
                if self.settings.records {
                    self.record(now_ns);
                }
            }
            Event::State(state) => {
                let armed = if state.armed { "armed" } else { "disarmed" };
                self.say(now_ns, Level::Info, format!("mode {}, {armed}", state.mode));
                self.state = Some(state);
                self.update_learning();
                self.end_preparation(now_ns);
            }
            Event::Text { warning, text } => {
                let level = if warning { Level::Warning } else { Level::Info };
                self.say(now_ns, level, format!("autopilot: {text}"));
            }
            Event::Lost(for_s) => {
                self.lost_since_ns = Some(now_ns);
                self.say(now_ns, Level::Warning, format!("no heartbeat for {for_s:.0} s: the link is lost"));
                self.end_preparation(now_ns);
            }
            Event::Back => {
                self.lost_since_ns = None;
                self.say(now_ns, Level::Info, "the link is back");
            }
            Event::Restarted => {
                self.say(now_ns, Level::Warning, "the autopilot has started again");
                self.end_preparation(now_ns);
            }
        }
        false
    }

    fn row(&mut self, row: &Row) -> bool {
        let Row { topic, sent_ns, received_ns, values } = row;
        let (topic, now_ns) = (*topic, self.now_ns.max(*received_ns));
        if let Some(recording) = &self.recording {
            recording.row(topic, *received_ns, *sent_ns, values);
        }
        let delay = received_ns.saturating_sub(*sent_ns) as f64;
        let mean = &mut self.delays_ns[topic];
        *mean = if mean.is_nan() { delay } else { *mean + 0.05 * (delay - *mean) };
        let t = seconds(self.begun_ns, *sent_ns);
        let is_measured = self.motion.uses(topic);
        let mut followed = false;
        if let Some(active) = &mut self.active {
            followed = active.row(topic, t, values, &self.motion, is_measured);
        }
        let waiting = self.offered.iter_mut().map(|(offered, _)| offered).chain(&mut self.previous);
        for on_board in waiting {
            on_board.row(topic, t, values, &self.motion, is_measured);
        }
        self.commands.row(topic, t, values);
        if is_measured {
            let position_check = self.position_check.as_mut();
            let other = position_check.and_then(|check| check.test(topic, t, values, &self.motion));
            self.motion.row(topic, t, other.as_deref().unwrap_or(values));
            self.explore(t);
            self.experiment(t, now_ns);
        }
        if followed {
            self.followed(now_ns);
        }
        followed
    }

    /// The model on board learns if it is to, and if the inputs act.
    fn update_learning(&mut self) {
        let acts = self.inputs_act();
        for on_board in self.active.iter_mut().chain(self.offered.iter_mut().map(|(model, _)| model)) {
            on_board.set_acting(acts);
        }
    }

    /// The conditions have changed while a controller was prepared: the operator decides again.
    fn end_preparation(&mut self, now_ns: i64) {
        if matches!(self.steering, Steering::Preparing(_)) {
            self.hands_off(
                now_ns,
                Level::Warning,
                "the state of the autopilot has changed while the controller was being prepared",
            );
        }
    }

    /// What was commanded so far.
    fn explore(&mut self, t: f64) {
        if !self.inputs_act() {
            self.explored_to = f64::NAN;
            return;
        }
        let dt = t - self.explored_to;
        if dt.is_nan() {
            self.explored_to = t;
        } else if dt >= 0.1 {
            self.explored_to = t;
            if let Ok(explored) = &mut self.explored
                && dt < 1.0
            {
                explored.see(dt, self.commands.held());
            }
        }
    }

    /// Steers after a sample of the active model, and records its estimate and prediction.
    fn followed(&mut self, now_ns: i64) {
        self.steer(now_ns);
        let Some(active) = &self.active else { return };
        let note = active.note().to_owned();
        let sample = active.sample();
        let at_ns = self.at_ns(sample.t);
        if let Some(recording) = &self.recording {
            if let Some(row) = self.motion.at(sample.t) {
                let values = row.pose.into_iter().chain(row.ground).chain(row.ground_deviation).collect();
                recording.estimate(now_ns, at_ns, values);
            }
            let (poses, deviations) = active.follower().track();
            if let (Some(pose), Some(deviation), Some(horizon)) =
                (poses.last(), deviations.last(), active.horizons.last())
            {
                let seconds = *horizon as f64 * active.model.description.dt;
                let [north, east] = active.path_origin;
                let pose = [pose[0] + north, pose[1] + east, pose[2]];
                let values = std::iter::once(seconds).chain(pose).chain(*deviation).collect();
                recording.prediction(now_ns, at_ns, values);
            }
        }
        let words = words(&note);
        if !note.is_empty() && words != self.remark {
            self.say(now_ns, Level::Info, note);
        }
        self.remark = words;
    }

    fn at_ns(&self, t: f64) -> i64 {
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let ns = (t * 1e9) as i64;
        self.begun_ns.saturating_add(ns)
    }

    /// Does what is due, and gives what is to be sent. Call it at 50 Hz or more.
    pub fn tick(&mut self, now_ns: i64, mut send: impl FnMut(L::Message)) {
        self.now_ns = self.now_ns.max(now_ns);
        let now_ns = self.now_ns;
        let mut events = Vec::new();
        self.link.tick(now_ns, &mut send, &mut |event| events.push(event));
        for event in events {
            self.take(event, now_ns);
        }
        self.watch(now_ns);
        self.poll(now_ns);
        self.link.tick_helm(now_ns, &mut send);
        self.hear_helm(now_ns, Level::Warning);
    }

    /// Watches what no message tells: missing measurements, and the disk.
    fn watch(&mut self, now_ns: i64) {
        self.begin_planned(now_ns);
        let is_located = self.is_located(now_ns);
        let jump_m = self.jump_m().filter(|_| !is_located);
        let stuck_s = self.pushing_since.and_then(|since| self.position_check.as_ref()?.stuck_s(since));
        if let Some(stuck_s) = stuck_s.filter(|_| self.is_commanding()) {
            let reason = format!(
                "the position has not changed for {stuck_s:.0} s under command: check the GNSS receiver, and switch a static hold off"
            );
            self.hands_off(now_ns, Level::Warning, &reason);
        } else if self.is_commanding() && !is_located {
            let max_age_s = self.settings.control.max_age.map(|age| age.0);
            let reason = if let Some(distance) = jump_m {
                format!("the position jumps by {distance:.0} m")
            } else if self.motion.is_contradicted(max_age_s) {
                "the heading does not turn as the yaw rate says: check compass and gyro".to_owned()
            } else {
                "there is no position or no heading any more".to_owned()
            };
            self.hands_off(now_ns, Level::Warning, &reason);
        }
        self.tell_jump(now_ns, jump_m);
        if is_located {
            self.tell_outside(now_ns);
        }
        let Some(recording) = &self.recording else { return };
        let health = recording.health();
        let slow = "the disk is too slow".to_owned();
        let trouble =
            if health.trouble.is_empty() && health.lost > self.lost { slow } else { health.trouble };
        self.lost = health.lost;
        if trouble != self.trouble {
            if trouble.is_empty() {
                self.say(now_ns, Level::Info, "the recording goes on");
            } else {
                let text =
                    format!("the recording has trouble: {trouble}; messages are left out until it ends");
                self.say(now_ns, Level::Error, text);
            }
            self.trouble = trouble;
        }
    }

    /// Says that the position has jumped, or that it is used again.
    fn tell_jump(&mut self, now_ns: i64, jump_m: Option<f64>) {
        if self.told_jump == jump_m.is_some() {
            return;
        }
        self.told_jump = jump_m.is_some();
        match jump_m {
            Some(distance) => self.say(
                now_ns,
                Level::Warning,
                format!("the position is {distance:.0} m from where speed and heading have led: check the GNSS receiver"),
            ),
            None => self.say(now_ns, Level::Info, "the position agrees with speed and heading again"),
        }
    }

    /// Says that the boat has left the geofence, or is inside again, whoever steers it.
    fn tell_outside(&mut self, now_ns: i64) {
        let Some([margin, _]) = self.margin() else { return };
        // Noise at the fence is no news.
        let is_outside = margin < if self.told_outside { INSIDE_M } else { 0.0 };
        if self.told_outside == is_outside {
            return;
        }
        self.told_outside = is_outside;
        if is_outside {
            self.say(now_ns, Level::Error, "the boat is outside of the geofence");
        } else {
            self.say(now_ns, Level::Info, "the boat is inside the geofence again");
        }
    }

    /// Distance of the last position from the prediction \[m\], if it has jumped.
    fn jump_m(&self) -> Option<f64> {
        Some(self.position_check.as_ref()?.jump()?.distance)
    }

    /// Whether position and heading are measured at present.
    fn is_located(&self, now_ns: i64) -> bool {
        let t = seconds(self.begun_ns, now_ns);
        let jump = self.position_check.as_ref().and_then(PositionCheck::jump);
        let max_age_s = self.settings.control.max_age.map(|age| age.0);
        self.motion.is_fresh(t, max_age_s, jump.map(|jump| jump.since))
    }

    /// Whether the inputs act on the vessel: it is armed, and in the mode in which its commands are inputs.
    fn inputs_act(&self) -> bool {
        let required = self.link.required_mode();
        self.state
            .as_ref()
            .is_some_and(|state| state.armed && required.is_none_or(|required| state.mode == required))
    }

    /// Begins an experiment as soon as it may.
    pub fn plan_experiment(&mut self, name: &str) -> Result<(), String> {
        crate::experiment::Kind::from_str(name)?;
        self.planned = Some((name.to_owned(), String::new()));
        Ok(())
    }

    /// Tries to begin the planned experiment.
    fn begin_planned(&mut self, now_ns: i64) {
        let Some((name, told)) = &self.planned else { return };
        if now_ns.saturating_sub(self.planned_ns) < PLAN_NS {
            return;
        }
        self.planned_ns = now_ns;
        let (name, told) = (name.clone(), told.clone());
        match self.begin_experiment(&name, now_ns) {
            Ok(_) => self.planned = None,
            Err(why) => {
                let words = words(&why);
                if words != told {
                    self.say(now_ns, Level::Info, format!("the experiment {name} waits: {why}"));
                    self.planned = Some((name, words));
                }
            }
        }
    }

    /// Takes the results of threads.
    fn poll(&mut self, now_ns: i64) {
        self.poll_steering(now_ns);
        let Some(receiver) = &self.identifying else { return };
        let result = match receiver.try_recv() {
            Err(TryRecvError::Empty) => return,
            Err(TryRecvError::Disconnected) => Err("it ended without a result".to_owned()),
            Ok(result) => result,
        };
        self.identifying = None;
        let offered = result.and_then(|Identified { name, model, text }| {
            let on_board = OnBoard::new(&name, &model, &self.topics, &self.settings.horizons_s)
                .map_err(|error| error.to_string())?;
            self.check_inputs(&on_board).map_err(|error| error.to_string())?;
            Ok((on_board, text))
        });
        match offered {
            Ok(offered) => {
                let text = format!(
                    "{} was identified: {}; adopt it if its errors are smaller",
                    offered.0.name, offered.1
                );
                self.offered = Some(offered);
                self.update_learning();
                self.say(now_ns, Level::Info, text);
            }
            Err(error) => self.say(now_ns, Level::Error, format!("no model was identified: {error}")),
        }
    }

    /// Takes the events of the helm. `level` is that of hands off: a warning, unless it was asked for.
    fn hear_helm(&mut self, now_ns: i64, level: Level) {
        while let Some(event) = self.link.take_event() {
            match event {
                HelmEvent::Sent(row) => {
                    self.row(&row);
                }
                HelmEvent::HandsOff(reason) => {
                    self.steering.end();
                    self.pushing_since = None;
                    if let Some(active) = &mut self.active {
                        active.release();
                    }
                    self.say(now_ns, level, format!("hands off: {reason}"));
                }
            }
        }
    }

    /// Begins a recording.
    fn record(&mut self, now_ns: i64) {
        if self.recording.is_some() {
            return;
        }
        match Recording::begin(&self.settings.folder, self.link.topics(), now_ns) {
            Ok(recording) => {
                let text = format!("recording {}", recording.path().display());
                self.recordings.push(recording.path().to_owned());
                self.recording = Some(recording);
                self.say(now_ns, Level::Info, text);
            }
            Err(error) => {
                let text =
                    format!("a recording cannot be written to {}: {error}", self.settings.folder.display());
                self.say(now_ns, Level::Error, text);
            }
        }
    }

    fn stop_recording(&mut self, now_ns: i64) {
        let Some(recording) = self.recording.take() else { return };
        let path = recording.path().display().to_string();
        match recording.finish() {
            Ok(()) => self.say(now_ns, Level::Info, format!("{path} is complete")),
            Err(error) => {
                self.say(now_ns, Level::Warning, format!("{path} has no end, and can be read: {error}"));
            }
        }
    }

    /// Ends commands. [`tick`](Self::tick) must still send the release.
    pub fn release(&mut self, now_ns: i64) {
        self.hands_off(self.now_ns.max(now_ns), Level::Info, "hydroid ends");
    }

    /// Closes the recording, which may wait for the disk.
    pub fn close(&mut self, now_ns: i64) {
        self.stop_recording(now_ns);
    }

    /// Whether the link is lost.
    pub fn is_lost(&self) -> bool {
        self.lost_since_ns.is_some()
    }
}
