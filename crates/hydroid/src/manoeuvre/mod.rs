//! Manoeuvring trials, simulated with any plant.
//!
//! Definitions follow IMO resolution MSC.137(76), *Standards for ship manoeuvrability* (2002), with its explanatory notes
//! MSC/Circ.1053, and the ITTC recommended procedures 7.5-04-02-01, *Full scale manoeuvring trials*, and 7.5-02-06-03,
//! *Validation of manoeuvring simulation models*. Each trial begins on a
//! straight course at a steady speed ([`Approach`]); the steering is stated in the unit of the input that turns the vessel
//! ([`Steering`](crate::plant::Steering)). Body frame: forward, starboard, down; headings clockwise.
//!
//! ```
//! use hydroid::manoeuvre::{Approach, Options, turning_circle};
//! use hydroid::model::Model;
//! use hydroid::plant::{InputMap, Simulation};
//! use hydroid_core::craft::Craft;
//!
//! let model = Model::of_vessel(&Craft::simple(), 0.1)?;
//! let map = InputMap::find(&model)?;
//! let approach = Approach::new(&model, &map, Simulation::new(&model)?, &Options::default())?;
//! let (circle, track) = turning_circle(&approach, &map, 0.5, 600.0);
//! assert!(circle.tactical_diameter_m > circle.transfer_m);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod approach;
mod error;
mod figure;
mod left_out;
mod located;
mod measured;
mod pull_out;
mod recognised;
mod response;
mod settling;
mod speed_trials;
mod spiral;
mod track;
mod trials;
mod turning_circle;
mod walk;
mod zigzag;

pub use approach::{Approach, Options};
pub use error::ManoeuvreError;
pub use figure::{Criterion, Figure};
pub use left_out::interval_words;
pub(crate) use left_out::trial_errors;
pub use located::Located;
pub use measured::{Comparison, ComparisonError, MeasuredApproach, compare, write_comparisons_csv};
pub use pull_out::{PullOut, pull_out};
pub use recognised::{Ordered, Recognised, RecognisedKind, recognise};
pub use response::{Response, SurgeResponse};
pub use speed_trials::{Acceleration, Stopping, acceleration, stopping};
pub use spiral::{Spiral, SpiralPoint, spiral};
pub use track::Track;
pub use trials::{LeftOut, Trial, TrialKind, TrialOptions, Trials, trials};
pub(crate) use trials::{not_identified, not_valid};
pub use turning_circle::{SteadyTurn, TurningCircle, turning_circle};
pub use zigzag::{Zigzag, zigzag};
