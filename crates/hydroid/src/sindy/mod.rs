//! Sparse identification of nonlinear dynamics: `dy/dt = Xi theta(y, c)` with few non-zero coefficients.

mod assemble;
mod expression;
mod fit;
mod kernel;
mod library;
mod rewrite;
mod search;
mod stepwise;
mod stlsq;
mod triangle;

pub use assemble::{Assembled, assemble};
pub use expression::{Coefficient, Constraint, ExpressionError, Relation, Vocabulary};
pub use fit::{Fit, FitError, FitOptions, Optimizer, Prepared, Scaling};
pub use kernel::{Kernel, Nodes, Regression, Rows};
pub use library::{Family, Kind, Library, UnknownLibrary, Variables};
pub use rewrite::{gated, replaced};
pub use search::{Found, Grid, SearchError, Trial, search, substeps};
pub use stepwise::stepwise;
pub use stlsq::{SparseSolution, Stlsq, stlsq};
pub use triangle::{BLOCK_ROWS, Solution, Triangle};
