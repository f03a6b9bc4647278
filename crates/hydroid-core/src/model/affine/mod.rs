//! The control-affine network: a feed-forward network whose dynamics are affine in known actuator maps, so that control
//! laws can invert it.

mod field;
mod model;
mod session;

pub(crate) use field::Field;
pub use model::{ControlAffine, ControlAffineError, Effector};
pub use session::ControlAffineSession;
