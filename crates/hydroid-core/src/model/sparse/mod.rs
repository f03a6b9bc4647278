//! Sparse equations `dy/dt = Xi theta(y, c, s)`: terms, their evaluation, and the session.

mod equations;
mod jacobian;
mod memory;
mod program;
mod sensitivity;
mod session;
mod shape;
mod signal;
mod term;

pub(crate) use equations::BatchRollout;
pub use equations::{Equations, EquationsError};
pub use jacobian::Jacobian;
pub use program::{Program, ProgramError};
pub use sensitivity::Sensitivity;
pub use session::EquationsSession;
pub use shape::{Gate, Real, Shape};
pub use signal::Signal;
pub use term::{Factor, Term};
