//! Models: discrete steps `state+ = f(state, c)`, `y = g(state)`, with constant weights inside and state outside.

pub mod affine;
pub mod direct;
mod persistence;
mod plant;
pub mod recurrent;
pub mod sparse;

pub use persistence::Persistence;
pub use plant::{PlantModel, PlantModelError, PlantSession};
