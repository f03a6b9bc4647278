//! Checks before the first command, and those that hold all the time.

use ::mavlink::dialects::ardupilotmega::{EkfStatusFlags, MavAutopilot, MavState, MavType};

use super::super::{family_name, mode_name};
use super::axis::{Axis, Kind};
use super::parameters::{ENFORCE, GCS_IDS};
use super::{Helm, MS, Phase, seconds};
use hydroid::key::key;

/// Without a heartbeat for this time, the link is lost.
const HEARTBEAT_NS: i64 = 2_500 * MS;

/// Without any message for this time, the link is lost.
const MESSAGE_NS: i64 = 1_000 * MS;

/// Reports of the channels that are older are not used.
const CHANNELS_NS: i64 = 2_000 * MS;

/// Reports of the position filter that are older are not used.
const FILTER_NS: i64 = 3_000 * MS;

/// `RCn_OPTION` of channels that move the boat: none, and from 4.8 on roll, pitch, throttle, yaw, main sail.
const INPUT_OPTIONS: [f64; 6] = [0.0, 201.0, 202.0, THROTTLE_OPTION, 204.0, 207.0];
const THROTTLE_OPTION: f64 = 203.0;

impl Helm {
    /// Why commands would be refused now, each with a remedy. Empty: they may begin.
    pub fn refusals(&self, now_ns: i64) -> Vec<String> {
        let mut refusals = Vec::new();
        if !self.options.is_allowed {
            refusals.push("commands are not allowed: allow them when hydroid is started".to_owned());
        }
        if self.options.is_dry_run {
            refusals.push("this is a dry run, which sends no commands: start hydroid without it".to_owned());
        }
        if matches!(self.phase, Phase::Releasing { .. }) {
            refusals.push("the last commands are being released: wait for half a second".to_owned());
        }
        refusals.extend(self.unmet(now_ns));
        if !self.is_alive(now_ns) || !self.is_ardupilot() {
            // Nothing else is known.
            return refusals;
        }
        self.check_position(now_ns, &mut refusals);
        let open = self.parameters.open();
        if !open.is_empty() {
            let id = self.parameters.first_of(&GCS_IDS).map(|(_, id)| id.to_string());
            refusals.push(format!(
                "the autopilot has not answered for its parameters {}: wait; if this lasts, it may listen to system {} only \
                 (MAV_OPTIONS, SYSID_ENFORCE) or its release is too old",
                open.join(", "),
                id.as_deref().unwrap_or(GCS_IDS[0])
            ));
        }
        self.check_sender(&mut refusals);
        if self.kind == Kind::Overrides {
            self.check_overrides(&mut refusals);
            self.axes.iter().for_each(|axis| self.check_channel(axis, &mut refusals));
        }
        refusals
    }

    /// Conditions of commands that are not met. They must be met all the time.
    pub(super) fn unmet(&self, now_ns: i64) -> Vec<String> {
        let Some(vehicle) = &self.vehicle else {
            return vec!["no autopilot has been heard: check the link".to_owned()];
        };
        if !self.is_alive(now_ns) {
            let last = self.heartbeat_ns.min(self.message_ns);
            let age = last.map_or(String::new(), |last| {
                format!(" (silent for {:.1} s)", seconds(now_ns.saturating_sub(last)))
            });
            return vec![format!("the link to the autopilot is lost{age}: check it")];
        }
        if !self.is_ardupilot() {
            return vec![format!(
                "commands are for ArduPilot, and this is {}: hydroid can learn from it, but not steer it",
                family_name(vehicle.family)
            )];
        }
        let mut unmet = Vec::new();
        if !matches!(vehicle.mavtype, MavType::MAV_TYPE_SURFACE_BOAT | MavType::MAV_TYPE_GROUND_ROVER) {
            unmet.push(format!(
                "the vehicle is neither a boat nor a rover, but {:?}: load ArduPilot Rover with FRAME_CLASS 2",
                vehicle.mavtype
            ));
        }
        if !matches!(vehicle.status, MavState::MAV_STATE_STANDBY | MavState::MAV_STATE_ACTIVE) {
            unmet.push(format!(
                "the autopilot reports {:?}, a failsafe or an error: remove its cause, which its messages name",
                vehicle.status
            ));
        }
        if vehicle.mode != self.required_mode_number() {
            let (mode, required) = (mode_name(vehicle.family, vehicle.mode), self.required_mode());
            unmet.push(format!("the mode is {mode}: switch to {required}"));
        }
        if !vehicle.is_armed {
            let why = if self.arming.is_empty() { String::new() } else { format!(" ({})", self.arming) };
            unmet.push(format!("the autopilot is not armed{why}: arm it"));
        }
        let is_seen = self.channels.is_some_and(|(.., last)| now_ns.saturating_sub(last) <= CHANNELS_NS);
        if self.kind == Kind::Overrides && !is_seen {
            unmet.push(
                "RC_CHANNELS does not arrive, so that overrides cannot be verified: raise its rate (stream RC_CHAN)"
                    .to_owned(),
            );
        }
        unmet
    }

    /// Whether the link is not lost.
    pub(super) fn is_alive(&self, now_ns: i64) -> bool {
        let within = |last: Option<i64>, age| last.is_some_and(|last| now_ns.saturating_sub(last) <= age);
        within(self.heartbeat_ns, HEARTBEAT_NS) && within(self.message_ns, MESSAGE_NS)
    }

    fn is_ardupilot(&self) -> bool {
        self.vehicle.is_some_and(|vehicle| vehicle.family == MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA)
    }

    fn check_position(&self, now_ns: i64, refusals: &mut Vec<String>) {
        match self.filter.filter(|&(_, last)| now_ns.saturating_sub(last) <= FILTER_NS) {
            None => refusals.push(
                "EKF_STATUS_REPORT does not arrive, so that the position cannot be verified: raise its rate (stream EXTRA3)"
                    .to_owned(),
            ),
            // As ArduPilot judges it.
            Some((flags, _))
                if flags.contains(EkfStatusFlags::EKF_CONST_POS_MODE)
                    || !flags.intersects(
                        EkfStatusFlags::EKF_POS_HORIZ_ABS | EkfStatusFlags::EKF_POS_HORIZ_REL,
                    ) =>
            {
                refusals.push("the autopilot has no position: wait for a fix of the GNSS receiver".to_owned());
            }
            Some(_) => {}
        }
        if self.kind == Kind::SetPoints && !self.has_origin {
            refusals.push(
                "the position filter has no origin, and the autopilot ignores set-points without it: wait for a position, or \
                 set the origin from the ground station"
                    .to_owned(),
            );
        }
    }

    /// Whether the autopilot takes commands of our system id.
    fn check_sender(&self, refusals: &mut Vec<String>) {
        let Some((name, id)) = self.parameters.first_of(&GCS_IDS) else { return };
        let own = f64::from(self.options.own_system);
        let option = key("own_system").is(id);
        let last = self.parameters.value("MAV_GCS_SYSID_HI").unwrap_or(0.0).max(id);
        if (id..=last).contains(&own) {
            return;
        }
        // Set-points of all senders are taken, unless this is switched off.
        let enforced = self.parameters.first_of(&ENFORCE).filter(|&(_, value)| has_bit(value, 0));
        let is_own_vehicle = self.vehicle.is_some_and(|v| v.system == u32::from(self.options.own_system));
        match (self.kind, enforced) {
            (Kind::Overrides, _) => refusals.push(format!(
                "{name} is {id}, and hydroid speaks as {own}: start it with {option} or set the parameter"
            )),
            (Kind::SetPoints, Some((enforce, _))) if !is_own_vehicle => refusals.push(format!(
                "{enforce} restricts commands to {name}, which is {id}, and hydroid speaks as {own}: start it with \
                 {option} or set one of the parameters"
            )),
            (Kind::SetPoints, _) => {}
        }
    }

    fn check_overrides(&self, refusals: &mut Vec<String>) {
        let value = |name| self.parameters.value(name);
        match value("RC_OVERRIDE_TIME") {
            Some(0.0) => refusals
                .push("RC_OVERRIDE_TIME is 0: overrides are switched off; set it to 3 s".to_owned()),
            Some(time) if time < 0.0 => refusals.push(format!(
                "RC_OVERRIDE_TIME is {time:.1} s: overrides would never end if hydroid failed; set it to 3 s"
            )),
            Some(time) if !(0.5..=10.0).contains(&time) => refusals.push(format!(
                "RC_OVERRIDE_TIME is {time:.1} s: overrides must end between 0.5 s and 10 s after the last one; set it to 3 s"
            )),
            _ => {}
        }
        let options = value("RC_OPTIONS").unwrap_or(0.0);
        if has_bit(options, 1) {
            refusals.push(format!("RC_OPTIONS is {options}: bit 1 ignores overrides; clear it"));
        }
        let Some((shown, has_receiver, _)) = self.channels else { return };
        if !self.has_throttle_failsafe() {
            // Bit 0 ignores the receiver.
            if !has_receiver || has_bit(options, 0) {
                refusals.push(
                    "FS_THR_ENABLE is 0 and there is no receiver: nothing would stop the boat if hydroid failed; set it to 1"
                        .to_owned(),
                );
            }
            return;
        }
        let throttle = value("RCMAP_THROTTLE").unwrap_or(0.0);
        let has_no_pulse =
            shown.iter().enumerate().any(|(index, &pulse)| (index + 1) as f64 == throttle && pulse == 0);
        if has_no_pulse && self.axes.iter().all(|axis| axis.channel() != throttle) {
            refusals.push(format!(
                "channel {throttle} (RCMAP_THROTTLE) has no pulse and is not commanded, which is a throttle failsafe: \
                 command it too, or switch the transmitter on"
            ));
        }
    }

    fn has_throttle_failsafe(&self) -> bool {
        self.parameters.value("FS_THR_ENABLE") != Some(0.0)
    }

    fn check_channel(&self, axis: &Axis, refusals: &mut Vec<String>) {
        let (name, channel) = (&axis.name, axis.channel());
        let value = |field| self.parameters.value(&format!("RC{channel}_{field}"));
        if let (Some(trim), Some(dead_zone)) = (value("TRIM"), value("DZ"))
            && (trim - axis.rest).abs() > dead_zone
        {
            refusals.push(format!(
                "RC{channel}_TRIM is {trim} us (dead zone {dead_zone} us) and the neutral command of '{name}' is {} us: the \
                 autopilot would take it as a deflection; set the one to the other",
                axis.rest
            ));
        }
        let option = value("OPTION");
        if let Some(option) = option.filter(|option| !INPUT_OPTIONS.contains(option)) {
            refusals.push(format!(
                "RC{channel}_OPTION is {option}: the channel of '{name}' switches a function; select another channel or set \
                 it to 0"
            ));
        }
        if self.parameters.value("MODE_CH") == Some(channel) {
            refusals.push(format!(
                "MODE_CH is {channel}: the channel of '{name}' selects the mode; select another channel"
            ));
        }
        let is_throttle =
            self.parameters.value("RCMAP_THROTTLE") == Some(channel) || option == Some(THROTTLE_OPTION);
        if let Some(failsafe) = self.parameters.value("FS_THR_VALUE")
            && is_throttle
            && self.has_throttle_failsafe()
            && axis.low <= failsafe
        {
            refusals.push(format!(
                "the lower limit of '{name}' is {} us, and pulses up to FS_THR_VALUE ({failsafe} us) are a throttle failsafe: \
                 raise the limit",
                axis.low
            ));
        }
    }
}

fn has_bit(value: f64, bit: u32) -> bool {
    (value / f64::from(1_u32 << bit)).floor().rem_euclid(2.0) == 1.0
}
