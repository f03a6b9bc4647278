//! Sparse identification of nonlinear dynamics: `dy/dt = Xi theta(y, c)` with few non-zero coefficients.

mod assemble;
mod kernel;
mod triangle;

pub use assemble::{Assembled, assemble};
pub use kernel::{Kernel, Nodes, Regression, Rows};
pub use triangle::{BLOCK_ROWS, Solution, Triangle};
