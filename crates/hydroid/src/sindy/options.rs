//! Options of the regression and of the fit.

use hydroid_core::model::sparse::Signal;
use serde::{Deserialize, Serialize};

use super::constraints::Constraints;
use super::criterion::Criterion;
#[cfg(doc)]
use super::regression_form::RegressionForm;
use super::robust::Loss;

/// Scaling of the coefficients for the comparison with the threshold.
#[derive(Clone, Debug, PartialEq, Default)]
pub enum Scaling {
    /// RMS contribution of a term over the training data, in standard deviations of the output per second.
    #[default]
    Contribution,
    /// Coefficients of equations in variables divided by these scales, outputs then inputs.
    Variables(Vec<f64>),
}

/// Method of term selection.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Optimizer {
    /// Backward elimination: a term is removed if that raises the residual sum of squares by less than this fraction,
    /// or by less than 1e-5 of the right-hand side, the discretisation error of the derivative in noise-free data. The
    /// coefficients are the ridge solution on the remaining terms.
    Stepwise(f64),
    /// Sequentially thresholded least squares: coefficients below this, in units of [`Scaling`], are removed. The ridge
    /// acts on the selection only.
    Stlsq(f64),
    /// Bidirectional elimination by an information criterion, whose tolerance follows from the number of independent
    /// rows ([`RegressionForm::effective_rows`]). Terms below 1e-5 of the right-hand side are removed as well.
    Criterion(Criterion),
    /// The best subset of terms by the extended Bayesian criterion, without a ridge.
    Subset,
}

/// Options of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// Method of term selection.
    pub optimizer: Optimizer,
    /// Ridge penalty per row, on scaled columns.
    pub ridge: f64,
    /// Integration steps per sample of the resulting equations.
    pub substeps: usize,
    /// Constraints on the coefficients.
    pub constraints: Constraints,
}

/// Options of the assembly of a regression.
#[derive(Clone, Debug, Default)]
pub struct RegressionOptions<'a> {
    /// Variables of the terms besides outputs and inputs, in their order.
    pub signals: &'a [Signal],
    /// Scaling of the columns.
    pub scaling: Scaling,
    /// Loss of the residuals.
    pub loss: Loss,
    /// Weight of each sample of each run; empty for unit weights. A row has the smallest weight of its samples.
    pub weights: &'a [Vec<f64>],
    /// Weight of each row of each run, a stride apart, in place of the weights of samples; empty for none.
    pub row_weights: &'a [Vec<f64>],
    /// Number of contiguous groups of rows for the block bootstrap, each of `8 (terms + outputs)^2` bytes; 0 for none.
    pub groups: usize,
}
