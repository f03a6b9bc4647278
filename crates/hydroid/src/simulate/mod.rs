//! Simulated logs: a plant, an excitation, measurement noise.
//!
//! [`simulate`] runs a vessel from rest at the origin, heading north, and gives a [`Simulated`] record: what
//! was commanded, what was measured and what was true. The same [`Options`] give the same record to the
//! last bit, on any number of threads; commands and noise come from separate streams of random numbers, so
//! that the noise may change and the commands stay.
//!
//! ```
//! use std::ops::ControlFlow;
//! use hydroid::excitation::Excitation;
//! use hydroid::simulate::{Options, simulate};
//! use hydroid_core::vessel::VesselParams;
//!
//! let options = Options { duration_s: 60.0, seed: 7, ..Options::new(VesselParams::hydrofoil(), Excitation::Mixed) };
//! let record = simulate(&options, &mut |_| ControlFlow::Continue(()))?;
//! assert_eq!(record.len(), 600);
//! let run = record.to_trajectory(&["u", "v", "r"])?;
//! assert_eq!(run.inputs.channels()[0].name, "PP_cmd");
//! # Ok::<(), hydroid::simulate::SimulateError>(())
//! ```

mod error;
mod options;
mod path;
mod pilot;
mod plan;
mod record;
mod run;
mod vessel_file;
mod write;

pub use error::SimulateError;
pub use options::Options;
pub use record::Simulated;
pub use run::simulate;
pub use vessel_file::{VesselFileError, built_in, load_vessel, parse_vessel, vessel_toml};
pub(crate) use write::Shortest;
