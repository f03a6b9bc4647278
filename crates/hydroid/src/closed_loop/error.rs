//! Errors of the closed loop.

use hydroid_core::control::ControlError;
use hydroid_core::guidance::PathError;
use hydroid_core::vessel::InvalidParams;

use crate::adapt::AdaptError;
use crate::manoeuvre::ManoeuvreError;
use crate::model::NotInvertible;
use crate::plant::PlantError;

/// Wrong input to a closed loop, or cancellation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClosedLoopError {
    /// Invalid vessel parameters.
    #[error("the vessel is invalid: {0}")]
    Vessel(#[from] InvalidParams),
    /// Invalid path or speed.
    #[error("the track is invalid: {0}")]
    Path(#[from] PathError),
    /// Invalid controller.
    #[error("the controller is invalid: {0}")]
    Control(#[from] ControlError),
    /// Invalid adaptation.
    #[error(transparent)]
    Adapt(#[from] AdaptError),
    /// Number out of range.
    #[error("{what} is {value}; {needed}")]
    Option {
        /// Quantity.
        what: &'static str,
        /// Given value.
        value: f64,
        /// Permitted values.
        needed: &'static str,
    },
    /// Missing model.
    #[error("the controller {law} needs a model: give a model, or use pid, which needs none")]
    NoModel {
        /// The law.
        law: &'static str,
    },
    /// Model given to the autopilot.
    #[error("the controller pid uses no model: leave the model out, or use cem, fl or backstepping")]
    UnexpectedModel,
    /// The control law cannot invert the model.
    #[error("{law} cannot invert this model: {why}. Use cem, which only needs predictions{remedy}")]
    NotAffine {
        /// The law.
        law: &'static str,
        /// Reason, with channel names.
        why: String,
        /// Further remedy.
        remedy: &'static str,
    },
    /// The model's channels do not fit the plant.
    #[error("the model does not fit this plant: {0}")]
    Channels(String),
    /// The run ends before the evaluation starts.
    #[error(
        "the evaluation starts at {from_s} s, but the run takes {duration_s} s: give a smaller --evaluate-from or a longer --duration"
    )]
    EvaluationStart {
        /// Start of the evaluation \[s\].
        from_s: f64,
        /// Duration of the run \[s\].
        duration_s: f64,
    },
    /// The delay is not a whole number of samples.
    #[error(
        "a delay of {delay_s} s is not a whole number of samples of {dt_s} s: give {} or {}",
        rounded(dt_s * (delay_s / dt_s).floor()),
        rounded(dt_s * (delay_s / dt_s).ceil())
    )]
    Delay {
        /// Given delay \[s\].
        delay_s: f64,
        /// Sample time \[s\].
        dt_s: f64,
    },
    /// The adapter's weights do not match the model of the control law.
    #[error(
        "the adapter has {weights} weights, but the model of the control law has {coefficients}: switch all_terms off, or use cem"
    )]
    WeightCount {
        /// Weights of the adapter.
        weights: usize,
        /// Coefficients of the law's model.
        coefficients: usize,
    },
    /// The sample time of the loop is not a multiple of the integration step.
    #[error("the sample time of {dt_s} s is not a whole number of integration steps of {step_s} s")]
    Substeps {
        /// Sample time \[s\].
        dt_s: f64,
        /// Integration step \[s\].
        step_s: f64,
    },
    /// A model has another sample time than the loop.
    #[error(
        "the plant is a model with samples of {own_s} s, and the controller has samples of {dt_s} s: identify both with the same --dt"
    )]
    PlantStep {
        /// Sample time of the loop \[s\].
        dt_s: f64,
        /// Of the plant \[s\].
        own_s: f64,
    },
    /// A condition that an identified model does not know.
    #[error(
        "{what} needs a vessel with given parameters as the plant: an identified model has no forces and no mass"
    )]
    NeedsVessel {
        /// The condition.
        what: &'static str,
    },
    /// A model is not a plant, or its inputs are unknown.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The response of a model cannot be measured.
    #[error(transparent)]
    Manoeuvre(#[from] ManoeuvreError),
    /// No gains of the autopilot hold the track.
    #[error(
        "no gains of the autopilot hold this track: give a larger --radius, a lower --turn-speed or a lower --speed"
    )]
    Untunable,
    /// Cancelled by the progress callback.
    #[error("interrupted")]
    Cancelled,
}

impl ClosedLoopError {
    pub(super) fn not_invertible(error: NotInvertible, law: &'static str) -> Self {
        match error {
            NotInvertible::NotAffine(why, remedy) => Self::NotAffine { law, why, remedy },
            NotInvertible::Control(error) => Self::Control(error),
            NotInvertible::Vessel(error) => Self::Vessel(error),
        }
    }
}

/// Rounds to a microsecond, so that `3 * 0.1` prints as `0.3`.
fn rounded(seconds: f64) -> f64 {
    (1e6 * seconds).round() / 1e6
}

pub(super) fn positive(what: &'static str, value: f64) -> Result<(), ClosedLoopError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(ClosedLoopError::Option { what, value, needed: "a number greater than 0 is needed" })
    }
}

pub(super) fn at_least(what: &'static str, value: f64, least: f64) -> Result<(), ClosedLoopError> {
    if value.is_finite() && value >= least {
        Ok(())
    } else {
        Err(ClosedLoopError::Option { what, value, needed: "a number of 0 or more is needed" })
    }
}
