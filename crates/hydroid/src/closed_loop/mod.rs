//! Closed-loop simulation: a controller on the true plant, with measurement noise, current, wind, delay and command
//! limits.
//!
//! A [`ClosedLoopController`] computes the commands: a control law ([`ControlLaw`]) or model predictive control.
//! [`ControllerOptions`] builds it for a [`Model`](crate::model::Model), which may adapt during the run. [`run()`]
//! simulates a [`Scenario`] under [`Conditions`] and returns a [`Run`] of samples. [`Metrics`] summarizes a run,
//! [`monte_carlo()`] simulates many runs in parallel, and [`tune_autopilot`] searches the gains of the autopilot.
//!
//! ```
//! use hydroid::closed_loop::{
//!     Conditions, ControlMethod, ControllerOptions, Metrics, Scenario, SpeedOptions, Task, Track, run,
//! };
//! use hydroid::progress::silent;
//! use hydroid_core::craft::Craft;
//!
//! let vessel = Craft::simple();
//! let track = Track::new(&Task::Circle { radius: 10.0 }, &SpeedOptions::cruise(1.5))?;
//! let scenario = Scenario::new(vessel.clone(), track);
//! let mut control = ControllerOptions::new(ControlMethod::FeedbackLinearization, &scenario.plant, 0.1);
//! control.model = Some(std::sync::Arc::new(hydroid::model::Model::of_vessel(&vessel, 0.1)?));
//! control.lead = 1.0;
//! let mut controller = control.controller(0)?;
//! let run = run(&scenario, &Conditions::calm(1), controller.as_mut(), &mut silent())?;
//! assert!(Metrics::of(&run, 40.0).rms_position < 0.005);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod actuator_check;
mod autopilot;
mod channel_map;
mod controller;
mod csv;
mod disturbance;
mod error;
mod guidance;
mod inversion;
mod metrics;
mod missions;
mod monte_carlo;
mod options;
mod perturbed;
mod pilot;
mod plant;
mod predictive;
mod random;
mod reference;
mod repeats;
mod run;
mod scale;
mod session_model;
mod simulated;
mod track;
mod tuning;
mod way;
mod waypoints;

pub use actuator_check::{ActuatorCheck, ActuatorFault};
pub use autopilot::AutopilotGains;
pub use controller::{ClosedLoopController, ControlLaw, ModelSession, Observation};
pub use disturbance::{Conditions, Wind};
pub use error::ClosedLoopError;
pub use guidance::{Guidance, Guided, Measured};
pub use metrics::{Metrics, Times};
pub use missions::Purpose;
pub use monte_carlo::{Dispersion, MonteCarlo, Summary, Trial, monte_carlo};
pub use options::{ControlMethod, ControllerOptions, Instruments};
pub use pilot::{Elapsed, Pilot, QUANTITIES, Seen, longest_gap};
pub use plant::{TruePlant, limits_of};
pub use reference::Timing;
pub use repeats::Repeats;
pub use run::{Run, Sample, Scenario, run};
pub use scale::Scale;
pub use track::{SpeedOptions, Task, Track};
pub use tuning::{GridPoint, TunedAutopilot, tune_autopilot};
pub use waypoints::{Waypoints, WaypointsError, local_position};
