//! Errors of a simulation.

use hydroid_core::vessel::InvalidParams;

use crate::excitation::ExcitationError;

/// Wrong input to a simulation, divergence, or cancellation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// Invalid vessel parameters.
    #[error("the vessel is invalid: {0}")]
    Vessel(#[from] InvalidParams),
    /// Invalid excitation.
    #[error(transparent)]
    Excitation(#[from] ExcitationError),
    /// Number out of range.
    #[error("{what} is {value}; {needed}")]
    Option {
        /// Option.
        what: &'static str,
        /// Given value.
        value: f64,
        /// Permitted values.
        needed: &'static str,
    },
    /// The sample time is not a multiple of the integration step.
    #[error("the sample time of {dt_s} s is not a whole number of integration steps of {step_s} s")]
    Substeps {
        /// Sample time \[s\].
        dt_s: f64,
        /// Integration step \[s\].
        step_s: f64,
    },
    /// Non-finite state.
    #[error(
        "the simulation diverged at {t_s} s: is the integration step of {step_s} s short enough for this vessel?"
    )]
    Diverged {
        /// Time \[s\].
        t_s: f64,
        /// Integration step \[s\].
        step_s: f64,
    },
    /// Low-speed run above its ceiling.
    #[error("the low-speed run reached {reached:.3} m/s at {t_s} s, and not below {ceiling} m/s")]
    NotSlow {
        /// Time \[s\].
        t_s: f64,
        /// Speed \[m/s\].
        reached: f64,
        /// Ceiling \[m/s\].
        ceiling: f64,
    },
    /// Cancelled.
    #[error("cancelled")]
    Cancelled,
    /// Unknown output.
    #[error("the record has no measured column {name}{}; it has {}", nearest.as_ref().map(|n| format!(" (did you mean {n}?)")).unwrap_or_default(), known.join(", "))]
    UnknownOutput {
        /// Given name.
        name: String,
        /// Nearest known name.
        nearest: Option<String>,
        /// Known names.
        known: Vec<String>,
    },
}
