//! Settings of a closed loop as data: plant, model and options become a simulation, or a controller on board.
//!
//! [`ClosedLoopOptions`] has the options of `hydroid control` under the same names, all with defaults. [`Setup`] makes
//! scenario, conditions and controller of them.
//!
//! ```
//! use hydroid::config::control::{ClosedLoopOptions, NamedModel, Setup};
//! use hydroid::closed_loop::ControlMethod;
//! use hydroid::progress::silent;
//!
//! let options = ClosedLoopOptions {
//!     controller: ControlMethod::FeedbackLinearization,
//!     speed: Some(4.0),
//!     radius: Some(30.0),
//!     ..ClosedLoopOptions::default()
//! };
//! let vessel = NamedModel::read("hydrofoil".as_ref())?;
//! let setup = Setup::new(options, Some(vessel), None)?;
//! let mut controller = setup.controller.controller(setup.conditions.seed)?;
//! let simulated = setup.simulate(controller.as_mut(), None, &mut silent())?;
//! assert!(simulated.metrics.held);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[macro_use]
mod given;

mod checks;
mod controller;
mod document;
mod error;
mod options;
mod route;
mod setup;

pub use document::{Document, Simulated};
pub use error::SetupError;
pub use options::{ClosedLoopOptions, Points, TaskKind};
pub use setup::{NamedModel, Setup, active_weights};
