//! Closed loops: a controller on the true plant, with noise, current, wind, delay and limits, and what came of it.
//!
//! A [`Helm`] steers: a control law ([`Law`]) or a plan on any model; [`Steering`] makes one for a [`Model`](crate::model::Model),
//! which may learn on the way. [`sail`] takes it along a [`Course`] through [`Conditions`] and gives a [`Voyage`], sample by
//! sample; [`Metrics`] are its figures, [`fleet`] does many of them side by side, [`tune`] finds gains of the autopilot.
//!
//! ```
//! use hydroid::progress::silent;
//! use hydroid::steer::{Conditions, Course, Kind, Metrics, Pace, Scene, Steering, Task, sail};
//! use hydroid_core::vessel::VesselParams;
//!
//! let vessel = VesselParams::simple();
//! let course = Course::new(&Task::Circle { radius: 10.0 }, &Pace::cruise(1.5))?;
//! let scene = Scene::new(vessel.clone(), course);
//! let mut steering = Steering::new(Kind::FeedbackLinearization, &vessel, 0.1);
//! steering.model = Some(std::sync::Arc::new(hydroid::model::Model::of_vessel(&vessel, 0.1)?));
//! steering.lead = 1.0;
//! let mut helm = steering.helm(0)?;
//! let voyage = sail(&scene, &Conditions::calm(1), helm.as_mut(), &mut silent())?;
//! assert!(Metrics::of(&voyage, 40.0).rms_position < 0.005);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod channels;
mod course;
mod error;
mod fleet;
mod guide;
mod helm;
mod inverted;
mod metrics;
mod mind;
mod moving;
mod planned;
mod random;
mod sail;
mod sea;
mod steering;
mod tune;
mod write;

pub use course::{Course, Pace, Task};
pub use error::SteerError;
pub use fleet::{Fleet, Outing, Spread, Summary, fleet};
pub use guide::Timing;
pub use helm::{Helm, Law, Sight};
pub use metrics::{Metrics, Times};
pub use sail::{Moment, Scene, Voyage, sail};
pub use sea::{Conditions, Wind};
pub use steering::{Kind, Steering};
pub use tune::{Tuned, Tuning, tune};
