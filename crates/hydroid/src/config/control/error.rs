//! Errors of the setup.

use hydroid_core::guidance::PathError;
use hydroid_core::model::PlantModelError;

use crate::adapt::AdaptError;
use crate::closed_loop::{ClosedLoopError, WaypointsError};
use crate::log::units::UnitError;
use crate::model::{CurrentError, ModelError};
use crate::plant::PlantError;

/// Options that do not fit together, or do not fit model and plant.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SetupError {
    /// Options that contradict each other or the vessel; the message names option and remedy.
    #[error("{0}")]
    Option(String),
    /// Limits of a command in a unit that is not one of its quantity.
    #[error("--limit {name}: the unit [{unit}]")]
    Unit {
        /// The command.
        name: String,
        /// The unit.
        unit: String,
        /// Cause.
        source: UnitError,
    },
    /// The size of a vessel cannot be found.
    #[error(
        "the defaults of task and controller follow from simulated tests of the model on a straight course and in a turn, which failed"
    )]
    Defaults(#[source] Box<ClosedLoopError>),
    /// A model cannot be read.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A vessel does not have the sample time.
    #[error(transparent)]
    Vessel(#[from] PlantModelError),
    /// The model cannot estimate a current.
    #[error(transparent)]
    Current(#[from] CurrentError),
    /// The vessel has no inputs for the task.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The model cannot be adapted.
    #[error(transparent)]
    Adapt(#[from] AdaptError),
    /// A file of way-points cannot be used.
    #[error(transparent)]
    Waypoints(#[from] WaypointsError),
    /// The path cannot be used.
    #[error(transparent)]
    Path(#[from] PathError),
    /// The closed loop refuses the options.
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
