//! Models: discrete steps `state+ = f(state, c)`, `y = g(state)`. Weights are part of the model, the state is not.

pub mod affine;
pub mod committee;
mod craft;
pub mod direct;
mod persistence;
mod plant;
pub mod recurrent;
pub mod sparse;

pub use craft::{CraftModel, CraftSession};
pub use persistence::Persistence;
pub use plant::{PlantModel, PlantModelError, PlantSession};
