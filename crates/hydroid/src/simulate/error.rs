//! Errors of a simulation.

use crate::excitation::ExcitationError;

/// Wrong input to a simulation, divergence, or cancellation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum SimulateError {
    #[error(transparent)]
    Excitation(#[from] ExcitationError),
    /// Number out of range.
    #[error("{what} is {value}; {needed}")]
    Option { what: &'static str, value: f64, needed: &'static str },
    #[error("the sample time of {dt_s} s is not a whole number of integration steps of {step_s} s")]
    Substeps { dt_s: f64, step_s: f64 },
    #[error(
        "the simulation diverged at {t_s} s: is the integration step of {step_s} s short enough for this vessel?"
    )]
    Diverged { t_s: f64, step_s: f64 },
    #[error("the low-speed run reached {reached:.3} m/s at {t_s} s, and not below {ceiling} m/s")]
    NotSlow { t_s: f64, reached: f64, ceiling: f64 },
    #[error("cancelled")]
    Cancelled,
    #[error("the record has no measured column {name}{}; it has {}", nearest.as_ref().map(|n| format!(" (did you mean {n}?)")).unwrap_or_default(), known.join(", "))]
    UnknownOutput { name: String, nearest: Option<String>, known: Vec<String> },
}
