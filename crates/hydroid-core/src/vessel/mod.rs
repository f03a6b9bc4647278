//! States of surface vessels in three degrees of freedom, kinematics, integration, and the numbers of the equations of
//! motion, whose vessels are in [`craft`](crate::craft).

mod dual;
pub mod kinematics;
mod lanes;
mod number;
pub mod rk4;
mod state;

pub use dual::Dual;
pub(crate) use lanes::Lanes;
pub use number::{Number, Real};
pub use state::{Command, State};
