//! Sparse identification of nonlinear dynamics (`SINDy`: Brunton, Proctor and Kutz, PNAS 113 (2016) 3932):
//! `dy/dt = Xi theta(y, c)` with few non-zero coefficients.

mod active_set;
mod assemble;
mod constraints;
mod criterion;
mod ensemble;
mod error;
pub mod expression;
mod fit;
mod library;
mod nelder_mead;
mod noise;
mod options;
mod parsimony;
mod qr;
mod refine;
mod regression_form;
mod robust;
mod search;
mod stability;
mod stepwise;
mod stlsq;
mod structure;
mod structure_constraints;
mod structure_search;
mod substitution;

pub use assemble::{Assembled, AssemblyOptions, assemble, assemble_with};
pub use constraints::{Coefficient, ConstraintError, Constraints, Equality, Sign};
pub use criterion::{Criterion, stepwise_bidirectional};
pub use ensemble::{BootstrapOptions, Ensemble};
pub use error::FitError;
pub use expression::{Constraint, ExpressionError, ExpressionParser, Relation};
pub use fit::{Fit, LinearRegression};
pub use library::{Family, Library, UnknownLibrary, VariableKind, Variables};
pub use nelder_mead::{NelderMeadOptions, nelder_mead};
pub use noise::{NOISE_SHARE, noise_std, spike_share, weak_form_from_noise};
pub use options::{FitOptions, Optimizer, RegressionOptions, Scaling};
pub use parsimony::{BlockLosses, Difference, combine_equations};
pub use qr::{BLOCK_ROWS, QrFactor, Solution};
pub use refine::{Attempt, Outcome, RefineOptions, RefinedEquations, Refinement, noise_excess, refine};
pub use regression_form::{Nodes, RegressionForm, RowWeights, Rows};
pub use robust::{HuberWeights, Loss, ResidualHistogram};
pub use search::{
    MOST_TERMS, RefineScope, SearchError, SearchGrid, SearchOptions, SearchResult, Trial, search, substeps,
};
pub use stability::{StabilityCheck, StabilityOptions, stability_check};
pub use stepwise::stepwise;
pub use stlsq::{SparseSolution, stlsq};
pub use structure::{GateSpec, Lag, Structure};
pub use structure_constraints::{couples_outputs, dissipative, is_supported};
pub use structure_search::{StructureSpec, structure_search};
pub use substitution::{gated, substitute_variable};
