//! Errors of the setup.

use hydroid_core::guidance::PathError;
use hydroid_core::model::CraftModelError;

use crate::adapt::AdaptError;
use crate::boat::BoatError;
use crate::closed_loop::{ClosedLoopError, WaypointsError};
use crate::model::{CurrentError, ModelError};
use crate::plant::PlantError;

/// Options that do not fit together, or do not fit model and plant.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum SetupError {
    /// Options that contradict each other or the vessel; the message names option and remedy.
    #[error("{0}")]
    Option(String),
    /// The size of a vessel cannot be found.
    #[error(
        "the defaults of task and controller follow from simulated tests of the model on a straight course and in a turn, which failed"
    )]
    Defaults(#[source] Box<ClosedLoopError>),
    #[error(transparent)]
    Boat(#[from] BoatError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Vessel(#[from] CraftModelError),
    #[error(transparent)]
    Current(#[from] CurrentError),
    #[error(transparent)]
    Plant(#[from] PlantError),
    #[error(transparent)]
    Adapt(#[from] AdaptError),
    #[error(transparent)]
    Waypoints(#[from] WaypointsError),
    #[error(transparent)]
    Path(#[from] PathError),
    #[error(transparent)]
    ClosedLoop(#[from] ClosedLoopError),
}

impl SetupError {
    pub(super) fn option(message: impl Into<String>) -> Self {
        Self::Option(message.into())
    }
}

/// An error with the message unless the condition holds.
pub(super) fn ensure(holds: bool, message: impl FnOnce() -> String) -> Result<(), SetupError> {
    if holds { Ok(()) } else { Err(SetupError::Option(message())) }
}
