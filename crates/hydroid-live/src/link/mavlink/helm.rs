//! Commands to ArduPilot Rover, with the checks before the first one and the causes that end them.
//!
//! A command is the inverse of the column from which an input of the model is read: pulses of channels by
//! `RC_CHANNELS_OVERRIDE` in mode MANUAL, or surge speed and yaw rate by `SET_POSITION_TARGET_LOCAL_NED` in mode GUIDED.
//! The autopilot acknowledges neither of them, and drops them without a word if it does not accept their sender.
//! Therefore [`Helm::refusals`] judges its parameters and state beforehand, and the pulses that `RC_CHANNELS` reports are
//! compared with those that were sent.
//!
//! [`Helm`] has no input and output, and no clock. What [`receive`](Helm::receive), [`command`](Helm::command) and
//! [`release`](Helm::release) decide is sent by the next [`tick`](Helm::tick): call it after each of them, and at least 20
//! times per second.

mod axis;
mod parameters;
mod preflight;

use std::collections::VecDeque;

use ::mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, EkfStatusFlags, HEARTBEAT_DATA, MavAutopilot, MavCmd, MavMessage, MavModeFlag,
    MavParamError, MavState, MavType, PARAM_REQUEST_READ_DATA, RC_CHANNELS_DATA,
};
use ::mavlink::{MavHeader, Message as _};

pub use self::axis::{Axis, Target};
use self::axis::{CHANNELS, Kind, LEAVE, checked, override_message, pulses, releases, set_point_message};
use self::parameters::Parameters;
use super::topics::{TOPICS, row};
use crate::link::{HelmEvent as Event, Row};

/// Milliseconds in nanoseconds.
const MS: i64 = 1_000_000;

/// A command that does not change is sent again after this time: at 10 Hz if there are 20 ticks per second.
const REPEAT_NS: i64 = 80 * MS;

/// Without a new command for this time, the neutral command is sent.
const NEUTRAL_NS: i64 = 1_000 * MS;

/// Without a new command for this time, commands end.
const SILENT_NS: i64 = 2_000 * MS;

/// `RC_CHANNELS` is compared with the commands of this time. Pulses that are none of them for as long end the commands.
const ECHO_NS: i64 = 500 * MS;

/// Time between the steps of a release. The autopilot reads its channels at 50 Hz.
const STEP_NS: i64 = 100 * MS;

/// Steps of a release with the neutral command. Without a receiver, a channel that is released holds the last pulse that
/// the autopilot has read: it must have read a neutral one.
const NEUTRAL_STEPS: usize = 3;

/// Steps of a release.
const STEPS: usize = NEUTRAL_STEPS + 2;

/// Time between requests of the origin of the position filter.
const ORIGIN_NS: i64 = 2_000 * MS;

/// The autopilot has started again if its clock goes back by more \[ms\].
const RESTART_MS: u32 = 2_000;

/// The clock of this computer was set if it goes back by more.
const CLOCK_BACK_NS: i64 = 100 * MS;

/// Options of commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Own system id.
    pub own_system: u8,
    /// Whether the operator allows commands.
    pub is_allowed: bool,
    /// Whether commands are computed only.
    pub is_dry_run: bool,
}

/// Whether commands are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// No, except for the end of a release.
    Off,
    /// Yes.
    Commanding,
}

/// The autopilot, from its last heartbeat.
#[derive(Clone, Copy, Debug)]
struct Vehicle {
    system: u32,
    component: u8,
    family: MavAutopilot,
    mavtype: MavType,
    mode: u32,
    is_armed: bool,
    status: MavState,
}

/// Commands that are being sent.
#[derive(Clone, Debug)]
struct Stream {
    /// A value for each axis, within its limits.
    values: Vec<f64>,
    began_ns: i64,
    commanded_ns: i64,
    sent_ns: Option<i64>,
    is_changed: bool,
    /// Pulses that were sent within [`ECHO_NS`], of all channels.
    pulses: VecDeque<(i64, [u16; CHANNELS])>,
    /// Time of reports without our pulses, minus a quarter of the time with them: another program may send in turn.
    foreign_ns: i64,
}

#[derive(Clone, Debug)]
enum Phase {
    Off,
    Commanding(Stream),
    /// The next step of a release, the time of the last one, and the channels that become neutral before.
    Releasing {
        step: usize,
        sent_ns: Option<i64>,
        neutral: [bool; CHANNELS],
    },
}

/// Commands to an autopilot.
#[derive(Clone, Debug)]
pub struct Helm {
    axes: Vec<Axis>,
    options: Options,
    kind: Kind,
    phase: Phase,
    now_ns: i64,
    vehicle: Option<Vehicle>,
    heartbeat_ns: Option<i64>,
    message_ns: Option<i64>,
    /// Newest time of the autopilot since its start.
    boot_ms: u32,
    /// Pulses of the channels, whether there is a receiver, and time of the report.
    channels: Option<([u16; CHANNELS], bool, i64)>,
    /// State of the position filter, and time of the report.
    filter: Option<(EkfStatusFlags, i64)>,
    has_origin: bool,
    origin_asked_ns: Option<i64>,
    parameters: Parameters,
    /// What the autopilot says about arming.
    arming: String,
    events: VecDeque<Event>,
}

impl Helm {
    /// Before the first message.
    ///
    /// # Errors
    /// If the axes do not fit together, or their limits cannot be.
    pub fn new(axes: Vec<Axis>, options: Options) -> Result<Self, String> {
        Self::asking(axes, options, &[Vec::new(), Vec::new()])
    }

    /// As [`new`](Self::new), and asks for other parameters: those that all releases have, and those that some do not have.
    pub(super) fn asking(
        mut axes: Vec<Axis>,
        options: Options,
        others: &[Vec<String>; 2],
    ) -> Result<Self, String> {
        let kind = checked(&mut axes)?;
        Ok(Self {
            parameters: Parameters::new(&axes, kind, others),
            axes,
            options,
            kind,
            phase: Phase::Off,
            now_ns: i64::MIN,
            vehicle: None,
            heartbeat_ns: None,
            message_ns: None,
            boot_ms: 0,
            channels: None,
            filter: None,
            has_origin: false,
            origin_asked_ns: None,
            arming: String::new(),
            events: VecDeque::new(),
        })
    }

    /// The value of a parameter that was asked for.
    pub(super) fn parameter(&self, name: &str) -> Option<f64> {
        self.parameters.value(name)
    }

    /// Topics that the checks need, with rates \[Hz\], to be added to those of the link.
    pub fn rates(&self) -> Vec<(usize, f64)> {
        let needed: &[_] = match self.kind {
            Kind::Overrides => &[("RC_CHANNELS", 10.0), ("EKF_STATUS_REPORT", 2.0)],
            Kind::SetPoints => &[("EKF_STATUS_REPORT", 2.0)],
        };
        let index = |name| TOPICS.iter().position(|topic| topic.name == name);
        needed.iter().filter_map(|&(name, rate)| index(name).map(|topic| (topic, rate))).collect()
    }

    /// Name of the mode in which the autopilot takes the commands.
    pub fn required_mode(&self) -> &'static str {
        if self.kind == Kind::Overrides { "MANUAL" } else { "GUIDED" }
    }

    fn required_mode_number(&self) -> u32 {
        if self.kind == Kind::Overrides { 0 } else { 15 }
    }

    /// Whether the autopilot is in another mode than commands need.
    fn is_other_mode(&self) -> bool {
        self.vehicle.as_ref().is_some_and(|vehicle| vehicle.mode != self.required_mode_number())
    }

    /// Whether a pilot has changed the mode, who steers at once. Without a receiver, a channel holds its last pulse.
    fn is_piloted(&self) -> bool {
        self.is_other_mode() && self.channels.is_some_and(|(_, has_receiver, _)| has_receiver)
    }

    /// Whether commands are sent.
    pub fn state(&self) -> State {
        if matches!(self.phase, Phase::Commanding(_)) { State::Commanding } else { State::Off }
    }

    /// The next event. Take all of them.
    pub fn take_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// Takes a message of the autopilot of the link.
    pub fn receive(&mut self, header: MavHeader, message: &MavMessage, now_ns: i64) {
        self.advance(now_ns);
        if let MavMessage::HEARTBEAT(beat) = message
            && beat.autopilot != MavAutopilot::MAV_AUTOPILOT_INVALID
        {
            self.vehicle.get_or_insert(Vehicle::new(header, beat));
        }
        let Some(vehicle) = &self.vehicle else { return };
        if (header.system_id, header.component_id) != (vehicle.system, vehicle.component) {
            return;
        }
        self.message_ns = Some(now_ns);
        if let Some(boot_ms) = boot_ms(message) {
            if boot_ms.saturating_add(RESTART_MS) < self.boot_ms {
                self.restart();
            }
            self.boot_ms = self.boot_ms.max(boot_ms);
        }
        match message {
            MavMessage::HEARTBEAT(beat) => {
                let vehicle = Vehicle::new(header, beat);
                if vehicle.is_armed {
                    self.arming.clear();
                }
                self.vehicle = Some(vehicle);
                self.heartbeat_ns = Some(now_ns);
            }
            MavMessage::PARAM_VALUE(answer) => {
                let name = answer.param_id.to_str().unwrap_or_default();
                self.parameters.answer(name, Some(answer.param_value.into()));
            }
            MavMessage::PARAM_ERROR(answer)
                if answer.error == MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST =>
            {
                self.parameters.answer(answer.param_id.to_str().unwrap_or_default(), None);
            }
            MavMessage::RC_CHANNELS(report) => self.check_echo(report),
            MavMessage::EKF_STATUS_REPORT(report) => self.filter = Some((report.flags, now_ns)),
            // Both are sent only when there is an origin.
            MavMessage::GPS_GLOBAL_ORIGIN(_) | MavMessage::LOCAL_POSITION_NED(_) => self.has_origin = true,
            MavMessage::STATUSTEXT(said) => self.receive_text(said.text.to_str().unwrap_or_default()),
            _ => {}
        }
        self.watch();
    }

    /// Begins with the neutral command.
    ///
    /// # Errors
    /// If there are [`refusals`](Self::refusals).
    pub fn begin(&mut self, now_ns: i64) -> Result<(), Vec<String>> {
        self.advance(now_ns);
        self.watch();
        if self.state() == State::Commanding {
            return Ok(());
        }
        let refusals = self.refusals(now_ns);
        if !refusals.is_empty() {
            return Err(refusals);
        }
        self.phase = Phase::Commanding(Stream {
            values: self.axes.iter().map(|axis| axis.rest).collect(),
            began_ns: now_ns,
            commanded_ns: now_ns,
            sent_ns: None,
            is_changed: true,
            pulses: VecDeque::new(),
            foreign_ns: 0,
        });
        Ok(())
    }

    /// Takes a command: a raw value for each axis. Values beyond the limits become the limits; those that are not finite,
    /// and missing ones, become the neutral command. Without [`begin`](Self::begin), nothing is done.
    pub fn command(&mut self, values: &[f64], now_ns: i64) {
        self.advance(now_ns);
        // A pause that ends the commands does so although a command follows.
        self.watch();
        if let Phase::Commanding(stream) = &mut self.phase {
            stream.commanded_ns = now_ns;
            let axes = self.axes.iter().enumerate();
            stream.set(axes.map(|(index, axis)| axis.limited(values.get(index).copied())));
        }
    }

    /// Ends the commands: neutral, then released. The ticks of the next half second send it: a program that ends must wait.
    pub fn release(&mut self, now_ns: i64, reason: &str) {
        self.advance(now_ns);
        self.hand_off(reason.to_owned(), [true; CHANNELS]);
    }

    /// Sends what is due: questions, and the command or its release.
    pub fn tick(&mut self, now_ns: i64, mut send: impl FnMut(MavMessage)) {
        self.advance(now_ns);
        self.watch();
        self.ask(&mut send);
        let Some(message) = self.due_command() else { return };
        let mut values = Vec::new();
        if let Some((topic, _)) = row(&message, &mut values) {
            self.events.push_back(Event::Sent(Row { topic, sent_ns: now_ns, received_ns: now_ns, values }));
        }
        send(message);
    }

    /// The command or the step of a release that is due.
    fn due_command(&mut self) -> Option<MavMessage> {
        let (vehicle, now_ns, is_piloted) = (self.vehicle?, self.now_ns, self.is_piloted());
        match &mut self.phase {
            Phase::Off => None,
            Phase::Commanding(stream) => {
                if !stream.is_changed && !is_due(stream.sent_ns, REPEAT_NS, now_ns) {
                    return None;
                }
                (stream.is_changed, stream.sent_ns) = (false, Some(now_ns));
                let value = |index: usize| stream.values[index];
                if self.kind == Kind::SetPoints {
                    return Some(set_point_message(vehicle.address(), &self.axes, value));
                }
                let pulses = pulses(&self.axes, value);
                stream.pulses.push_back((now_ns, pulses));
                Some(override_message(vehicle.address(), pulses))
            }
            Phase::Releasing { .. } if self.kind == Kind::SetPoints => {
                self.phase = Phase::Off;
                // In another mode it would not be for us: a part of AUTO takes set-points, too.
                (vehicle.mode == self.required_mode_number())
                    .then(|| set_point_message(vehicle.address(), &self.axes, |_| 0.0))
            }
            Phase::Releasing { step, sent_ns, neutral } => {
                if !is_due(*sent_ns, STEP_NS, now_ns) {
                    return None;
                }
                // The mode may change during a release that began for another reason.
                if is_piloted {
                    *step = (*step).max(NEUTRAL_STEPS);
                }
                let mut pulses = if *step < NEUTRAL_STEPS {
                    pulses(&self.axes, |index| self.axes[index].rest)
                } else {
                    releases(&self.axes)
                };
                if *step < NEUTRAL_STEPS {
                    for (pulse, _) in pulses.iter_mut().zip(neutral).filter(|(_, is_neutral)| !**is_neutral) {
                        *pulse = LEAVE;
                    }
                }
                (*step, *sent_ns) = (*step + 1, Some(now_ns));
                if *step == STEPS {
                    self.phase = Phase::Off;
                }
                Some(override_message(vehicle.address(), pulses))
            }
        }
    }

    /// Asks for the next parameter, and for the origin.
    fn ask(&mut self, send: &mut impl FnMut(MavMessage)) {
        let now_ns = self.now_ns;
        let Some(vehicle) = self.vehicle.filter(|_| self.is_alive(now_ns)) else { return };
        let (target_system, target_component) = vehicle.address();
        if let Some(name) = self.parameters.question(now_ns) {
            send(MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
                param_index: -1,
                target_system,
                target_component,
                param_id: name.into(),
            }));
        }
        if self.kind == Kind::SetPoints && !self.has_origin && is_due(self.origin_asked_ns, ORIGIN_NS, now_ns)
        {
            self.origin_asked_ns = Some(now_ns);
            let id = MavMessage::message_id_from_name("GPS_GLOBAL_ORIGIN").unwrap_or_default();
            send(MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
                command: MavCmd::MAV_CMD_REQUEST_MESSAGE,
                param1: id as f32,
                target_system,
                target_component,
                ..COMMAND_LONG_DATA::DEFAULT
            }));
        }
    }

    /// Takes the time. If it has gone back, ages are not known.
    fn advance(&mut self, now_ns: i64) {
        if now_ns.saturating_add(CLOCK_BACK_NS) < self.now_ns {
            self.hand_off("the clock of this computer has gone back".to_owned(), [true; CHANNELS]);
            (self.heartbeat_ns, self.message_ns, self.channels, self.filter) = (None, None, None, None);
            self.parameters.forget_question();
            self.origin_asked_ns = None;
            if let Phase::Releasing { sent_ns, .. } = &mut self.phase {
                *sent_ns = None;
            }
        }
        self.now_ns = now_ns;
    }

    /// The autopilot has started again: what is known of it is no longer so.
    fn restart(&mut self) {
        self.hand_off("the autopilot has started again".to_owned(), [true; CHANNELS]);
        (self.boot_ms, self.has_origin, self.origin_asked_ns) = (0, false, None);
        (self.heartbeat_ns, self.channels, self.filter) = (None, None, None);
        self.parameters.forget();
        self.arming.clear();
    }

    /// Ends the commands. Channels that are not ours any more are released without a neutral pulse.
    fn hand_off(&mut self, reason: String, neutral: [bool; CHANNELS]) {
        if self.state() == State::Commanding {
            let step = if neutral.contains(&true) { 0 } else { NEUTRAL_STEPS };
            self.phase = Phase::Releasing { step, sent_ns: None, neutral };
            self.events.push_back(Event::HandsOff(reason));
        }
    }

    /// Ends the commands if a condition is not met, or if no new ones come.
    fn watch(&mut self) {
        let Phase::Commanding(stream) = &mut self.phase else { return };
        let age = self.now_ns.saturating_sub(stream.commanded_ns);
        if age > NEUTRAL_NS {
            stream.set(self.axes.iter().map(|axis| axis.rest));
        }
        let reason = if age > SILENT_NS {
            Some(format!("there has been no new command for {:.1} s", seconds(age)))
        } else {
            // The cause without its remedy: who has taken over knows what to do.
            let unmet = self.unmet(self.now_ns).into_iter().next();
            unmet.map(|unmet| unmet.rsplit_once(": ").map_or(unmet.as_str(), |(cause, _)| cause).to_owned())
        };
        if let Some(reason) = reason {
            let is_piloted = self.is_piloted();
            self.hand_off(reason, [!is_piloted; CHANNELS]);
        }
    }

    /// Compares the pulses that the autopilot reports with those that were sent.
    fn check_echo(&mut self, report: &RC_CHANNELS_DATA) {
        let shown = [
            report.chan1_raw,
            report.chan2_raw,
            report.chan3_raw,
            report.chan4_raw,
            report.chan5_raw,
            report.chan6_raw,
            report.chan7_raw,
            report.chan8_raw,
        ];
        let now_ns = self.now_ns;
        let last = self.channels.replace((shown, report.chancount > 0, now_ns));
        let Phase::Commanding(stream) = &mut self.phase else { return };
        // The newest command counts, however old it is.
        while stream.pulses.len() > 1 && now_ns.saturating_sub(stream.pulses[0].0) > ECHO_NS {
            stream.pulses.pop_front();
        }
        let Some(&(_, newest)) = stream.pulses.back() else { return };
        let is_commanded = |channel: usize| newest[channel] != LEAVE;
        let ours: [bool; CHANNELS] = std::array::from_fn(|channel| {
            is_commanded(channel) && stream.pulses.iter().any(|(_, sent)| sent[channel] == shown[channel])
        });
        let since_ns = last.map_or(stream.began_ns, |(.., last_ns)| last_ns.max(stream.began_ns));
        let step = now_ns.saturating_sub(since_ns).clamp(0, ECHO_NS);
        let Some(channel) = (0..CHANNELS).find(|&channel| is_commanded(channel) && !ours[channel]) else {
            stream.foreign_ns = (stream.foreign_ns - step / 4).max(0);
            return;
        };
        stream.foreign_ns += step;
        if stream.foreign_ns > ECHO_NS {
            let reason = format!(
                "channel {} has a pulse of {} us, and hydroid has sent {} us: the pilot has ended the overrides, another \
                 program overrides the channel, or the autopilot ignores overrides",
                channel + 1,
                shown[channel],
                newest[channel]
            );
            self.hand_off(reason, ours);
        }
    }

    /// Takes a text of the autopilot.
    fn receive_text(&mut self, text: &str) {
        let text = text.trim();
        let lower = text.to_lowercase();
        if lower.starts_with("prearm:") || lower.starts_with("arm:") {
            text.clone_into(&mut self.arming);
        } else if lower.contains("overrides cleared") {
            // The sticks hold from now on.
            self.hand_off(format!("the autopilot says: {text}"), [false; CHANNELS]);
        } else if lower.ends_with("failsafe") {
            self.hand_off(format!("the autopilot says: {text}"), [true; CHANNELS]);
        }
    }
}

impl Vehicle {
    fn new(header: MavHeader, beat: &HEARTBEAT_DATA) -> Self {
        Self {
            system: header.system_id,
            component: header.component_id,
            family: beat.autopilot,
            mavtype: beat.mavtype,
            mode: beat.custom_mode,
            is_armed: beat.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED),
            status: beat.system_status,
        }
    }

    /// System and component.
    fn address(&self) -> (u8, u8) {
        (self.system.to_le_bytes()[0], self.component)
    }
}

impl Stream {
    fn set(&mut self, values: impl Iterator<Item = f64>) {
        for (to, value) in self.values.iter_mut().zip(values) {
            self.is_changed |= *to != value;
            *to = value;
        }
    }
}

/// Time of the autopilot when it sent a message. The time of a GNSS fix is not it.
fn boot_ms(message: &MavMessage) -> Option<u32> {
    match message {
        MavMessage::ATTITUDE(m) => Some(m.time_boot_ms),
        MavMessage::GLOBAL_POSITION_INT(m) => Some(m.time_boot_ms),
        MavMessage::LOCAL_POSITION_NED(m) => Some(m.time_boot_ms),
        MavMessage::RC_CHANNELS(m) => Some(m.time_boot_ms),
        MavMessage::SYSTEM_TIME(m) => Some(m.time_boot_ms),
        _ => None,
    }
}

/// Whether a time has passed since the last time of something, or it has not been yet.
fn is_due(last_ns: Option<i64>, step_ns: i64, now_ns: i64) -> bool {
    last_ns.is_none_or(|last_ns| now_ns.saturating_sub(last_ns) >= step_ns)
}

fn seconds(ns: i64) -> f64 {
    ns as f64 / 1e9
}
