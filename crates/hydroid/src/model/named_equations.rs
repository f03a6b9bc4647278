//! Equations of motion with the names and units of their channels, for text, LaTeX, units and Jacobian.

use std::sync::Arc;

use hydroid_core::adapt::{ExpertMixture, RecursiveEquations, RecursiveOptions, RecursiveOptionsError};
use hydroid_core::model::sparse::Equations;

use super::{Description, Learning, Members, Model};

/// Equations of motion with the names and units of their channels; see [`Model::equations`].
#[derive(Clone, Copy, Debug)]
pub struct NamedEquations<'a> {
    pub(super) description: &'a Description,
    pub(super) equations: &'a Arc<Equations>,
    /// Ensemble of the coefficients; none for base equations and for coefficients that are adapted.
    pub(super) members: Option<&'a Members>,
}

impl NamedEquations<'_> {
    /// The equations.
    pub fn equations(&self) -> &Arc<Equations> {
        self.equations
    }

    /// Session that adapts the coefficients by recursive least squares.
    ///
    /// # Errors
    /// If the options do not fit the equations.
    pub fn learner(&self, options: &RecursiveOptions) -> Result<RecursiveEquations, RecursiveOptionsError> {
        RecursiveEquations::new(self.equations, &self.description.ranges(), options)
    }

    /// Session that adapts the coefficients with several priors (an expert mixture).
    ///
    /// # Errors
    /// If the options do not fit the equations.
    pub fn expert_mixture(&self, learning: &Learning) -> Result<ExpertMixture, RecursiveOptionsError> {
        let ranges = self.description.ranges();
        ExpertMixture::new(self.equations, &ranges, &learning.settings, Some(&learning.r_factor))
    }
}

impl Model {
    pub(crate) fn named<'a>(&'a self, equations: &'a Arc<Equations>) -> NamedEquations<'a> {
        NamedEquations { description: &self.description, equations, members: None }
    }

    /// The base equations of a grey-box network, if any.
    pub fn base_equations(&self) -> Option<NamedEquations<'_>> {
        self.body.kind().base_equations().map(|equations| self.named(equations))
    }
}
