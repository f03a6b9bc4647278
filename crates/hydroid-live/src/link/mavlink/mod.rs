//! An autopilot that speaks `MAVLink` (`ArduPilot`, `PX4`).
//!
//! [`Autopilot`] is the protocol without input and output: it takes messages and gives events and answers.
//! [`transport`] moves the bytes, [`helm`] commands.

pub mod clock;
pub mod helm;
mod link;
mod mixer;
pub mod port;
pub mod topics;
pub mod transport;

use ::mavlink::MavHeader;
use ::mavlink::Message as _;
use ::mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, HEARTBEAT_DATA, MavAutopilot, MavCmd, MavMessage, MavModeFlag, MavSeverity, MavState,
    MavType, TIMESYNC_DATA,
};

use self::clock::Clock;
pub use self::link::{MavLink, Settings};
use self::topics::TOPICS;
use super::{Event, Row, State};

/// Time between heartbeats and exchanges of time \[ns\].
const BEAT_NS: i64 = 1_000_000_000;

/// Without a heartbeat for this time \[ns\], the link is lost: five heartbeats.
const LOST_NS: i64 = 5_000_000_000;

/// Questions for the time whose answers are awaited.
const QUESTIONS: usize = 4;

/// Time between requests of rates that have not been followed \[ns\].
const ASK_NS: i64 = 5_000_000_000;

/// Options of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// System id of the autopilot; `None` for the first that is heard.
    pub system: Option<u8>,
    /// Own system id. ArduPilot takes commands of `MAV_GCS_SYSID` (`SYSID_MYGCS` before 4.7) alone, which is 255 by default.
    pub own_system: u8,
    /// Topics with the rates \[Hz\] that are asked for.
    pub rates: Vec<(usize, f64)>,
}

/// Own component: a computer on board.
const OWN_COMPONENT: u8 = 191;

/// Component of autopilots.
const AUTOPILOT: u8 = 1;

/// The autopilot at the other end.
#[derive(Clone, Debug)]
struct Vehicle {
    system: u32,
    component: u8,
    family: MavAutopilot,
    state: Option<State>,
}

/// The protocol.
pub struct Autopilot {
    options: Options,
    clock: Clock,
    vehicle: Option<Vehicle>,
    /// Reception of the last heartbeat, and whether the loss of the link has been told.
    heard_ns: i64,
    is_lost: bool,
    beat_ns: Option<i64>,
    /// Times of the last questions for the time of the autopilot; it answers those of others on the link, too.
    questions_ns: [i64; QUESTIONS],
    asked_ns: Option<i64>,
    /// Reception of the last row of each topic.
    last_ns: Vec<Option<i64>>,
    /// Usual time between rows of each topic \[ns\].
    steps_ns: Vec<f64>,
    sequence: u8,
    values: Vec<f64>,
}

impl Autopilot {
    /// Before the first message.
    pub fn new(options: Options) -> Self {
        Self {
            options,
            clock: Clock::default(),
            vehicle: None,
            heard_ns: 0,
            is_lost: false,
            beat_ns: None,
            questions_ns: [0; QUESTIONS],
            asked_ns: None,
            last_ns: vec![None; TOPICS.len()],
            steps_ns: vec![f64::NAN; TOPICS.len()],
            sequence: 0,
            values: Vec::new(),
        }
    }

    /// Topics with the rates \[Hz\] that are asked for from now on.
    pub fn ask_for(&mut self, rates: Vec<(usize, f64)>) {
        self.options.rates = rates;
    }

    /// The clock of the autopilot.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// Rate of the rows of a topic \[Hz\]; `None` before the second one.
    pub fn rate_hz(&self, topic: usize) -> Option<f64> {
        let step = self.steps_ns[topic];
        (step > 0.0).then(|| 1e9 / step)
    }

    /// Takes a message. The answer is whether it comes from the autopilot of the link.
    pub fn receive(
        &mut self,
        header: MavHeader,
        message: &MavMessage,
        received_ns: i64,
        mut tell: impl FnMut(Event),
    ) -> bool {
        if let MavMessage::HEARTBEAT(beat) = message {
            self.find(header, beat, &mut tell);
        }
        let Some(vehicle) = &mut self.vehicle else { return false };
        if (header.system_id, header.component_id) != (vehicle.system, vehicle.component) {
            return false;
        }
        match message {
            MavMessage::HEARTBEAT(beat) => {
                self.heard_ns = received_ns;
                if std::mem::take(&mut self.is_lost) {
                    tell(Event::Back);
                }
                let state = State {
                    mode: mode_name(vehicle.family, beat.custom_mode),
                    armed: beat.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED),
                };
                if vehicle.state.as_ref() != Some(&state) {
                    vehicle.state = Some(state.clone());
                    tell(Event::State(state));
                }
            }
            // An answer has the time of the question.
            MavMessage::TIMESYNC(sync) if sync.tc1 != 0 && self.questions_ns.contains(&sync.ts1) => {
                self.clock.exchange(sync.ts1, sync.tc1, received_ns);
            }
            MavMessage::STATUSTEXT(said) => {
                let text = said.text.to_str().unwrap_or_default().trim_end_matches('\0').to_owned();
                tell(Event::Text {
                    warning: said.severity as u32 <= MavSeverity::MAV_SEVERITY_WARNING as u32,
                    text,
                });
            }
            _ => {}
        }
        if let Some((topic, stamp)) = topics::row(message, &mut self.values) {
            let (sent_ns, restarted) = self.clock.utc_ns(stamp, received_ns);
            if restarted {
                self.asked_ns = None;
                tell(Event::Restarted);
            }
            if let Some(last) = self.last_ns[topic].replace(received_ns) {
                let step = (received_ns - last) as f64;
                let usual = &mut self.steps_ns[topic];
                *usual = if usual.is_nan() { step } else { *usual + 0.1 * (step - *usual) };
            }
            tell(Event::Row(Row { topic, sent_ns, received_ns, values: self.values.clone() }));
        }
        true
    }

    /// The first autopilot that is heard, or that of the options.
    fn find(&mut self, header: MavHeader, beat: &HEARTBEAT_DATA, tell: &mut impl FnMut(Event)) {
        let wanted = self.options.system.is_none_or(|system| u32::from(system) == header.system_id);
        // Ground stations, cameras and other computers on board have heartbeats, too.
        let is_autopilot =
            header.component_id == AUTOPILOT && beat.autopilot != MavAutopilot::MAV_AUTOPILOT_INVALID;
        if self.vehicle.is_some() || !wanted || !is_autopilot {
            return;
        }
        let (system, component, family) = (header.system_id, header.component_id, beat.autopilot);
        self.vehicle = Some(Vehicle { system, component, family, state: None });
        let kind = match beat.mavtype {
            MavType::MAV_TYPE_SURFACE_BOAT => "boat".to_owned(),
            MavType::MAV_TYPE_GROUND_ROVER => "rover".to_owned(),
            other => format!("{other:?}").trim_start_matches("MAV_TYPE_").to_lowercase().replace('_', " "),
        };
        tell(Event::Found(format!("{} ({kind}), system {system}", family_name(family))));
    }

    /// Header of the next message that another part of this program sends on the link.
    pub fn next_header(&mut self) -> MavHeader {
        let (system_id, component_id) = (self.options.own_system.into(), OWN_COMPONENT);
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        MavHeader { system_id, component_id, sequence }
    }

    /// Sends what is due: heartbeats, questions for the time, requests of rates. Tells the loss of the link.
    pub fn tick(
        &mut self,
        now_ns: i64,
        mut send: impl FnMut(MavHeader, MavMessage),
        mut tell: impl FnMut(Event),
    ) {
        let due = |last: Option<i64>, step: i64| last.is_none_or(|last| now_ns.saturating_sub(last) >= step);
        let mut sequence = self.sequence;
        let mut asked = false;
        let mut put = |message| {
            let (system_id, component_id) = (self.options.own_system.into(), OWN_COMPONENT);
            send(MavHeader { system_id, component_id, sequence }, message);
            sequence = sequence.wrapping_add(1);
        };
        if due(self.beat_ns, BEAT_NS) {
            self.beat_ns = Some(now_ns);
            put(MavMessage::HEARTBEAT(HEARTBEAT_DATA {
                custom_mode: 0,
                mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
                autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
                base_mode: MavModeFlag::empty(),
                system_status: MavState::MAV_STATE_ACTIVE,
                mavlink_version: 3,
            }));
            put(MavMessage::TIMESYNC(TIMESYNC_DATA { tc1: 0, ts1: now_ns }));
            asked = true;
        }
        if let Some(vehicle) = &self.vehicle
            && due(self.asked_ns, ASK_NS)
        {
            self.asked_ns = Some(now_ns);
            for &(topic, rate_hz) in &self.options.rates {
                if self.follows(topic, rate_hz, now_ns) {
                    continue;
                }
                let Some(id) = MavMessage::message_id_from_name(TOPICS[topic].name) else { continue };
                #[expect(clippy::cast_possible_truncation, reason = "whole microseconds")]
                let interval_us = (1e6 / rate_hz).round() as f32;
                put(MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
                    param1: id as f32,
                    param2: interval_us,
                    param3: 0.0,
                    param4: 0.0,
                    param5: 0.0,
                    param6: 0.0,
                    param7: 0.0,
                    command: MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
                    target_system: vehicle.system.to_le_bytes()[0],
                    target_component: vehicle.component,
                    confirmation: 0,
                }));
            }
        }
        self.sequence = sequence;
        if asked {
            self.questions_ns.rotate_right(1);
            self.questions_ns[0] = now_ns;
        }
        if self.vehicle.is_some() && !self.is_lost && now_ns.saturating_sub(self.heard_ns) > LOST_NS {
            self.is_lost = true;
            tell(Event::Lost(now_ns.saturating_sub(self.heard_ns) as f64 / 1e9));
        }
    }

    /// Whether a topic arrives at nearly the rate that was asked for.
    fn follows(&self, topic: usize, rate_hz: f64, now_ns: i64) -> bool {
        let age_s =
            self.last_ns[topic].map_or(f64::INFINITY, |last| now_ns.saturating_sub(last) as f64 / 1e9);
        age_s < 3.0 / rate_hz + 1.0 && self.rate_hz(topic).is_some_and(|rate| rate > 0.7 * rate_hz)
    }
}

/// Name of the software of an autopilot.
fn family_name(family: MavAutopilot) -> &'static str {
    match family {
        MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA => "ArduPilot",
        MavAutopilot::MAV_AUTOPILOT_PX4 => "PX4",
        _ => "autopilot",
    }
}

/// Name of a mode: those of ArduPilot Rover and the main modes of PX4.
fn mode_name(family: MavAutopilot, mode: u32) -> String {
    let name = match (family, mode) {
        (MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA, mode) => match mode {
            0 => "MANUAL",
            1 => "ACRO",
            3 => "STEERING",
            4 => "HOLD",
            5 => "LOITER",
            6 => "FOLLOW",
            7 => "SIMPLE",
            8 => "DOCK",
            9 => "CIRCLE",
            10 => "AUTO",
            11 => "RTL",
            12 => "SMART_RTL",
            15 => "GUIDED",
            16 => "INITIALISING",
            _ => "",
        },
        (MavAutopilot::MAV_AUTOPILOT_PX4, mode) => match mode >> 16 & 0xff {
            1 => "MANUAL",
            2 => "ALTCTL",
            3 => "POSCTL",
            4 => "AUTO",
            5 => "ACRO",
            6 => "OFFBOARD",
            7 => "STABILIZED",
            _ => "",
        },
        _ => "",
    };
    if name.is_empty() { format!("mode {mode}") } else { name.to_owned() }
}
