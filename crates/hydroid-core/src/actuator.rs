//! Actuators: actuator lags (first-order lags), command maps, saturation and rate limits.
//!
//! A command `c` moves the position `a` of an actuator (a force, an angle, revolutions). The motion depends on the
//! effort `phi(a)`:
//!
//! ```text
//! T da/dt = c - a,        effort = phi(a)
//! a(t + h) = c + (a(t) - c) exp(-h / T)        exact while the command is held
//! ```

use core::f64::consts::FRAC_PI_2;

use num_traits::Float;

/// The effort `phi(a)` of an actuator at position `a`: an increasing function with a known inverse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Map {
    /// `phi(a) = a`.
    #[default]
    Identity,
    /// `phi(a) = sin(a)`, `|a| <= pi/2`: a rudder.
    Sine,
    /// `phi(a) = a |a|`: the thrust of a propeller by its revolutions (Fossen 2021, section 9.1).
    SignedSquare,
}

impl Map {
    /// `phi(a)`.
    pub fn value(self, a: f64) -> f64 {
        match self {
            Self::Identity => a,
            Self::Sine => Float::sin(a),
            Self::SignedSquare => a * a.abs(),
        }
    }

    /// `d phi / da`.
    pub fn slope(self, a: f64) -> f64 {
        match self {
            Self::Identity => 1.0,
            Self::Sine => Float::cos(a),
            Self::SignedSquare => 2.0 * a.abs(),
        }
    }

    /// The position with this effort; the nearest one where the effort is out of range.
    pub fn inverse(self, effort: f64) -> f64 {
        match self {
            Self::Identity => effort,
            Self::Sine => Float::asin(effort.clamp(-1.0, 1.0)),
            Self::SignedSquare => Float::sqrt(effort.abs()) * Float::signum(effort),
        }
    }

    pub(crate) fn is_invertible(self, low: f64, high: f64) -> bool {
        match self {
            Self::Identity | Self::SignedSquare => true,
            Self::Sine => -FRAC_PI_2 <= low && high <= FRAC_PI_2,
        }
    }
}

/// The response of an actuator's position `a` to its command `c`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Lag {
    /// `a = c`.
    #[default]
    None,
    /// `da/dt = rate a + gain c + offset`.
    FirstOrder {
        /// Less than 0 \[1/s\].
        rate: f64,
        /// Not 0 \[1/s\].
        gain: f64,
        /// Unit of `a` per second.
        offset: f64,
    },
}

impl Lag {
    /// `T da/dt = c - a`, `T` in seconds.
    pub fn of_time_constant(seconds: f64) -> Self {
        Self::FirstOrder { rate: -1.0 / seconds, gain: 1.0 / seconds, offset: 0.0 }
    }

    /// `[decay, gain, offset]` of the exact step `a+ = decay a + gain c + offset` over `dt` seconds, `c` held.
    pub(crate) fn discretize(self, dt: f64) -> [f64; 3] {
        match self {
            Self::None => [0.0, 1.0, 0.0],
            Self::FirstOrder { rate, gain, offset } => {
                let grows = Float::exp_m1(rate * dt) / rate;
                [Float::exp(rate * dt), gain * grows, offset * grows]
            }
        }
    }

    pub(crate) fn is_invertible(self) -> bool {
        match self {
            Self::None => true,
            Self::FirstOrder { rate, gain, offset } => {
                rate.is_finite() && rate < 0.0 && gain.is_finite() && gain != 0.0 && offset.is_finite()
            }
        }
    }
}

/// The path of one command to the motion: lag, then map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Channel {
    /// Lag from command to position.
    pub lag: Lag,
    /// Map from position to effort.
    pub map: Map,
}

/// Limits of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Lowest value, in the unit of the command.
    pub low: f64,
    /// Highest value.
    pub high: f64,
    /// Largest rate of change, per second; infinite for no limit.
    pub rate: f64,
    /// Command of an actuator at rest: no thrust, rudder amidships.
    pub rest: f64,
}

impl Limits {
    /// Lowest and highest value, without a limit on the rate; at rest the value nearest to 0.
    pub const fn between([low, high]: [f64; 2]) -> Self {
        // A range without order is refused where it is used.
        let rest = if low > 0.0 {
            low
        } else if high < 0.0 {
            high
        } else {
            0.0
        };
        Self { low, high, rate: f64::INFINITY, rest }
    }

    /// These limits with another command at rest: 1500 for a pulse of 1100 to 1900 us.
    #[must_use]
    pub const fn with_rest(self, rest: f64) -> Self {
        Self { rest, ..self }
    }

    /// These limits with a limit on the rate, per second.
    #[must_use]
    pub const fn with_rate(self, rate: f64) -> Self {
        Self { rate, ..self }
    }

    /// Limits of an input that is not commanded, as of the wind: it has one value.
    pub const fn held(value: f64) -> Self {
        Self { low: value, high: value, rate: f64::INFINITY, rest: value }
    }

    /// Whether the input is not commanded.
    pub const fn are_held(&self) -> bool {
        self.low == self.high
    }

    /// Half of the range.
    pub(crate) const fn half(&self) -> f64 {
        0.5 * (self.high - self.low)
    }

    pub(crate) fn are_ordered(&self) -> bool {
        self.low.is_finite()
            && self.high.is_finite()
            && self.low <= self.high
            && self.rate > 0.0
            && (self.low..=self.high).contains(&self.rest)
    }
}

/// Clamps a command sequence (one row for each sample of `dt` seconds) to its limits and, from `last` on, rate limits.
///
/// # Panics
/// If `last` is shorter than `limits`, not finite, or not within them.
pub fn clamp_to_limits(sequence: &mut [f64], last: &[f64], limits: &[Limits], dt: f64) {
    let inputs = limits.len();
    for (i, limits) in limits.iter().enumerate() {
        let (mut before, change) = (last[i], limits.rate * dt);
        for at in (i..sequence.len()).step_by(inputs) {
            let low = (before - change).max(limits.low);
            let high = (before + change).min(limits.high);
            sequence[at] = sequence[at].clamp(low, high);
            before = sequence[at];
        }
    }
}

/// The lag state after its difference to the held command has decayed by the factor `decay`. An unknown state (NaN, at
/// the start of a run) is at rest under its first command.
#[inline]
pub(crate) fn lag_step(state: f64, command: f64, decay: f64) -> f64 {
    if state.is_nan() { command } else { command + (state - command) * decay }
}

/// Weight of an actuator's difference to its command in the first stage of RK4, for a sample of `samples` time
/// constants.
///
/// ```text
/// w + 4 exp(-x/2) + exp(-x) = 6 (1 - exp(-x)) / x
/// ```
///
/// With this weight the four stages together use the mean of the actuator over the sample. With the weight 1, an
/// actuator that is fast compared with a sample would act a sixth of a sample late. For a slow actuator `w` is 1 to the
/// fourth order of `x`.
pub fn rk4_first_stage(samples: f64) -> f64 {
    let mean = -Float::exp_m1(-samples) / samples;
    6.0 * mean - 4.0 * Float::exp(-0.5 * samples) - Float::exp(-samples)
}
