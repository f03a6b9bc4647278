//! Sparse identification of nonlinear dynamics: `dy/dt = Xi theta(y, c)` with few non-zero coefficients.

mod active_set;
mod assemble;
mod constraints;
mod criterion;
mod ensemble;
mod error;
mod fit;
mod kernel;
mod library;
mod options;
mod robust;
mod search;
mod stepwise;
mod stlsq;
mod triangle;
mod window;

pub use assemble::{Assembled, Streaming, assemble, assemble_with};
pub use constraints::{Coefficient, ConstraintError, Constraints, Equality, Sign};
pub use criterion::{Criterion, stepwise_both_ways};
pub use ensemble::{Bagging, Ensemble};
pub use error::FitError;
pub use fit::{Fit, Prepared};
pub use kernel::{Kernel, Nodes, Regression, Rows};
pub use library::Library;
pub use options::{FitOptions, Optimizer, Preparation, Scaling};
pub use robust::{Huber, Loss, Sizes};
pub use search::{Found, Grid, SearchError, Trial, search, substeps};
pub use stepwise::stepwise;
pub use stlsq::{SparseSolution, Stlsq, stlsq};
pub use triangle::{BLOCK_ROWS, Solution, Triangle};
pub use window::{NOISE_SHARE, noise, weak_from_noise};
