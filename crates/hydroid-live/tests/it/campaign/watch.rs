//! What must hold of each command: limits, mode, arming, take-over, age of the position.

use hydroid_live::boat::Settings;
use mavlink::dialects::ardupilotmega::{
    GpsFixType, MavFrame, MavMessage, MavModeFlag, MavState, RC_CHANNELS_OVERRIDE_DATA,
    SET_POSITION_TARGET_LOCAL_NED_DATA,
};

use super::autopilot::{Autopilot, GUIDED, MANUAL, pulses_of};
use super::vessel::Commands;
use super::{MS, S};

/// A command may be sent so long after the last heartbeat and the last message, with a tick for the decision.
const HEARTBEAT_NS: i64 = 2_520 * MS;
const MESSAGE_NS: i64 = 1_020 * MS;

/// Stated age of the position and heading, 1 s beyond two usual steps. A usual step is at most 0.4 s: that of the fixes
/// with a loss of every second one.
const PLACE_NS: i64 = 1_820 * MS;

/// Longest time from a change at the autopilot to the end of the commands, if heartbeats that tell it are lost: an older
/// heartbeat that is late, and the time after it.
const TRUTH_NS: i64 = 3_000 * MS;

/// A release has at most these messages, within this time.
const RELEASE: usize = 5;
const RELEASE_NS: i64 = S;

/// A jump of the position by so much under command ends the commands within this time.
const JUMP_M: f64 = 30.0;
const JUMP_NS: i64 = 3 * S;

/// A position that is frozen while commands push the boat ends them within this time: the sum of that to find it, of an older fix, and of
/// lost messages.
const FROZEN_NS: i64 = 8 * S;

const LEAVE: u16 = u16::MAX;

/// Who may command.
#[derive(Clone, Debug, PartialEq)]
enum Phase {
    Off,
    Commanding,
    Ended { at_ns: i64, sent: usize, why: String },
}

/// A channel in use: its place, lower limit, upper limit and neutral pulse.
type Channel = (usize, u16, u16, u16);

pub(super) struct Watch {
    commands: Commands,
    channels: Vec<Channel>,
    /// Limits of speed and yaw rate.
    set_points: [[f64; 2]; 2],
    phase: Phase,
    /// The operator has asked for steering, and nothing has happened since that ends commands.
    asked_to_steer: bool,
    /// Mode, arming and state of the last heartbeat.
    told: Option<(u32, bool, MavState)>,
    heartbeat_ns: i64,
    message_ns: i64,
    fix_ns: i64,
    fix_us: u64,
    heading_ns: i64,
    boot_ms: u32,
    unfit_since_ns: Option<i64>,
    /// Whether the positions are off, and since when they are under a command that has not ended since.
    has_jumped: bool,
    jumped_ns: Option<i64>,
    /// Since when the receiver is frozen, and commands are not neutral.
    frozen_ns: Option<i64>,
    pushing_ns: Option<i64>,
    /// Commands, without releases.
    pub(super) count: u64,
}

impl Watch {
    pub(super) fn new(commands: Commands, settings: &Settings) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 1100 and 1900")]
        let channel = |place: usize, name: &str| {
            let [low, high] = settings.limits[name].map(|x| 1500.0 + 400.0 * x);
            (place, low.ceil() as u16, high.floor() as u16, 1500)
        };
        Self {
            commands,
            channels: vec![channel(2, "throttle"), channel(0, "steering")],
            set_points: ["throttle", "steering"].map(|name| settings.limits[name]),
            phase: Phase::Off,
            asked_to_steer: false,
            told: None,
            heartbeat_ns: 0,
            message_ns: 0,
            fix_ns: 0,
            fix_us: 0,
            heading_ns: 0,
            boot_ms: 0,
            unfit_since_ns: None,
            has_jumped: false,
            jumped_ns: None,
            frozen_ns: None,
            pushing_ns: None,
            count: 0,
        }
    }

    pub(super) fn required_mode(&self) -> u32 {
        if self.commands == Commands::Channels { MANUAL } else { GUIDED }
    }

    fn is_fit(&self, (mode, is_armed, state): (u32, bool, MavState)) -> bool {
        let is_well = matches!(state, MavState::MAV_STATE_STANDBY | MavState::MAV_STATE_ACTIVE);
        mode == self.required_mode() && is_armed && is_well
    }

    /// Whether commands may be sent.
    pub(super) fn is_commanding(&self) -> bool {
        self.phase == Phase::Commanding
    }

    /// The truth at this time.
    pub(super) fn see(&mut self, truth: &Autopilot) {
        let is_fit = truth.mode == self.required_mode() && truth.is_armed && !truth.has_failsafe;
        self.unfit_since_ns = if is_fit { None } else { self.unfit_since_ns.or(Some(truth.now_ns)) };
        let [north, east] = truth.faults.jump_m;
        let has_jumped = north.hypot(east) > JUMP_M && !truth.faults.has_no_fix;
        if has_jumped && !self.has_jumped && self.phase == Phase::Commanding {
            self.jumped_ns = Some(truth.now_ns);
        } else if !has_jumped {
            self.jumped_ns = None;
        }
        self.has_jumped = has_jumped;
        let is_frozen = truth.faults.fix.is_some() && !truth.faults.has_no_fix;
        self.frozen_ns = is_frozen.then(|| self.frozen_ns.unwrap_or(truth.now_ns));
    }

    /// A message that hydroid takes now.
    pub(super) fn told(&mut self, message: &MavMessage, now_ns: i64) {
        self.message_ns = now_ns;
        let boot_ms = match message {
            MavMessage::HEARTBEAT(beat) => {
                let is_armed = beat.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED);
                let told = (beat.custom_mode, is_armed, beat.system_status);
                (self.told, self.heartbeat_ns) = (Some(told), now_ns);
                if !self.is_fit(told) {
                    self.end(now_ns, format!("{told:?}"));
                }
                None
            }
            MavMessage::GPS_RAW_INT(fix) => {
                if fix.fix_type as u32 >= GpsFixType::GPS_FIX_TYPE_2D_FIX as u32
                    && fix.time_usec != self.fix_us
                {
                    (self.fix_us, self.fix_ns) = (fix.time_usec, now_ns);
                }
                None
            }
            MavMessage::ATTITUDE(m) => {
                self.heading_ns = now_ns;
                Some(m.time_boot_ms)
            }
            MavMessage::RC_CHANNELS(m) => Some(m.time_boot_ms),
            MavMessage::STATUSTEXT(said) => {
                if said.text.to_str().is_ok_and(|text| text.ends_with("Failsafe")) {
                    self.end(now_ns, "a failsafe".to_owned());
                }
                None
            }
            _ => None,
        };
        if let Some(boot_ms) = boot_ms {
            if boot_ms + 2_000 < self.boot_ms {
                self.boot_ms = 0;
                self.end(now_ns, "the autopilot has started again".to_owned());
            }
            self.boot_ms = self.boot_ms.max(boot_ms);
        }
    }

    fn end(&mut self, now_ns: i64, why: String) {
        (self.asked_to_steer, self.jumped_ns, self.pushing_ns) = (false, None, None);
        if self.phase == Phase::Commanding {
            self.phase = Phase::Ended { at_ns: now_ns, sent: 0, why };
        }
    }

    /// The operator has asked for the path; it begins when the controller is ready.
    pub(super) fn asked_to_steer(&mut self) {
        self.asked_to_steer = true;
    }

    /// The experiment that the operator has asked for has begun.
    pub(super) fn begun(&mut self) {
        self.phase = Phase::Commanding;
    }

    /// What hydroid says of its commands.
    pub(super) fn said(&mut self, text: &str, now_ns: i64) -> Result<(), String> {
        if text.starts_with("hands off") {
            self.end(now_ns, text.to_owned());
        } else if text == "hydroid steers" {
            if !std::mem::take(&mut self.asked_to_steer) {
                return Err("it steers, and nobody has asked for it since commands have ended".to_owned());
            }
            self.phase = Phase::Commanding;
        }
        Ok(())
    }

    /// A message that hydroid sends.
    pub(super) fn sent(&mut self, message: &MavMessage, now_ns: i64) -> Result<(), String> {
        let judged = match message {
            MavMessage::RC_CHANNELS_OVERRIDE(m) => self.overrides(m, now_ns),
            MavMessage::SET_POSITION_TARGET_LOCAL_NED(m) => self.set_point(m, now_ns),
            MavMessage::HEARTBEAT(_)
            | MavMessage::TIMESYNC(_)
            | MavMessage::PARAM_REQUEST_READ(_)
            | MavMessage::COMMAND_LONG(_) => Ok(()),
            _ => Err("hydroid never sends such a message".to_owned()),
        };
        judged.map_err(|error| format!("{error}: {message:?}"))
    }

    /// Conditions of a command that is not a release.
    fn judge(&mut self, is_neutral: bool, now_ns: i64) -> Result<(), String> {
        self.count += 1;
        self.pushing_ns = (!is_neutral).then(|| self.pushing_ns.unwrap_or(now_ns));
        let stuck_ns = self.frozen_ns.and_then(|frozen_ns| Some(frozen_ns.max(self.pushing_ns?)));
        let seconds = |since_ns: i64| (now_ns - since_ns) as f64 / 1e9;
        if !self.told.is_some_and(|told| self.is_fit(told)) {
            return Err(format!("a command although {:?} was told", self.told));
        }
        for (name, last_ns, longest_ns) in [
            ("heartbeat", self.heartbeat_ns, HEARTBEAT_NS),
            ("message", self.message_ns, MESSAGE_NS),
            ("fix", self.fix_ns, PLACE_NS),
            ("heading", self.heading_ns, PLACE_NS),
        ] {
            if now_ns - last_ns > longest_ns {
                return Err(format!("a command {:.2} s after the last {name}", seconds(last_ns)));
            }
        }
        for (what, since_ns, longest_ns) in [
            ("the autopilot has been unfit for it", self.unfit_since_ns, TRUTH_NS),
            ("the position has jumped", self.jumped_ns, JUMP_NS),
            ("the receiver is frozen", stuck_ns, FROZEN_NS),
        ] {
            if let Some(since_ns) = since_ns.filter(|since_ns| now_ns - since_ns > longest_ns) {
                return Err(format!("a command although {what} since {:.2} s", seconds(since_ns)));
            }
        }
        Ok(())
    }

    /// The number of this message in the release, or why there can be none.
    fn release(&mut self, now_ns: i64) -> Result<usize, String> {
        match &mut self.phase {
            Phase::Off => Err("a command before anything has begun".to_owned()),
            Phase::Commanding => Err("no end of the commands was told".to_owned()),
            Phase::Ended { at_ns, sent, why } => {
                *sent += 1;
                if *sent <= RELEASE && now_ns - *at_ns <= RELEASE_NS {
                    return Ok(*sent);
                }
                let after = (now_ns - *at_ns) as f64 / 1e9;
                Err(format!("message {sent} of a release, {after:.2} s after the end: {why}"))
            }
        }
    }

    fn overrides(&mut self, m: &RC_CHANNELS_OVERRIDE_DATA, now_ns: i64) -> Result<(), String> {
        if self.commands != Commands::Channels || (m.target_system, m.target_component) != (1, 1) {
            return Err("overrides to somebody else".to_owned());
        }
        let pulses = pulses_of(m);
        if (0..8).any(|k| pulses[k] != LEAVE && self.channels.iter().all(|(place, ..)| *place != k)) {
            return Err("overrides of other channels".to_owned());
        }
        if self.phase == Phase::Commanding {
            for &(place, low, high, _) in &self.channels {
                if !(low..=high).contains(&pulses[place]) {
                    return Err(format!("channel {} is not within {low} to {high}", place + 1));
                }
            }
            let is_neutral = self.channels.iter().all(|&(place, .., rest)| pulses[place] == rest);
            return self.judge(is_neutral, now_ns);
        }
        self.release(now_ns)?;
        // The pilot has a receiver, and steers in another mode.
        let is_piloted = self.told.is_some_and(|(mode, ..)| mode != self.required_mode());
        let is_release = |neutral: bool| {
            self.channels.iter().all(|&(place, .., rest)| {
                let pulse = pulses[place];
                if neutral { pulse == rest || pulse == LEAVE } else { pulse == 0 }
            })
        };
        match (is_release(false), is_release(true)) {
            (true, _) => Ok(()),
            (_, true) if !is_piloted => Ok(()),
            (_, true) => Err("a neutral command in another mode".to_owned()),
            _ => Err(format!("neither a command nor a release: {:?}", self.phase)),
        }
    }

    fn set_point(&mut self, m: &SET_POSITION_TARGET_LOCAL_NED_DATA, now_ns: i64) -> Result<(), String> {
        #[expect(deprecated, reason = "ArduPilot ignores the successor of this frame")]
        let frame = MavFrame::MAV_FRAME_BODY_NED;
        let is_ours = (m.target_system, m.target_component) == (1, 1) && self.commands == Commands::SetPoints;
        if !is_ours || m.coordinate_frame != frame || m.type_mask.bits() != 0b0101_1110_0111 {
            return Err("a set-point of another form".to_owned());
        }
        let values = [m.vx, m.yaw_rate].map(f64::from);
        if self.phase == Phase::Commanding {
            let is_within = |(value, [low, high]): (&f64, &[f64; 2])| (*low..=*high).contains(value);
            if !values.iter().zip(&self.set_points).all(is_within) {
                return Err(format!("not within {:?}", self.set_points));
            }
            return self.judge(values == [0.0; 2], now_ns);
        }
        let number = self.release(now_ns)?;
        let is_required = self.told.is_some_and(|(mode, ..)| mode == self.required_mode());
        if number == 1 && values == [0.0; 2] && is_required {
            return Ok(());
        }
        Err(format!("neither a command nor a release: {:?}", self.phase))
    }
}
