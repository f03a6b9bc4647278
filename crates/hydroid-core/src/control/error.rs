//! Errors of controllers.

/// Reasons why a controller cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum ControlError {
    /// An option is out of range.
    #[error("{what} is {value}: {needed}")]
    Setting { what: &'static str, value: f64, needed: &'static str },
    #[error("{expected} commands need as many limits, and there are {given}")]
    Count { expected: usize, given: usize },
    /// There are fewer than two commands, the minimum for two independent accelerations.
    #[error("a point in the plane needs at least 2 commands, and there are {given}")]
    TooFewInputs { given: usize },
    #[error(
        "limits of command {channel} must be finite and in order, its value at rest between them, and its rate limit positive (infinite for none)"
    )]
    Limits {
        /// The command, from 0.
        channel: usize,
    },
    #[error("command {channel} acts through its sine, and its limits exceed 90 degrees: give narrower ones")]
    NotInvertible {
        /// The command, from 0.
        channel: usize,
    },
    #[error(
        "the lag of command {channel} is unstable or independent of the command: its equation cannot be inverted"
    )]
    Lag {
        /// The command, from 0.
        channel: usize,
    },
}

pub(super) fn at_least(what: &'static str, value: f64, least: f64) -> Result<f64, ControlError> {
    if value.is_finite() && value >= least {
        Ok(value)
    } else {
        Err(ControlError::Setting { what, value, needed: "0 or more is needed" })
    }
}

pub(super) fn positive(what: &'static str, value: f64) -> Result<f64, ControlError> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(ControlError::Setting { what, value, needed: "a finite number greater than 0 is needed" })
    }
}
