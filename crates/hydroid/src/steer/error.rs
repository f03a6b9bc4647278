//! Why there is no voyage.

use hydroid_core::control::ControlError;
use hydroid_core::guidance::PathError;
use hydroid_core::vessel::InvalidParams;

use crate::adapt::AdaptError;

/// Wrong input to a closed loop, or one that did not come to an end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SteerError {
    /// Parameters that describe no vessel.
    #[error("the vessel is not possible: {0}")]
    Vessel(#[from] InvalidParams),
    /// No such path or speed.
    #[error("the course is not possible: {0}")]
    Path(#[from] PathError),
    /// No such law.
    #[error("the controller is not possible: {0}")]
    Control(#[from] ControlError),
    /// Nothing here can learn so.
    #[error(transparent)]
    Adapt(#[from] AdaptError),
    /// A number that makes no sense.
    #[error("{what} is {value}; {needed}")]
    Option {
        /// Which.
        what: &'static str,
        /// What was given.
        value: f64,
        /// What is needed.
        needed: &'static str,
    },
    /// A law that needs a model has none.
    #[error("{law} steers by a model: give one, or use pid, which has none")]
    NoModel {
        /// The law.
        law: &'static str,
    },
    /// The autopilot has no use for a model.
    #[error("pid steers without a model: leave the model out, or use cem, fl or backstepping")]
    NeedlessModel,
    /// The law cannot invert the model.
    #[error(
        "{law} cannot invert this model: {why}. Use cem, which asks of a model only that it predicts{remedy}"
    )]
    NotAffine {
        /// The law.
        law: &'static str,
        /// The reason, with names.
        why: String,
        /// What else could be done.
        remedy: &'static str,
    },
    /// The model is not of this plant.
    #[error("the model cannot steer this plant: {0}")]
    Channels(String),
    /// The voyage is over before anything counts.
    #[error(
        "errors are to count from {from_s} s on, and the voyage takes {duration_s} s: give a --from below that, or a longer --duration"
    )]
    From {
        /// From when on \[s\].
        from_s: f64,
        /// Of the voyage \[s\].
        duration_s: f64,
    },
    /// A delay between samples.
    #[error(
        "a delay of {delay_s} s is not a whole number of samples of {dt_s} s: give {} or {}",
        rounded(dt_s * (delay_s / dt_s).floor()),
        rounded(dt_s * (delay_s / dt_s).ceil())
    )]
    Delay {
        /// Asked for \[s\].
        delay_s: f64,
        /// Sample time \[s\].
        dt_s: f64,
    },
    /// What the model learns does not fit the law.
    #[error(
        "{weights} numbers are learned, and the law takes over {places}: learn the terms that the model has (all_terms off), or use cem"
    )]
    Places {
        /// Of the learner.
        weights: usize,
        /// Of the law.
        places: usize,
    },
    /// The sample time of the loop is no multiple of the integration step.
    #[error("the sample time of {dt_s} s is not a whole number of integration steps of {step_s} s")]
    Substeps {
        /// Sample time \[s\].
        dt_s: f64,
        /// Integration step \[s\].
        step_s: f64,
    },
    /// No tuning brought the autopilot along the course.
    #[error(
        "no tuning of the autopilot holds this course: give turns a larger --radius or a lower --turn-speed, or a lower --speed"
    )]
    Untunable,
    /// The callback asked to stop.
    #[error("interrupted before it was done")]
    Cancelled,
}

/// To a microsecond: `3 * 0.1` is `0.3`.
fn rounded(seconds: f64) -> f64 {
    (1e6 * seconds).round() / 1e6
}

pub(super) fn positive(what: &'static str, value: f64) -> Result<(), SteerError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(SteerError::Option { what, value, needed: "a number greater than 0 is needed" })
    }
}

pub(super) fn at_least(what: &'static str, value: f64, least: f64) -> Result<(), SteerError> {
    if value.is_finite() && value >= least {
        Ok(())
    } else {
        Err(SteerError::Option { what, value, needed: "a number of 0 or more is needed" })
    }
}
