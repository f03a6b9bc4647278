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
mod propagated_noise;
mod qr;
pub(crate) mod refine;
mod regression_form;
mod robust;
mod search;
mod stability;
mod stepwise;
mod stlsq;
mod structure;
mod structure_constraints;
mod structure_search;
mod subset;
mod substitution;

pub use constraints::{Constraints, Sign};
pub use error::FitError;
pub use fit::{Fit, LinearRegression};
pub use library::{Family, Library, Variables};
pub use options::{FitOptions, Optimizer, RegressionOptions, Scaling};
pub(crate) use parsimony::BlockLosses;
pub use regression_form::RegressionForm;

// Parts of the search for the other crates and the tests of this workspace.
#[doc(hidden)]
pub use {
    assemble::{Assembled, AssemblyOptions, assemble, assemble_with},
    constraints::{Coefficient, ConstraintError, Equality},
    criterion::{Criterion, stepwise_bidirectional},
    ensemble::{BootstrapOptions, Ensemble},
    expression::{Constraint, ExpressionError, ExpressionParser, Relation},
    library::VariableKind,
    nelder_mead::{NelderMeadOptions, nelder_mead},
    noise::{noise_std, weak_form_from_noise, white_noise_std},
    qr::{BLOCK_ROWS, QrFactor},
    refine::{Outcome, RefineOptions, RefinedEquations, Refinement, noise_excess, refine},
    regression_form::{RowWeights, Rows},
    robust::Loss,
    search::{
        RefineScope, SearchError, SearchGrid, SearchOptions, SearchResult, Trial, noise_ratio, refit, search,
        substeps,
    },
    stability::{StabilityCheck, StabilityOptions, stability_check},
    stepwise::stepwise,
    stlsq::stlsq,
    structure::{GateSpec, Lag, Structure},
    structure_constraints::dissipative,
    subset::best_subset,
    substitution::{gated, substitute_variable},
};

pub(crate) use library::UnknownLibrary;
pub(crate) use noise::spike_share;
pub(crate) use structure_constraints::is_supported;
pub(crate) use structure_search::{StructureSpec, structure_search, subsample};
