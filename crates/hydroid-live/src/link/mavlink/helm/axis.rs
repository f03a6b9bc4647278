//! Inputs of a model as commands, and the messages that carry them.

use ::mavlink::dialects::ardupilotmega::{
    MavFrame, MavMessage, PositionTargetTypemask, RC_CHANNELS_OVERRIDE_DATA,
    SET_POSITION_TARGET_LOCAL_NED_DATA,
};

/// A pulse that leaves a channel as it is, and one that releases it, for channels 1 to 8. Channels from 9 on are in the
/// extension of the message, which is not sent: they are left as they are.
pub(super) const LEAVE: u16 = u16::MAX;
const RELEASE: u16 = 0;

/// Channels in the message.
pub(super) const CHANNELS: usize = 8;

/// Limits of pulses \[us\].
const PULSES: [f64; 2] = [800.0, 2200.0];

/// Limits of set-points \[m/s, rad/s\].
const SET_POINTS: [f64; 2] = [-100.0, 100.0];

/// Where the value of an input of a model goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Channel 1 to 8: a pulse \[us\].
    Channel(u8),
    /// Surge speed \[m/s\].
    Surge,
    /// Yaw rate \[rad/s\].
    YawRate,
}

impl Target {
    /// The target of a column of a recording.
    ///
    /// # Errors
    /// If the column cannot be commanded: the reason, and what to select instead.
    pub fn of(topic: &str, field: &str) -> Result<Self, String> {
        const INSTEAD: &str = "select RC_CHANNELS.chan1_raw to chan8_raw (commands in mode MANUAL; by default, 1 is steering \
            and 3 throttle) or SET_POSITION_TARGET_LOCAL_NED.vx and yaw_rate (commands in mode GUIDED)";
        let cannot = |why: &str| Err(format!("{topic}.{field} cannot be commanded: {why}; {INSTEAD}"));
        match (topic, field) {
            ("SET_POSITION_TARGET_LOCAL_NED", "vx") => Ok(Self::Surge),
            ("SET_POSITION_TARGET_LOCAL_NED", "yaw_rate") => Ok(Self::YawRate),
            ("RC_CHANNELS" | "RC_CHANNELS_OVERRIDE", _) => {
                let number = field.strip_prefix("chan").and_then(|rest| rest.strip_suffix("_raw"));
                match number.and_then(|number| number.parse::<u8>().ok()) {
                    Some(channel @ 1..=8) => Ok(Self::Channel(channel)),
                    Some(9..=18) => cannot("an override has channels 1 to 8 only"),
                    _ => cannot("it is not a pulse of a channel"),
                }
            }
            ("SERVO_OUTPUT_RAW", _) => {
                cannot("it is not an output, or it stands beside other inputs than outputs")
            }
            _ => cannot("the autopilot reports it, and takes no such command"),
        }
    }

    fn is_channel(self) -> bool {
        matches!(self, Self::Channel(_))
    }
}

/// The two kinds of commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Pulses.
    Overrides,
    /// Speed and rate.
    SetPoints,
}

/// An input of the model as a command. Values are raw: microseconds, m/s, rad/s. The neutral speed or rate is 0.
pub type Axis = crate::Axis<Target>;

impl Axis {
    /// Number of the channel; 0 for set-points.
    pub(super) fn channel(&self) -> f64 {
        if let Target::Channel(channel) = self.place { channel.into() } else { 0.0 }
    }

    /// A value that can be sent.
    pub(super) fn limited(&self, value: Option<f64>) -> f64 {
        let value = value.filter(|value| value.is_finite()).unwrap_or(self.rest).clamp(self.low, self.high);
        if self.place.is_channel() { value.round() } else { inward(value, self.low, self.high) }
    }

    /// Checks limits and neutral command; pulses become whole ones.
    fn check(&mut self) -> Result<(), String> {
        let Self { name, place: target, low, high, rest } = self;
        if let Target::Channel(channel) = target {
            if !(1..=CHANNELS).contains(&usize::from(*channel)) {
                return Err(format!("'{name}' commands channel {channel}: overrides have channels 1 to 8"));
            }
            (*low, *high, *rest) = (low.ceil(), high.floor(), rest.round());
        }
        let [least, largest] = if target.is_channel() { PULSES } else { SET_POINTS };
        // NaN is in no range.
        let is_limit = |value| (least..=largest).contains(value);
        if !(is_limit(low) && is_limit(high) && low < high && (*low..=*high).contains(rest)) {
            return Err(format!(
                "'{name}' has limits {low} to {high} and the neutral command {rest}: limits must ascend within {least} to \
                 {largest}, with the neutral command between them"
            ));
        }
        if !target.is_channel() && *rest != 0.0 {
            return Err(format!("'{name}' has the neutral command {rest}: that of a speed or a rate is 0"));
        }
        Ok(())
    }
}

/// Checks that axes fit together, and makes their pulses whole.
pub(super) fn checked(axes: &mut [Axis]) -> Result<Kind, String> {
    let first = axes.first().ok_or("no input of the model is commanded: select at least one")?;
    let is_channel = first.place.is_channel();
    let mut seen = Vec::new();
    for axis in axes {
        if axis.place.is_channel() != is_channel {
            return Err(format!(
                "'{}' mixes channels (mode MANUAL) with set-points (mode GUIDED): select inputs of one kind",
                axis.name
            ));
        }
        if seen.contains(&axis.place) {
            return Err(format!("'{}' commands {:?}, as another input does", axis.name, axis.place));
        }
        seen.push(axis.place);
        axis.check()?;
    }
    Ok(if is_channel { Kind::Overrides } else { Kind::SetPoints })
}

/// The nearest number with single precision within limits that contain 0.
#[expect(clippy::cast_possible_truncation, reason = "the precision of the message")]
fn inward(value: f64, low: f64, high: f64) -> f64 {
    let single = value as f32;
    let single = match f64::from(single) {
        above if above > high => single.next_down(),
        below if below < low => single.next_up(),
        _ => single,
    };
    single.into()
}

/// Pulses of all channels: values of the axes, and [`LEAVE`] for the others.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "whole numbers within the limits"
)]
pub(super) fn pulses(axes: &[Axis], value: impl Fn(usize) -> f64) -> [u16; CHANNELS] {
    let mut pulses = [LEAVE; CHANNELS];
    for (index, axis) in axes.iter().enumerate() {
        if let Target::Channel(channel) = axis.place {
            pulses[usize::from(channel) - 1] = value(index) as u16;
        }
    }
    pulses
}

/// Pulses that release the channels of the axes.
pub(super) fn releases(axes: &[Axis]) -> [u16; CHANNELS] {
    pulses(axes, |_| f64::from(RELEASE))
}

/// Overrides of channels, to a system and component.
pub(super) fn override_message((system, component): (u8, u8), pulses: [u16; CHANNELS]) -> MavMessage {
    let mut data = RC_CHANNELS_OVERRIDE_DATA::DEFAULT;
    [
        data.chan1_raw,
        data.chan2_raw,
        data.chan3_raw,
        data.chan4_raw,
        data.chan5_raw,
        data.chan6_raw,
        data.chan7_raw,
        data.chan8_raw,
    ] = pulses;
    (data.target_system, data.target_component) = (system, component);
    MavMessage::RC_CHANNELS_OVERRIDE(data)
}

/// Surge speed, astern if negative, and yaw rate; 0 without an axis for it. A velocity alone would turn the boat round to
/// go astern.
#[expect(clippy::cast_possible_truncation, reason = "values have the precision of the message")]
#[expect(deprecated, reason = "ArduPilot ignores the successor of this frame")]
pub(super) fn set_point_message(
    (system, component): (u8, u8),
    axes: &[Axis],
    value: impl Fn(usize) -> f64,
) -> MavMessage {
    let mut data = SET_POSITION_TARGET_LOCAL_NED_DATA::DEFAULT;
    for (index, axis) in axes.iter().enumerate() {
        match axis.place {
            Target::Surge => data.vx = value(index) as f32,
            Target::YawRate => data.yaw_rate = value(index) as f32,
            Target::Channel(_) => {}
        }
    }
    data.coordinate_frame = MavFrame::MAV_FRAME_BODY_NED;
    // All but the velocity and the yaw rate.
    data.type_mask = PositionTargetTypemask::from_bits_truncate(0b0101_1110_0111);
    (data.target_system, data.target_component) = (system, component);
    MavMessage::SET_POSITION_TARGET_LOCAL_NED(data)
}
