//! Variables that a model computes from inputs and past samples.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use num_traits::Float;

use super::shape::Real;
use crate::actuator::lag_step;

/// A variable beyond outputs and inputs, which it follows in the order in which a model lists the signals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case", deny_unknown_fields))]
pub enum Signal {
    /// State of a first-order actuator lag, not measured: `T da/dt = c - a`, exact for a command held over a sample:
    /// `a(t + h) = c + (a(t) - c) exp(-h/T)`.
    Lag {
        /// The input `c`.
        input: u16,
        /// The time constant `T` \[s\].
        time_constant_s: Real,
    },
    /// A past value: of an output, interpolated linearly between samples, or of an input, held.
    Past {
        /// The output or input.
        variable: u16,
        /// How many samples ago, at least 1.
        samples: u16,
    },
}

impl Signal {
    /// Number of time constants after which a wrong initial lag state has decayed to `exp(-7)`, a thousandth.
    pub const SETTLING: f64 = 7.0;

    /// Display name, `lag(n, 1.5 s)` or `u(-0.5 s)`; `names` are those of outputs and inputs.
    pub fn name(&self, names: &[impl AsRef<str>], dt: f64) -> String {
        let name = |variable: u16| names.get(usize::from(variable)).map_or("?", AsRef::as_ref);
        match *self {
            Self::Lag { input, time_constant_s } => {
                format!("lag({}, {} s)", name(input), rounded(time_constant_s.0))
            }
            Self::Past { variable, samples } => {
                format!("{}(-{} s)", name(variable), rounded(f64::from(samples) * dt))
            }
        }
    }

    /// The output or input from which the signal is computed; it has the same unit.
    pub fn source(&self) -> u16 {
        match *self {
            Self::Lag { input, .. } => input,
            Self::Past { variable, .. } => variable,
        }
    }

    /// Whether the signal is constant over a sample, as past inputs are.
    pub fn is_held(&self, outputs: usize) -> bool {
        match *self {
            Self::Lag { .. } => false,
            Self::Past { variable, .. } => usize::from(variable) >= outputs,
        }
    }

    /// Number of samples after which the unknown past before a run has no effect.
    pub fn warm_up(&self, dt: f64) -> usize {
        match *self {
            Self::Lag { time_constant_s, .. } => {
                // Bounded below any usize; a NaN becomes 0.
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                let samples = Float::ceil(Self::SETTLING * time_constant_s.0 / dt).clamp(0.0, 1e9) as usize;
                samples
            }
            Self::Past { samples, .. } => usize::from(samples),
        }
    }

    /// The signal at each sample of a run, from its source; NaN during the warm-up.
    pub fn series(&self, source: &[f64], dt: f64) -> Vec<f64> {
        let mut values = Vec::with_capacity(source.len());
        match *self {
            Self::Lag { time_constant_s, .. } => {
                let decay = Float::exp(-dt / time_constant_s.0);
                let mut state = f64::NAN;
                for &command in source {
                    values.push(state);
                    state = lag_step(state, command, decay);
                }
            }
            Self::Past { samples, .. } => {
                let known = source.len().saturating_sub(usize::from(samples));
                values.resize(source.len() - known, f64::NAN);
                values.extend_from_slice(&source[..known]);
            }
        }
        let warm_up = self.warm_up(dt).min(values.len());
        values[..warm_up].fill(f64::NAN);
        values
    }

    pub(super) fn is_valid(&self, outputs: usize, inputs: usize) -> bool {
        match *self {
            Self::Lag { input, time_constant_s } => {
                (outputs..outputs + inputs).contains(&usize::from(input))
                    && time_constant_s.0.is_finite()
                    && time_constant_s.0 > 0.0
            }
            Self::Past { variable, samples } => usize::from(variable) < outputs + inputs && samples > 0,
        }
    }
}

fn rounded(seconds: f64) -> f64 {
    Float::round(seconds * 1e3) / 1e3
}
