//! Outputs of the autopilot as commands: the pulses of channels that its mixer turns into them.
//!
//! ArduPilot Rover takes no command for an output. In mode MANUAL its outputs follow the channels of steering and throttle
//! (`RCMAP_ROLL` 1 and `RCMAP_THROTTLE` 3; `RC_Channel::pwm_to_angle_dz`, `AP_MotorsUGV::output_skid_steering`):
//!
//! ```text
//! value = (pulse - TRIM - DZ) / (MAX - TRIM - DZ)            of a channel above its dead zone; below likewise with MIN
//! left  = throttle + steering    right = throttle - steering    SERVOn_FUNCTION 73 and 74; 26 is steering, 70 throttle
//! pulse = TRIM + value (MAX - TRIM)                          of an output, or (TRIM - MIN) for a negative value
//! ```
//!
//! `SERVOn_REVERSED` and `RCn_REVERSED` turn the sign of a value. While the throttle is astern, steering has the other sign
//! unless `PILOT_STEER_TYPE` is 3. What is wanted of two sides is within the range of the mixer: `|throttle| + |steering|` is the
//! larger of them. The mixer of another firmware or with a thrust curve is another one: the parameters of the curve must be 0, and the
//! outputs that the autopilot reports must confirm those that are wanted.

use std::collections::VecDeque;

use super::helm::{Axis, Target};

/// Channels of steering and throttle.
const STICKS: [(u8, &str); 2] = [(1, "steering"), (3, "throttle")];

/// Pulses \[us\] of a channel whose limits are not known: the defaults of `RCn_MIN`, `RCn_TRIM`, `RCn_MAX`.
const PULSES_US: [f64; 3] = [1100.0, 1500.0, 1900.0];

/// Parameters that must have a value, and that some releases do not have.
const NEEDED: [(&str, f64); 4] =
    [("RCMAP_ROLL", 1.0), ("RCMAP_THROTTLE", 3.0), ("MOT_THST_EXPO", 0.0), ("MOT_THR_MIN", 0.0)];

/// Difference of a reported output from those that are wanted \[us\]: both are whole pulses.
const TOLERANCE_US: f64 = 10.0;

/// Commands end if no report has confirmed them for as long.
const CONFIRMED_NS: i64 = 1_000_000_000;

/// Time that an output may need beside its slew rate.
const LATE_NS: i64 = 500_000_000;

/// An output and what it may be.
type Output = crate::Axis<u8>;

/// Parameters of the autopilot by name.
type Parameters<'a> = &'a dyn Fn(&str) -> Option<f64>;

/// Outputs as commands.
#[derive(Clone, Debug)]
pub(super) struct Mixer {
    outputs: Vec<Output>,
    /// Outputs that were wanted, with their times.
    wanted: VecDeque<(i64, Vec<f64>)>,
    /// The newest report, with its time.
    reported: Option<(i64, Vec<f64>)>,
    /// How it differs from what is wanted.
    difference: Option<String>,
    /// When a report was as wanted, or the commands began.
    confirmed_ns: i64,
}

/// Whether the steering has the other sign while the throttle is astern.
fn turns_round(value: Parameters<'_>) -> bool {
    value("PILOT_STEER_TYPE") != Some(3.0)
}

/// The number of an output, of a field of `SERVO_OUTPUT_RAW`.
pub(super) fn output(topic: &str, field: &str) -> Option<u8> {
    let number = field.strip_prefix("servo")?.strip_suffix("_raw")?;
    number.parse().ok().filter(|_| topic == "SERVO_OUTPUT_RAW")
}

/// A pulse width with its trim and ends \[us\].
struct Scale {
    low: f64,
    trim: f64,
    high: f64,
    dead_zone: f64,
    sign: f64,
}

impl Scale {
    fn of(kind: &str, number: u8, value: Parameters<'_>) -> Option<Self> {
        let of = |field: &str| value(&format!("{kind}{number}_{field}"));
        let scale = Self {
            low: of("MIN")?,
            trim: of("TRIM")?,
            high: of("MAX")?,
            dead_zone: of("DZ").unwrap_or(0.0),
            sign: if of("REVERSED").unwrap_or(0.0) == 0.0 { 1.0 } else { -1.0 },
        };
        let Self { low, trim, high, dead_zone, .. } = scale;
        (low < trim - dead_zone && trim + dead_zone < high && dead_zone >= 0.0).then_some(scale)
    }

    /// From -1 to 1.
    fn value(&self, pulse: f64) -> f64 {
        let Self { low, trim, high, .. } = *self;
        let span = if pulse < trim { trim - low } else { high - trim };
        (self.sign * (pulse - trim) / span).clamp(-1.0, 1.0)
    }

    /// The pulse of a channel for a value, beyond its dead zone.
    fn pulse(&self, value: f64) -> f64 {
        let Self { low, trim, high, dead_zone, sign } = *self;
        let value = sign * value;
        match value {
            _ if value > 0.0 => trim + dead_zone + value * (high - trim - dead_zone),
            _ if value < 0.0 => trim - dead_zone + value * (trim - low - dead_zone),
            _ => trim,
        }
    }
}

impl Mixer {
    /// # Errors
    /// If there are more outputs than the mixer has.
    pub(super) fn new(outputs: Vec<Output>) -> Result<Self, String> {
        if outputs.len() > STICKS.len() {
            let names: Vec<&str> = outputs.iter().map(|output| output.name.as_str()).collect();
            return Err(format!(
                "{} are outputs of the autopilot, which has two sticks for them: command RC_CHANNELS.chan1_raw and chan3_raw",
                names.join(", ")
            ));
        }
        Ok(Self {
            outputs,
            wanted: VecDeque::new(),
            reported: None,
            difference: None,
            confirmed_ns: i64::MIN,
        })
    }

    /// The channels as commands.
    pub(super) fn channels() -> Vec<Axis> {
        let [low, trim, high] = PULSES_US;
        STICKS
            .map(|(channel, name)| crate::Axis::new(name, [low, high], trim).at(Target::Channel(channel)))
            .to_vec()
    }

    /// Names of the parameters that all releases have, and of those that some do not have.
    pub(super) fn parameters(&self) -> [Vec<String>; 2] {
        let of = |kind: &str, number: u8, fields: &[&str]| -> Vec<String> {
            fields.iter().map(|field| format!("{kind}{number}_{field}")).collect()
        };
        let outputs = self
            .outputs
            .iter()
            .flat_map(|output| of("SERVO", output.place, &["FUNCTION", "MIN", "TRIM", "MAX", "REVERSED"]));
        let sticks = STICKS.iter().flat_map(|(channel, _)| of("RC", *channel, &["MIN", "MAX", "REVERSED"]));
        let others = NEEDED.iter().map(|(name, _)| (*name).to_owned());
        let optional = ["PILOT_STEER_TYPE", "MOT_SLEWRATE"].map(str::to_owned);
        [
            outputs.chain(sticks).collect(),
            others.filter(|name| name != "RCMAP_THROTTLE").chain(optional).collect(),
        ]
    }

    /// What keeps outputs from being commands, each with a remedy. Parameters that are not known yet are no reason: the helm waits
    /// for them.
    pub(super) fn refusals(&self, value: Parameters<'_>) -> Vec<String> {
        let mut refusals = Vec::new();
        for (name, needed) in NEEDED {
            if let Some(value) = value(name).filter(|value| *value != needed) {
                refusals.push(format!(
                    "{name} is {value}: outputs are commanded by the channels of the sticks, for which it must be {needed}; set it, \
                     or identify a model of the inputs RC_CHANNELS.chan1_raw and chan3_raw"
                ));
            }
        }
        let functions: Vec<Option<f64>> =
            self.outputs.iter().map(|output| value(&format!("SERVO{}_FUNCTION", output.place))).collect();
        if functions.iter().all(Option::is_some) {
            let mut known: Vec<f64> = functions.iter().flatten().copied().collect();
            known.sort_by(f64::total_cmp);
            if known != [73.0, 74.0] && known != [26.0, 70.0] {
                let text: Vec<String> = self
                    .outputs
                    .iter()
                    .zip(&known)
                    .map(|(output, _)| {
                        let function = value(&format!("SERVO{}_FUNCTION", output.place)).unwrap_or(f64::NAN);
                        format!("SERVO{}_FUNCTION is {function}", output.place)
                    })
                    .collect();
                refusals.push(format!(
                    "{}: outputs are commanded as left and right throttle (73 and 74) or as steering and throttle (26 and 70)",
                    text.join(", ")
                ));
            }
        }
        refusals
    }

    /// The pulses of steering and throttle for wanted outputs; `None` if a parameter is not known or contradicts itself.
    pub(super) fn pulses(&self, outputs: &[f64], value: Parameters<'_>) -> Option<[f64; 2]> {
        let [mut steering, throttle] = self.sticks(outputs, value)?;
        if throttle < 0.0 && turns_round(value) {
            steering = -steering;
        }
        let [steer, drive] = STICKS.map(|(channel, _)| Scale::of("RC", channel, value));
        Some([steer?.pulse(steering), drive?.pulse(throttle)])
    }

    /// Steering and throttle, from -1 to 1, for wanted outputs.
    fn sticks(&self, outputs: &[f64], value: Parameters<'_>) -> Option<[f64; 2]> {
        let (mut steering, mut throttle) = (0.0, 0.0);
        for (output, pulse) in self.outputs.iter().zip(outputs) {
            let pulse = if pulse.is_finite() { pulse.clamp(output.low, output.high) } else { output.rest };
            let wanted = Scale::of("SERVO", output.place, value)?.value(pulse);
            match value(&format!("SERVO{}_FUNCTION", output.place))? {
                73.0 => (steering, throttle) = (steering + 0.5 * wanted, throttle + 0.5 * wanted),
                74.0 => (steering, throttle) = (steering - 0.5 * wanted, throttle + 0.5 * wanted),
                26.0 => steering = wanted,
                70.0 => throttle = wanted,
                _ => return None,
            }
        }
        Some([steering, throttle])
    }

    /// Why the outputs cannot be watched.
    pub(super) fn unseen(&self, now_ns: i64) -> Option<String> {
        let is_new =
            self.reported.as_ref().is_some_and(|(at_ns, _)| now_ns.saturating_sub(*at_ns) <= CONFIRMED_NS);
        (!is_new).then(|| {
            "the autopilot does not report its outputs, which confirm the commands: it must send SERVO_OUTPUT_RAW at least \
             twice a second"
                .to_owned()
        })
    }

    /// Commands begin with the neutral outputs, from those that are reported.
    pub(super) fn begin(&mut self, now_ns: i64) {
        self.wanted.clear();
        self.confirmed_ns = now_ns;
        if let Some((_, outputs)) = &self.reported {
            let outputs =
                self.outputs.iter().map(|output| of(outputs, output).unwrap_or(output.rest)).collect();
            self.wanted.push_back((now_ns, outputs));
        }
        self.wanted.push_back((now_ns, self.outputs.iter().map(|output| output.rest).collect()));
    }

    /// Remembers what is wanted.
    pub(super) fn want(&mut self, outputs: &[f64], value: Parameters<'_>, now_ns: i64) {
        self.wanted.push_back((now_ns, outputs.to_vec()));
        self.forget(value, now_ns);
    }

    /// Forgets what an output has left behind at its slew rate. The newest one counts, however old it is.
    fn forget(&mut self, value: Parameters<'_>, now_ns: i64) {
        // From one end to the other.
        let slew = value("MOT_SLEWRATE").filter(|rate| *rate > 0.0).map_or(0.0, |rate| 200.0 / rate);
        #[expect(clippy::cast_possible_truncation, reason = "a time of seconds")]
        let window = (1e9 * slew) as i64 + LATE_NS;
        while self.wanted.len() > 1 && now_ns.saturating_sub(self.wanted[1].0) > window {
            self.wanted.pop_front();
        }
    }

    /// Takes a report of all outputs.
    pub(super) fn report(&mut self, reported: &[f64], value: Parameters<'_>, now_ns: i64) {
        self.reported = Some((now_ns, reported.to_vec()));
        self.forget(value, now_ns);
        self.difference = self.find_difference(reported, value);
        if self.difference.is_none() {
            self.confirmed_ns = now_ns;
        }
    }

    /// Lowest and highest pulse that an output may have on its way from what was wanted to what is: the throttle goes there at its slew
    /// rate and the steering at once, so that each may be anywhere in its range, and what the sides make of both in none of theirs. While
    /// the throttle crosses zero the steering may have either sign.
    fn range(&self, output: &Output, value: Parameters<'_>) -> Option<[f64; 2]> {
        let mut ranges = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for (_, outputs) in &self.wanted {
            for ([low, high], x) in ranges.iter_mut().zip(self.sticks(outputs, value)?) {
                (*low, *high) = (low.min(x), high.max(x));
            }
        }
        let [mut steer, drive] = ranges;
        let most = |[low, high]: [f64; 2]| low.abs().max(high.abs());
        if drive[0] < 0.0 && drive[1] > 0.0 && turns_round(value) {
            steer = [-most(steer), most(steer)];
        }
        // What is beyond the range of the mixer is scaled to it.
        let sum = (most(steer) + most(drive)).max(1.0);
        let scaled =
            |low: f64, high: f64| [low.min(low / sum), high.max(high / sum)].map(|x| x.clamp(-1.0, 1.0));
        let values = match value(&format!("SERVO{}_FUNCTION", output.place))? {
            73.0 => scaled(drive[0] + steer[0], drive[1] + steer[1]),
            74.0 => scaled(drive[0] - steer[1], drive[1] - steer[0]),
            26.0 => steer,
            _ => drive,
        };
        let scale = Scale::of("SERVO", output.place, value)?;
        let [a, b] = values.map(|x| scale.pulse(x));
        Some([a.min(b), a.max(b)])
    }

    /// How a report differs from what is wanted.
    fn find_difference(&self, reported: &[f64], value: Parameters<'_>) -> Option<String> {
        self.outputs.iter().enumerate().find_map(|(index, output)| {
            let wanted = self.wanted.iter().filter_map(|(_, outputs)| outputs.get(index));
            let (low, high) = wanted.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
            // Limits of the output may be narrower than what its parameters say.
            let [low, high] = self.range(output, value).map_or([low, high], |[a, b]| [low.min(a), high.max(b)]);
            let pulse = of(reported, output)?;
            let is_within = pulse >= low - TOLERANCE_US && pulse <= high + TOLERANCE_US;
            (low <= high && !is_within).then(|| {
                format!(
                    "the output of '{}' is {pulse} us, and between {low:.0} and {high:.0} us are wanted: the mixer of the \
                     autopilot is another one than its parameters say",
                    output.name
                )
            })
        })
    }

    /// Why commands must end.
    pub(super) fn unconfirmed(&self, now_ns: i64) -> Option<String> {
        if now_ns.saturating_sub(self.confirmed_ns) <= CONFIRMED_NS {
            return None;
        }
        self.unseen(now_ns).or_else(|| self.difference.clone())
    }
}

/// An output of a report of all.
fn of(reported: &[f64], output: &Output) -> Option<f64> {
    reported.get(usize::from(output.place).checked_sub(1)?).copied()
}

#[cfg(test)]
mod tests;
