//! A simulated ArduPilot Rover: modes, arming, overrides with their time-out, set-points, parameters, messages.
//!
//! `tests/boat/boat.py` models more of it, after its source.

use std::collections::BTreeMap;

use mavlink::Message as _;
use mavlink::dialects::ardupilotmega::{
    ATTITUDE_DATA, COMMAND_LONG_DATA, EKF_STATUS_REPORT_DATA, EkfStatusFlags, GPS_GLOBAL_ORIGIN_DATA,
    GPS_RAW_INT_DATA, GpsFixType, HEARTBEAT_DATA, MavAutopilot, MavCmd, MavMessage, MavModeFlag, MavSeverity,
    MavState, MavType, PARAM_VALUE_DATA, RC_CHANNELS_DATA, RC_CHANNELS_OVERRIDE_DATA, SERVO_OUTPUT_RAW_DATA,
    STATUSTEXT_DATA, TIMESYNC_DATA,
};
use rand::Rng;

use super::water::{Water, geographic, normal, wrap};
use super::{MS, S, TICK_NS};

pub(super) const MANUAL: u32 = 0;
pub(super) const HOLD: u32 = 4;
pub(super) const GUIDED: u32 = 15;

/// Silence after a start.
const BOOT_NS: i64 = 3 * S;

/// Set-points and overrides are in force for this time.
const TIMEOUT_NS: i64 = 3 * S;

/// The position estimate is lost this long after the last fix.
const POSITION_NS: i64 = 5 * S;

/// Time between fixes.
pub(super) const FIX_NS: i64 = 200 * MS;

/// Faults of the sensors.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SensorFaults {
    pub(super) has_no_fix: bool,
    /// Added to fixes \[m\].
    pub(super) jump_m: [f64; 2],
    /// A heading that is shown in place of the true one.
    pub(super) frozen: Option<f64>,
    /// A fix that a frozen receiver repeats: north, east \[m\], and velocities \[m/s\].
    pub(super) fix: Option<[f64; 4]>,
}

/// The autopilot with its boat.
pub(super) struct Autopilot {
    pub(super) water: Water,
    pub(super) faults: SensorFaults,
    pub(super) now_ns: i64,
    /// Start of its clock, which is behind that of the computer.
    pub(super) boot_ns: i64,
    up_ns: i64,
    pub(super) mode: u32,
    pub(super) is_armed: bool,
    pub(super) has_failsafe: bool,
    /// Sticks of the pilot, steering and throttle from -1 to 1.
    pub(super) sticks: [f64; 2],
    overrides: [Option<(u16, i64)>; 8],
    set_point: Option<([f64; 2], i64)>,
    throttle: f64,
    fix_ns: i64,
    intervals: BTreeMap<u32, i64>,
    sent: BTreeMap<u32, i64>,
    out: Vec<MavMessage>,
}

fn id(name: &str) -> u32 {
    MavMessage::message_id_from_name(name).unwrap()
}

impl Autopilot {
    pub(super) fn new(now_ns: i64, rng: &mut impl Rng) -> Self {
        let mut autopilot = Self {
            water: Water::new(rng),
            faults: SensorFaults::default(),
            now_ns,
            boot_ns: now_ns - 100 * S,
            up_ns: now_ns,
            mode: MANUAL,
            is_armed: true,
            has_failsafe: false,
            sticks: [0.0; 2],
            overrides: [None; 8],
            set_point: None,
            throttle: 0.0,
            fix_ns: 0,
            intervals: BTreeMap::new(),
            sent: BTreeMap::new(),
            out: Vec::new(),
        };
        autopilot.reset_rates();
        autopilot
    }

    fn reset_rates(&mut self) {
        let names = ["HEARTBEAT", "ATTITUDE", "RC_CHANNELS", "SERVO_OUTPUT_RAW", "EKF_STATUS_REPORT"];
        self.intervals = names.map(|name| (id(name), S)).into();
        self.intervals.insert(id("GPS_RAW_INT"), FIX_NS);
        self.sent.clear();
    }

    /// The autopilot starts again: disarmed, in MANUAL, with a new clock.
    pub(super) fn restart(&mut self) {
        (self.boot_ns, self.up_ns) = (self.now_ns, self.now_ns + BOOT_NS);
        (self.mode, self.is_armed, self.has_failsafe) = (MANUAL, false, false);
        (self.overrides, self.set_point, self.throttle) = ([None; 8], None, 0.0);
        self.reset_rates();
    }

    /// Changes the mode, and says so at once.
    pub(super) fn set_mode(&mut self, mode: u32) {
        if self.mode != mode {
            self.mode = mode;
            self.set_point = None;
            self.sent.remove(&id("HEARTBEAT"));
        }
    }

    pub(super) fn set_armed(&mut self, is_armed: bool) {
        if self.is_armed != is_armed {
            self.is_armed = is_armed;
            self.say(
                MavSeverity::MAV_SEVERITY_INFO,
                if is_armed { "Throttle armed" } else { "Throttle disarmed" },
            );
        }
    }

    /// A failsafe acts: HOLD, and no overrides.
    pub(super) fn fail(&mut self) {
        self.has_failsafe = true;
        self.overrides = [None; 8];
        self.say(MavSeverity::MAV_SEVERITY_WARNING, "Radio Failsafe");
        self.set_mode(HOLD);
    }

    fn say(&mut self, severity: MavSeverity, text: &str) {
        let mut said = STATUSTEXT_DATA::DEFAULT;
        (said.severity, said.text) = (severity, text.into());
        self.out.push(MavMessage::STATUSTEXT(said));
    }

    fn boot_us(&self) -> u64 {
        u64::try_from((self.now_ns - self.boot_ns) / 1000).unwrap_or(0)
    }

    fn boot_ms(&self) -> u32 {
        u32::try_from(self.boot_us() / 1000).unwrap()
    }

    /// A tick; gives the messages.
    pub(super) fn tick(&mut self, rng: &mut impl Rng) -> Vec<MavMessage> {
        self.now_ns += TICK_NS;
        let [steering, throttle] = self.commands();
        // MOT_SLEWRATE.
        self.throttle += (throttle - self.throttle).clamp(-0.02, 0.02);
        let scale = 400.0 / (self.throttle.abs() + steering.abs()).max(1.0);
        let sides = [self.throttle + steering, self.throttle - steering].map(|x| 1500.0 + scale * x);
        let is_up = self.now_ns >= self.up_ns;
        self.water.advance(if is_up { sides } else { [1500.0; 2] }, TICK_NS as f64 / 1e9, rng);
        if !self.faults.has_no_fix && self.now_ns - self.fix_ns >= FIX_NS {
            self.fix_ns = self.now_ns;
        }
        if !is_up {
            self.out.clear();
            return Vec::new();
        }
        let due: Vec<u32> = self
            .intervals
            .iter()
            .filter(|(id, interval)| self.is_due(**id, **interval))
            .map(|(id, _)| *id)
            .collect();
        for id in due {
            self.sent.insert(id, self.now_ns);
            if let Some(message) = self.content(id, sides, rng) {
                self.out.push(message);
            }
        }
        std::mem::take(&mut self.out)
    }

    fn is_due(&self, id: u32, interval_ns: i64) -> bool {
        self.sent.get(&id).is_none_or(|last| self.now_ns - last >= interval_ns)
    }

    /// Pulse in force.
    fn pulse(&self, channel: usize) -> u16 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 1100 and 1900")]
        let stick = |x: f64| (1500.0 + 400.0 * x) as u16;
        match self.overrides[channel] {
            Some((pulse, since_ns)) if self.now_ns - since_ns < TIMEOUT_NS => pulse,
            _ if channel == 0 => stick(self.sticks[0]),
            _ if channel == 2 => stick(self.sticks[1]),
            _ => 1500,
        }
    }

    /// Steering and throttle, -1 to 1.
    fn commands(&self) -> [f64; 2] {
        let of = |channel| (f64::from(self.pulse(channel)) - 1500.0) / 400.0;
        match self.mode {
            _ if !self.is_armed => [0.0; 2],
            MANUAL => [of(0), of(2)],
            GUIDED => match self.set_point {
                Some(([speed, rate], since_ns)) if self.now_ns - since_ns < TIMEOUT_NS => {
                    let [has_speed, has_rate] = [self.water.speed(), self.water.nu[2]];
                    let throttle = 0.45 * speed + 0.4 * (speed - has_speed);
                    [(1.2 * rate + 1.5 * (rate - has_rate)).clamp(-1.0, 1.0), throttle.clamp(-1.0, 1.0)]
                }
                _ => [0.0; 2],
            },
            _ => [0.0; 2],
        }
    }

    fn content(&self, message: u32, sides: [f64; 2], rng: &mut impl Rng) -> Option<MavMessage> {
        let (us, ms) = (self.boot_us(), self.boot_ms());
        let yaw = self.faults.frozen.unwrap_or(wrap(self.water.pose[2] + 0.01 * normal(rng)));
        #[expect(clippy::cast_possible_truncation, reason = "single precision of the message")]
        let single = |x: f64| x as f32;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "whole numbers of the message"
        )]
        let whole = |x: f64| x.round() as u16;
        Some(match MavMessage::default_message_from_id(message)? {
            MavMessage::HEARTBEAT(_) => MavMessage::HEARTBEAT(self.heartbeat()),
            MavMessage::ATTITUDE(_) => {
                let mut m = ATTITUDE_DATA::DEFAULT;
                (m.time_boot_ms, m.yaw) = (ms, single(yaw));
                m.yawspeed = single(self.water.nu[2] + 0.003 * normal(rng));
                MavMessage::ATTITUDE(m)
            }
            MavMessage::RC_CHANNELS(_) => {
                let mut m = RC_CHANNELS_DATA::DEFAULT;
                (m.time_boot_ms, m.chancount, m.rssi) = (ms, 8, 254);
                [
                    m.chan1_raw,
                    m.chan2_raw,
                    m.chan3_raw,
                    m.chan4_raw,
                    m.chan5_raw,
                    m.chan6_raw,
                    m.chan7_raw,
                    m.chan8_raw,
                ] = std::array::from_fn(|channel| self.pulse(channel));
                MavMessage::RC_CHANNELS(m)
            }
            MavMessage::SERVO_OUTPUT_RAW(_) => {
                let mut m = SERVO_OUTPUT_RAW_DATA::DEFAULT;
                m.time_usec = u32::try_from(us & 0xffff_ffff).unwrap();
                (m.servo1_raw, m.servo3_raw) = (whole(sides[0]), whole(sides[1]));
                MavMessage::SERVO_OUTPUT_RAW(m)
            }
            MavMessage::EKF_STATUS_REPORT(_) => {
                let mut m = EKF_STATUS_REPORT_DATA::DEFAULT;
                let has_position = self.now_ns - self.fix_ns < POSITION_NS;
                m.flags = if has_position {
                    EkfStatusFlags::EKF_POS_HORIZ_ABS
                } else {
                    EkfStatusFlags::EKF_CONST_POS_MODE
                };
                MavMessage::EKF_STATUS_REPORT(m)
            }
            MavMessage::GPS_RAW_INT(_) => {
                let [n, e] = [0, 1].map(|k| {
                    self.water.pose[k] + self.water.drift_m[k] + self.faults.jump_m[k] + 0.1 * normal(rng)
                });
                let [vn, ve] = self.water.velocity().map(|v| v + 0.05 * normal(rng));
                let [n, e, vn, ve] = self.faults.fix.unwrap_or([n, e, vn, ve]);
                let mut m = GPS_RAW_INT_DATA::DEFAULT;
                m.time_usec = us;
                [m.lat, m.lon] = geographic([n, e]);
                let no_fix = self.faults.has_no_fix;
                m.fix_type =
                    if no_fix { GpsFixType::GPS_FIX_TYPE_NO_FIX } else { GpsFixType::GPS_FIX_TYPE_3D_FIX };
                m.vel = whole(100.0 * vn.hypot(ve));
                m.cog = whole(100.0 * ve.atan2(vn).to_degrees().rem_euclid(360.0));
                (m.eph, m.satellites_visible) = (80, 14);
                MavMessage::GPS_RAW_INT(m)
            }
            _ => return None,
        })
    }

    pub(super) fn freeze_receiver(&mut self) {
        let ([north, east, _], [vn, ve]) = (self.water.pose, self.water.velocity());
        self.faults.fix = Some([north, east, vn, ve]);
    }

    fn heartbeat(&self) -> HEARTBEAT_DATA {
        let armed =
            if self.is_armed { MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED } else { MavModeFlag::empty() };
        HEARTBEAT_DATA {
            custom_mode: self.mode,
            mavtype: MavType::MAV_TYPE_SURFACE_BOAT,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode: MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | armed,
            system_status: if self.has_failsafe {
                MavState::MAV_STATE_CRITICAL
            } else {
                MavState::MAV_STATE_ACTIVE
            },
            mavlink_version: 3,
        }
    }

    /// Takes a message of the computer on board.
    pub(super) fn receive(&mut self, message: &MavMessage) {
        if self.now_ns < self.up_ns {
            return;
        }
        match message {
            MavMessage::TIMESYNC(asked) if asked.tc1 == 0 => {
                let tc1 = i64::try_from(1000 * self.boot_us()).unwrap();
                self.out.push(MavMessage::TIMESYNC(TIMESYNC_DATA { tc1, ts1: asked.ts1 }));
            }
            MavMessage::PARAM_REQUEST_READ(question) => {
                let name = question.param_id.to_str().unwrap_or_default();
                if let Some(&(name, value)) = crate::helm::PARAMETERS.iter().find(|(known, _)| *known == name)
                {
                    let mut answer = PARAM_VALUE_DATA::DEFAULT;
                    (answer.param_id, answer.param_value) = (name.into(), value);
                    self.out.push(MavMessage::PARAM_VALUE(answer));
                }
            }
            MavMessage::COMMAND_LONG(command) => self.command(command),
            MavMessage::RC_CHANNELS_OVERRIDE(m) => {
                for (channel, pulse) in pulses_of(m).into_iter().enumerate() {
                    match pulse {
                        u16::MAX => {}
                        0 => self.overrides[channel] = None,
                        pulse => self.overrides[channel] = Some((pulse, self.now_ns)),
                    }
                }
            }
            MavMessage::SET_POSITION_TARGET_LOCAL_NED(m) if self.mode == GUIDED => {
                self.set_point = Some(([m.vx, m.yaw_rate].map(f64::from), self.now_ns));
            }
            _ => {}
        }
    }

    fn command(&mut self, command: &COMMAND_LONG_DATA) {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "ids and times are positive"
        )]
        let (id_of, us) = (command.param1 as u32, command.param2 as i64);
        match command.command {
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => {
                if let Some(interval_ns) = self.intervals.get_mut(&id_of) {
                    *interval_ns = (1000 * us).max(if id_of == id("GPS_RAW_INT") { FIX_NS } else { TICK_NS });
                }
            }
            MavCmd::MAV_CMD_REQUEST_MESSAGE if id_of == id("GPS_GLOBAL_ORIGIN") => {
                self.out.push(MavMessage::GPS_GLOBAL_ORIGIN(GPS_GLOBAL_ORIGIN_DATA::DEFAULT));
            }
            _ => {}
        }
    }
}

/// Pulses of channels 1 to 8.
pub(super) fn pulses_of(m: &RC_CHANNELS_OVERRIDE_DATA) -> [u16; 8] {
    [m.chan1_raw, m.chan2_raw, m.chan3_raw, m.chan4_raw, m.chan5_raw, m.chan6_raw, m.chan7_raw, m.chan8_raw]
}
