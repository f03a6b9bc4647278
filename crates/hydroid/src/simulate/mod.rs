//! Simulated logs: plant, excitation, measurement noise.
//!
//! [`simulate`] runs a vessel from rest at the origin, heading north, and returns a [`Simulated`] record of commands,
//! measurements and truth. Equal [`Options`] give equal records to the last bit, for any number of threads. Commands
//! and noise have separate random streams, so that the noise can change without the commands.
//!
//! ```
//! use std::ops::ControlFlow;
//! use hydroid::excitation::Excitation;
//! use hydroid::simulate::{Options, simulate};
//! use hydroid_core::craft::Craft;
//!
//! let options = Options { duration_s: 60.0, seed: 7, ..Options::new(Craft::hydrofoil(), Excitation::Mixed) };
//! let record = simulate(&options, &mut |_| ControlFlow::Continue(()))?;
//! assert_eq!(record.len(), 600);
//! let run = record.to_trajectory(&["u", "v", "r"])?;
//! assert_eq!(run.inputs.channels()[0].name, "PP_cmd");
//! # Ok::<(), hydroid::simulate::SimulateError>(())
//! ```

mod error;
mod options;
mod path;
mod path_controller;
mod plan;
mod record;
mod run;
mod write;

pub use error::SimulateError;
pub use options::Options;
pub use record::Simulated;
pub use run::simulate;
