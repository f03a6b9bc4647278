//! Models as plants: the motion from the model, the pose by kinematics.
//!
//! Every [`Model`](crate::model::Model) with the outputs `u` and `r` is a plant: a vessel with given parameters, or an
//! identified model of any kind. A [`Simulation`] runs it freely, sample by sample, without measurements. The motion
//! is relative to the water; a [current](Simulation::with_current) moves the vessel over ground.
//!
//! An [`InputMap`] names the inputs that push the vessel and those that turn it, by their [roles](find_roles), within the limits of the boat ([`input_values`]).
//! [`record()`] writes simulated logs.
//!
//! ```
//! use hydroid::model::Model;
//! use hydroid::plant::{InputMap, Simulation};
//! use hydroid_core::craft::Craft;
//!
//! let model = Model::of_vessel(&Craft::simple(), 0.1)?;
//! let map = InputMap::find(&model)?;
//! let mut simulation = Simulation::new(&model)?;
//! simulation.start([0.0; 3], &[1.0, 0.0, 0.0], &map.command(0.5, 0.0));
//! for _ in 0..100 {
//!     simulation.advance(&map.command(0.5, 0.2));
//! }
//! assert!(simulation.heading() > 0.0, "a positive steering order turns to starboard");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod free_run;
mod input_map;
mod outside;
mod record;
mod roles;
mod simulation;
mod station;

pub use error::PlantError;
pub use free_run::FreeRun;
pub use input_map::{InputMap, LEAST_SHARE, Steering};
pub use outside::Outside;
pub(crate) use outside::believed;
pub(crate) use record::process_deviations;
#[doc(hidden)]
pub use record::rest;
pub use record::{Commands, Record, RecordOptions, member_tracks, record};
pub(crate) use roles::values_by;
pub use roles::{described_inputs, find_roles, input_values};
pub(crate) use simulation::middle;
pub use simulation::{Motion, Simulation, arc, current_before};
pub use station::check_station;
