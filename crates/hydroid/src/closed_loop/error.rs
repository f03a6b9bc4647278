//! Errors of the closed loop.

use hydroid_core::control::ControlError;
use hydroid_core::guidance::PathError;

use crate::adapt::AdaptError;
use crate::boat::Role;
use crate::key::key;
use crate::manoeuvre::ManoeuvreError;
use crate::model::NotInvertible;
use crate::plant::PlantError;

/// Wrong input to a closed loop, or cancellation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum ClosedLoopError {
    #[error("the track is invalid: {0}")]
    Path(#[from] PathError),
    #[error(
        "the path leaves the fence at {north:.1} m north, {east:.1} m east: make the {} larger, keep {} off the path, or make the path smaller",
        key("fence"),
        key("keep_out")
    )]
    Fence { north: f64, east: f64 },
    #[error("the controller is invalid: {0}")]
    Control(#[from] ControlError),
    #[error(transparent)]
    Adapt(#[from] AdaptError),
    /// Number out of range.
    #[error("{what} is {value}; {needed}")]
    Option { what: &'static str, value: f64, needed: &'static str },
    #[error("the controller {law} needs a model: give a model, or use pid, which needs none")]
    NoModel { law: &'static str },
    #[error("the controller pid uses no model: leave the model out, or use cem, fl or backstepping")]
    UnexpectedModel,
    #[error("{law} cannot invert this model: {why}. Use cem, which only needs predictions{remedy}")]
    NotAffine {
        law: &'static str,
        /// Reason, with channel names.
        why: String,
        /// Further remedy.
        remedy: String,
    },
    #[error("the model does not fit this plant: {0}")]
    Channels(String),
    #[error(
        "the evaluation starts at {from_s} s, but the run takes {duration_s} s: give a smaller {} or a longer {}",
        key("evaluate_from"),
        key("duration")
    )]
    EvaluationStart { from_s: f64, duration_s: f64 },
    #[error(
        "a delay of {delay_s} s is not a whole number of samples of {dt_s} s: give {} or {}",
        rounded(dt_s * (delay_s / dt_s).floor()),
        rounded(dt_s * (delay_s / dt_s).ceil())
    )]
    Delay { delay_s: f64, dt_s: f64 },
    #[error(
        "the adapter has {weights} weights, but the model of the control law has {coefficients}: switch all_terms off, or use cem"
    )]
    WeightCount { weights: usize, coefficients: usize },
    #[error(
        "the plant is a model with samples of {own_s} s, and the controller has samples of {dt_s} s: identify both with the same {}",
        key("dt")
    )]
    PlantStep { dt_s: f64, own_s: f64 },
    #[error(
        "{what} needs a vessel with given parameters as the plant: an identified model has no forces and no mass"
    )]
    NeedsVessel { what: &'static str },
    #[error(transparent)]
    Plant(#[from] PlantError),
    #[error(transparent)]
    Manoeuvre(#[from] ManoeuvreError),
    #[error(
        "no gains of the autopilot hold this track: give a larger {}, a lower {} or a lower {}",
        key("radius"),
        key("turn_speed"),
        key("speed")
    )]
    Untunable,
    #[error(
        "pid holds the speed, and {0}: use cem, or state the input that pushes the vessel, as in {role}",
        role = key("role").is("NAME=propulsion")
    )]
    NoPropulsion(String),
    #[error(
        "{law} cannot be used with this model: '{input}' is a {role}, which cannot be commanded, and the law solves for all inputs. Use cem or pid"
    )]
    NotCommanded { law: &'static str, input: String, role: Role },
    #[error("interrupted")]
    Cancelled,
}

impl ClosedLoopError {
    pub(super) fn not_invertible(error: NotInvertible, law: &'static str) -> Self {
        match error {
            NotInvertible::NotAffine(why, remedy) => Self::NotAffine { law, why, remedy },
            NotInvertible::Control(error) => Self::Control(error),
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
