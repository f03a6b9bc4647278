//! Why there is no controller.

/// Why a controller cannot be made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ControlError {
    /// A setting is not what it must be.
    Setting {
        /// Which.
        what: &'static str,
        /// What was given.
        value: f64,
        /// What is needed.
        needed: &'static str,
    },
    /// There are not as many limits as commands.
    Count {
        /// Commands.
        expected: usize,
        /// Limits.
        given: usize,
    },
    /// Two independent accelerations need two commands.
    TooFewInputs {
        /// How many there are.
        given: usize,
    },
    /// Limits of a command are not finite, not in order, or its rate limit is not positive.
    Limits {
        /// The command, from 0.
        channel: usize,
    },
    /// Within the limits of a command its effect is not invertible: an angle goes beyond a quarter of a turn.
    NotInvertible {
        /// The command, from 0.
        channel: usize,
    },
    /// A lag does not settle, or does not move with its command.
    Lag {
        /// The command, from 0.
        channel: usize,
    },
}

impl core::fmt::Display for ControlError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Setting { what, value, needed } => write!(f, "{what} is {value}: {needed}"),
            Self::Count { expected, given } => {
                write!(f, "limits for {expected} commands are needed, and there are {given}")
            }
            Self::TooFewInputs { given } => {
                write!(f, "a point in the plane needs at least 2 commands, and there are {given}")
            }
            Self::Limits { channel } => write!(
                f,
                "limits of command {channel} must be finite and in order, and its rate limit positive (infinite for none)"
            ),
            Self::NotInvertible { channel } => write!(
                f,
                "command {channel} acts through its sine, and its limits go beyond a quarter of a turn: give narrower ones"
            ),
            Self::Lag { channel } => write!(
                f,
                "what follows command {channel} does not settle, or does not move with it: its equation cannot be inverted"
            ),
        }
    }
}

impl core::error::Error for ControlError {}

/// `value`, if it is finite and at least `least` (or more, where `least` is not enough).
pub(super) fn at_least(what: &'static str, value: f64, least: f64) -> Result<f64, ControlError> {
    if value.is_finite() && value >= least {
        Ok(value)
    } else {
        Err(ControlError::Setting { what, value, needed: "0 or more is needed" })
    }
}

/// `value`, if it is finite and greater than 0.
pub(super) fn positive(what: &'static str, value: f64) -> Result<f64, ControlError> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(ControlError::Setting { what, value, needed: "a finite number greater than 0 is needed" })
    }
}
