//! The constants of recursive equations, for code in other languages.

use alloc::vec::Vec;

use super::super::innovation_gate::NoiseConstants;
use super::super::ud_factor::UdFactor;
use super::{Group, RecursiveEquations};
use crate::model::sparse::Term;
use crate::predict::Predictor;

/// The constants of [`RecursiveEquations`], for code in other languages.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct EquationsConstants {
    /// Terms of which a coefficient is adapted.
    pub terms: Vec<Term>,
    /// Scale of each of them.
    pub scales: Vec<f64>,
    /// Whether each variable is constant over an interval: outputs, inputs, signals.
    pub holds: Vec<bool>,
    /// Indices of the adapted coefficients.
    pub places: Vec<usize>,
    /// Equations with the same terms.
    pub groups: Vec<GroupConstants>,
    /// Blocks of a window, and intervals in each.
    pub blocks: usize,
    /// See [`blocks`](Self::blocks).
    pub stride: usize,
    /// Forgetting factor of a row, and its weight.
    pub lambda: f64,
    /// See [`lambda`](Self::lambda).
    pub weight: f64,
    /// Gate and noise estimate.
    pub noise: NoiseConstants,
    /// Samples before the first row.
    pub warm_up: usize,
}

/// Equations with the same terms, which share a covariance.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct GroupConstants {
    /// Indices of their terms in [`EquationsConstants::terms`].
    pub terms: Vec<usize>,
    /// Their outputs.
    pub outputs: Vec<usize>,
    /// Index of the first weight of each output.
    pub firsts: Vec<usize>,
    /// Covariance at the start, in scaled coefficients.
    pub factor: UdFactor,
    /// Weight of the prior \[rows\].
    pub information: f64,
    /// Whether coefficients return to the initial ones.
    pub leak: bool,
}

impl RecursiveEquations {
    /// The constants of the method.
    #[doc(hidden)]
    pub fn constants(&self) -> EquationsConstants {
        let library = &self.library;
        let used = |t: usize| self.session.equations().terms()[library.used[t]].clone();
        let group = |group: &Group| GroupConstants {
            terms: group.terms.clone(),
            outputs: group.outputs.clone(),
            firsts: group.firsts.clone(),
            factor: group.kernel.initial_factor(),
            information: group.kernel.information(),
            leak: group.kernel.leaks(),
        };
        EquationsConstants {
            terms: (0..library.used.len()).map(used).collect(),
            scales: library.inverse.iter().map(|inverse| 1.0 / inverse).collect(),
            holds: library.holds.clone(),
            places: self.session.places().to_vec(),
            groups: self.groups.iter().map(group).collect(),
            blocks: self.rows.samples() / self.rows.stride(),
            stride: self.rows.stride(),
            lambda: self.lambda,
            weight: self.weight,
            noise: self.noise.constants(),
            warm_up: self.session.warm_up(),
        }
    }
}
