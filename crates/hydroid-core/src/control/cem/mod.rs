//! Model predictive control (MPC) by the cross-entropy method (CEM), on any predictor.
//!
//! A plan is a command sequence over the horizon. [`Planner`] draws candidates around the last plan, predicts their
//! outputs, and moves to the best of them. Any [`Predictor`](crate::predict::Predictor) can be the model.

mod cost;
mod gauss_newton;
mod options;
mod planner;

pub use cost::{Cost, SoftLimit};
pub use options::PlannerOptions;
pub use planner::{Plan, Planner};
