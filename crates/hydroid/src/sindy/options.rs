//! How to fit.

use hydroid_core::model::sparse::Signal;
use serde::{Deserialize, Serialize};

use super::constraints::Constraints;
use super::criterion::Criterion;
#[cfg(doc)]
use super::regression_form::RegressionForm;
use super::robust::Loss;

/// What a coefficient is measured by when it is compared with the threshold.
#[derive(Clone, Debug, PartialEq, Default)]
pub enum Scaling {
    /// A term counts by what it contributes: the RMS of `xi theta` over the training data in standard
    /// deviations of the output per second. The same threshold then means the same for every channel,
    /// whatever the units (a propeller in newtons has coefficients of 0.005 that matter).
    #[default]
    Contribution,
    /// Every variable is divided by a scale of its own, and the coefficients of the scaled equations are
    /// compared as they are. One scale for each output, then for each input.
    Variables(Vec<f64>),
}

/// How terms are selected.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Optimizer {
    /// Backward elimination: a term leaves when that raises the residual sum of squares by less than this
    /// fraction, or by less than 1e-5 of the whole right-hand side: in noise-free data the discretisation of
    /// the derivative leaves that much, and terms would be kept to explain it. Coefficients are the ridge
    /// solution on the terms that remain.
    Stepwise(f64),
    /// Sequentially thresholded least squares: coefficients below this, in the units of [`Scaling`], are
    /// removed. Ridge acts on the selection only, coefficients are plain least squares.
    Stlsq(f64),
    /// Backward elimination by an information criterion, with terms that may come back: what a term must be
    /// worth follows from the number of independent rows ([`RegressionForm::effective_rows`]), so that there is
    /// nothing to tune. Terms below 1e-5 of the right-hand side leave as with [`Optimizer::Stepwise`].
    Criterion(Criterion),
}

/// How to fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// How terms are selected.
    pub optimizer: Optimizer,
    /// Ridge penalty for each row of the regression, on scaled columns.
    pub ridge: f64,
    /// Integration steps in one sample of the resulting equations.
    pub substeps: usize,
    /// What the coefficients must obey.
    pub constraints: Constraints,
}

/// How the runs become a qr.
#[derive(Clone, Debug, Default)]
pub struct RegressionOptions<'a> {
    /// Variables of the terms beyond outputs and inputs, in their order.
    pub signals: &'a [Signal],
    /// What contributions are measured by.
    pub scaling: Scaling,
    /// What residuals cost.
    pub loss: Loss,
    /// Weight of each sample of each run, 0 or more; empty for 1 throughout. A row of the regression has the
    /// smallest weight of its samples.
    pub weights: &'a [Vec<f64>],
    /// Contiguous groups of rows that an ensemble draws from; 0 where none is wanted. Each keeps a
    /// qr of its own, `8 (terms + outputs)^2` bytes.
    pub groups: usize,
}
