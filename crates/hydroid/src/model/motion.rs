//! Equations of motion with the names and units of their channels: what text, LaTeX, units and Jacobian are made of.

use std::sync::Arc;

use hydroid_core::adapt::{BlendedEquations, RecursiveEquations, Settings, SettingsError};
use hydroid_core::model::recurrent::BaseModel;
use hydroid_core::model::sparse::Equations;

use super::{Body, Description, Learning, Model};

/// Equations of motion as people read them. A model that has none gives none ([`Model::equations`]), so that whoever
/// shows equations need not know which kinds of models there are.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    pub(super) description: &'a Description,
    pub(super) equations: &'a Arc<Equations>,
}

impl Motion<'_> {
    /// The equations themselves.
    pub fn equations(&self) -> &Arc<Equations> {
        self.equations
    }

    /// A session that learns on the way.
    ///
    /// # Errors
    /// If the settings do not fit the equations.
    pub fn learner(&self, settings: &Settings) -> Result<RecursiveEquations, SettingsError> {
        RecursiveEquations::new(self.equations, &self.description.ranges(), settings)
    }

    /// A session that learns at several paces.
    ///
    /// # Errors
    /// If the settings do not fit the equations.
    pub fn blended(&self, learning: &Learning) -> Result<BlendedEquations, SettingsError> {
        let ranges = self.description.ranges();
        BlendedEquations::new(self.equations, &ranges, &learning.settings, Some(&learning.root))
    }
}

impl Model {
    /// The equations that the model is; none for a network or a vessel.
    pub fn equations(&self) -> Option<Motion<'_>> {
        match &self.body {
            Body::Equations(equations) => Some(self.motion(equations)),
            Body::Recurrent(_) | Body::Direct(_) | Body::Affine(_) | Body::Plant(_) => None,
        }
    }

    /// Equations in the words of the model.
    pub(crate) fn motion<'a>(&'a self, equations: &'a Arc<Equations>) -> Motion<'a> {
        Motion { description: &self.description, equations }
    }

    /// The equations that a network corrects (a grey box); none for other models.
    pub fn base_equations(&self) -> Option<Motion<'_>> {
        let base = match &self.body {
            Body::Recurrent(recurrent) => &recurrent.base,
            Body::Direct(direct) => &direct.base,
            Body::Equations(_) | Body::Affine(_) | Body::Plant(_) => return None,
        };
        match base {
            BaseModel::Equations(equations) => Some(self.motion(equations)),
            BaseModel::Nothing | BaseModel::Hold => None,
        }
    }
}
