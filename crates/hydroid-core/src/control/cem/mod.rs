//! Model predictive control (MPC) by the cross-entropy method (CEM), on any predictor.
//!
//! A plan is a command sequence over the horizon. [`Planner`] draws candidates around the last plan, predicts their
//! outputs ([`Predictor::rollout_batch`](crate::predict::Predictor::rollout_batch)), and moves to the best of them. It
//! uses only predictions: the model can be equations, a network or a vessel, with present state and weights.

mod cost;
mod gauss_newton;
mod options;
mod planner;

pub use cost::{Cost, SoftLimit};
pub use options::PlannerOptions;
pub use planner::{Plan, Planner};
