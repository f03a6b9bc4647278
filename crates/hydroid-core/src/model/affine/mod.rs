//! The control-affine network: a feed-forward network of the outputs whose motion is affine in known maps of the actuators, by
//! construction, so that control laws invert it as they do equations
//! ([`AffineNetwork`](crate::control::AffineNetwork)).

mod field;
mod model;
mod session;

pub(crate) use field::Field;
pub use model::{ControlAffine, ControlAffineError, Effector};
pub use session::ControlAffineSession;
