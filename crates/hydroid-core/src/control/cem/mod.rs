//! Model predictive control by the cross-entropy method, on any predictor.
//!
//! A plan is a sequence of commands over the horizon. [`Planner`] draws candidates around the plan of the sample before,
//! lets a session predict their outputs ([`Predictor::rollout_batch`](crate::predict::Predictor::rollout_batch)), and moves to the best of them, some times over. It needs
//! nothing of a model but its predictions: identified equations, networks with hidden states, vessels, with what they have
//! learned until this sample.

mod cost;
mod gauss_newton;
mod options;
mod planner;

pub use cost::{Cost, SoftLimit};
pub use options::PlannerOptions;
pub use planner::{Plan, Planner};
