//! Why there is no simulated record.

use hydroid_core::vessel::InvalidParams;

use crate::excitation::ExcitationError;

/// Wrong input to a simulation, or a simulation that did not come to an end.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// Parameters that describe no vessel.
    #[error("the vessel is not possible: {0}")]
    Vessel(#[from] InvalidParams),
    /// The excitation does not fit the vessel, or is wrong in itself.
    #[error(transparent)]
    Excitation(#[from] ExcitationError),
    /// A time or a scale that makes no sense.
    #[error("{what} is {value}; {needed}")]
    Option {
        /// Which option.
        what: &'static str,
        /// What was given.
        value: f64,
        /// What is needed.
        needed: &'static str,
    },
    /// The sample time is no multiple of the integration step.
    #[error("the sample time of {dt_s} s is not a whole number of integration steps of {step_s} s")]
    Substeps {
        /// Sample time \[s\].
        dt_s: f64,
        /// Integration step \[s\].
        step_s: f64,
    },
    /// The state was no longer finite.
    #[error(
        "the simulation diverged at {t_s} s: is the integration step of {step_s} s short enough for this vessel?"
    )]
    Diverged {
        /// Time \[s\].
        t_s: f64,
        /// Integration step \[s\].
        step_s: f64,
    },
    /// A low-speed run that did not stay below its ceiling: turning must be what drives this vessel.
    #[error("the low-speed run reached {reached:.3} m/s at {t_s} s, and not below {ceiling} m/s")]
    NotSlow {
        /// Time \[s\].
        t_s: f64,
        /// Speed \[m/s\].
        reached: f64,
        /// What was to be its ceiling \[m/s\].
        ceiling: f64,
    },
    /// The callback asked to stop.
    #[error("cancelled")]
    Cancelled,
    /// An output that the record does not have.
    #[error("the record has no measured column {name}{}; it has {}", nearest.as_ref().map(|n| format!(" (did you mean {n}?)")).unwrap_or_default(), known.join(", "))]
    UnknownOutput {
        /// What was asked for.
        name: String,
        /// The nearest that there is, if one is near.
        nearest: Option<String>,
        /// All that there are.
        known: Vec<String>,
    },
}
