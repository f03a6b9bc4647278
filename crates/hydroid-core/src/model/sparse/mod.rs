//! Sparse equations `dy/dt = Xi theta(y, c)`: terms, their evaluation, and the session that rolls them out.

mod equations;
mod program;
mod session;
mod term;

pub use equations::{Equations, EquationsError};
pub use program::{Program, ProgramError};
pub use session::EquationsSession;
pub use term::{Factor, Shape, Term};
