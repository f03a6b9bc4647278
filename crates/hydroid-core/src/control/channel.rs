//! How one command acts.

use core::f64::consts::FRAC_PI_2;

use num_traits::Float;

/// How an actuator's position `a` enters the motion: `phi(a)`, increasing, and known with its inverse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Map {
    /// `phi(a) = a`.
    #[default]
    Identity,
    /// `phi(a) = sin(a)`, of an angle within a quarter of a turn: a rudder.
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

    /// The `a` whose effect is `effort`; the nearest there is, where none has it.
    pub fn inverse(self, effort: f64) -> f64 {
        match self {
            Self::Identity => effort,
            Self::Sine => Float::asin(effort.clamp(-1.0, 1.0)),
            Self::SignedSquare => Float::sqrt(effort.abs()) * Float::signum(effort),
        }
    }

    /// Whether it is invertible between two positions.
    pub(super) fn is_invertible(self, low: f64, high: f64) -> bool {
        match self {
            Self::Identity | Self::SignedSquare => true,
            Self::Sine => -FRAC_PI_2 <= low && high <= FRAC_PI_2,
        }
    }
}

/// How an actuator's position `a` follows its command `c`.
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

    /// `[decay, gain, offset]` of `a+ = decay a + gain c + offset`, what `dt` seconds under a held command make of it,
    /// exactly.
    pub(super) fn over(self, dt: f64) -> [f64; 3] {
        match self {
            Self::None => [0.0, 1.0, 0.0],
            Self::FirstOrder { rate, gain, offset } => {
                let grows = Float::exp_m1(rate * dt) / rate;
                [Float::exp(rate * dt), gain * grows, offset * grows]
            }
        }
    }

    /// Whether it settles, and moves with its command.
    pub(super) fn is_invertible(self) -> bool {
        match self {
            Self::None => true,
            Self::FirstOrder { rate, gain, offset } => {
                rate.is_finite() && rate < 0.0 && gain.is_finite() && gain != 0.0 && offset.is_finite()
            }
        }
    }
}

/// How one command acts on the motion, as a model has it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Channel {
    /// How the actuator follows the command.
    pub lag: Lag,
    /// How the actuator enters the motion.
    pub map: Map,
}

/// What a command may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Lowest value, in the unit of the command.
    pub low: f64,
    /// Highest value.
    pub high: f64,
    /// How fast it may change, per second; infinite for no limit.
    pub rate: f64,
}

impl Limits {
    /// Lowest and highest value, and any rate.
    pub const fn between([low, high]: [f64; 2]) -> Self {
        Self { low, high, rate: f64::INFINITY }
    }

    /// The same with a limit on the rate, per second.
    #[must_use]
    pub const fn with_rate(self, rate: f64) -> Self {
        Self { rate, ..self }
    }

    pub(super) fn are_possible(&self) -> bool {
        self.low.is_finite() && self.high.is_finite() && self.low < self.high && self.rate > 0.0
    }
}
