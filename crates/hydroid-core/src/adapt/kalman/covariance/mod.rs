//! Covariance of state and weights, and Kalman gain: full, or block-diagonal (decoupled EKF), by [`CovarianceForm`].

mod block_diagonal;
mod full;
mod lane_sums;
mod packed;
mod panels;
mod structured;

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;

use self::full::FullCovariance;
use self::structured::StructuredCovariance;
use super::learnable::Learnable;
use super::measurement::MeasurementUpdate;
use super::options::{CovarianceForm, FilterOptions};

/// The joint covariance of state and weights. A vector over the weights has `width` numbers, in the order of the
/// columns; [`places`](Self::places) maps columns to weights.
#[derive(Clone, Debug)]
pub(super) enum JointCovariance {
    Full(Box<FullCovariance>),
    Structured(Box<StructuredCovariance>),
}

macro_rules! each {
    ($own:expr, $covariance:ident => $call:expr) => {
        match $own {
            JointCovariance::Full($covariance) => $call,
            JointCovariance::Structured($covariance) => $call,
        }
    };
}

impl JointCovariance {
    pub(super) fn new<M: Learnable>(model: &M, options: &FilterOptions, learned: Vec<usize>) -> Self {
        match options.covariance {
            CovarianceForm::Full => Self::Full(Box::new(FullCovariance::new(model, options, learned))),
            CovarianceForm::Blocks { group } => {
                Self::Structured(Box::new(StructuredCovariance::new(model, options, group, &learned)))
            }
        }
    }

    /// Index of the weight of each column; `None` for padding.
    pub(super) fn places(&self) -> &[Option<usize>] {
        each!(self, covariance => &covariance.places)
    }

    /// The covariance of the weights becomes diagonal, and their correlation with the state zero.
    pub(super) fn restart(&mut self, initial: &[f64]) {
        each!(self, covariance => covariance.restart(initial));
    }

    /// The covariance of the state becomes diagonal, and its correlation with the weights zero.
    pub(super) fn reset(&mut self, initial: &[f64]) {
        each!(self, covariance => covariance.reset(initial));
    }

    pub(super) fn reset_part(&mut self, part: Range<usize>, initial: f64) {
        each!(self, covariance => covariance.reset_part(part, initial));
    }

    /// Time update after a step of the model: multiplies the covariance of the weights by `growth^2` and adds their
    /// noise; adds `noise` to the variances of the active state.
    pub(super) fn advance<M: Learnable>(&mut self, model: &M, growth: f64, noise: f64) {
        each!(self, covariance => covariance.advance(model, growth, noise));
    }

    pub(super) fn predict_output<M: Learnable>(&mut self, model: &M, measured: &mut MeasurementUpdate) {
        each!(self, covariance => covariance.predict_output(model, measured));
    }

    /// Measurement update: corrects the state and, if the filter `learns`, writes the change of the weights. Returns
    /// false if the covariance has diverged.
    pub(super) fn correct(
        &mut self,
        measured: &MeasurementUpdate,
        state: &mut [f64],
        change: &mut [f64],
        learns: bool,
    ) -> bool {
        match self {
            Self::Full(full) => {
                full.correct(measured, state, change, learns);
                true
            }
            Self::Structured(structured) => structured.correct(measured, state, change, learns),
        }
    }

    pub(super) fn variances(&self) -> (Vec<f64>, Vec<f64>) {
        each!(self, covariance => covariance.variances())
    }

    pub(super) fn least_variance(&self) -> f64 {
        each!(self, covariance => covariance.least_variance())
    }

    /// Adds the variances of linear functions to `into`. The rows of `v_h` (`functions x state`) and of `v_t`
    /// (`functions x weights`) are their gradients.
    pub(super) fn add_variances(&mut self, v_h: &[f64], v_t: &[f64], into: &mut [f64]) {
        each!(self, covariance => covariance.add_variances(v_h, v_t, into));
    }

    pub(super) fn len(&self) -> usize {
        each!(self, covariance => covariance.len())
    }

    /// Whether the downdate of the last measurement has not been applied yet.
    pub(super) fn pending(&mut self) -> Option<&mut bool> {
        if let Self::Full(full) = self { Some(&mut full.pending) } else { None }
    }

    pub(super) fn parts(&mut self) -> [&mut [f64]; 6] {
        each!(self, covariance => covariance.parts())
    }
}
