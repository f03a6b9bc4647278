//! The control-affine network: a feed-forward network, affine in known actuator maps, which control laws can invert.

mod field;
mod model;
mod session;

pub(crate) use field::Field;
pub use model::{ControlAffine, ControlAffineError, Effector};
pub use session::ControlAffineSession;
