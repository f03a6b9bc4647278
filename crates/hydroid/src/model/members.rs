//! Other coefficients, or weights, that the data allow: the members of an ensemble, and the rollouts that they give.

use std::sync::Arc;

use hydroid_core::model::direct::{Direct, DirectSession};
use hydroid_core::model::sparse::{Equations, EquationsSession};
use hydroid_core::predict::Predictor;

use super::{Body, Model};

/// Members that a model keeps at the most: more would not move its bands, and make its file larger.
pub const MOST_MEMBERS: usize = 50;

/// Coefficients of the members of an ensemble, at the places where any member has one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Members {
    /// Ascending, in the table of coefficients `outputs x terms`.
    places: Vec<usize>,
    /// Member by member, one number for each place.
    values: Vec<f64>,
}

impl Members {
    /// The first [`MOST_MEMBERS`] of some tables of coefficients, all of one length.
    pub fn new(tables: &[Vec<f64>]) -> Self {
        let tables = &tables[..tables.len().min(MOST_MEMBERS)];
        let count = tables.iter().map(Vec::len).min().unwrap_or(0);
        let places: Vec<usize> =
            (0..count).filter(|&place| tables.iter().any(|table| table[place] != 0.0)).collect();
        let values = tables.iter().flat_map(|table| places.iter().map(|&place| table[place])).collect();
        Self { places, values }
    }

    /// From the parts in a file.
    pub(super) fn from_parts(places: &[u32], values: Vec<f64>, count: usize) -> Result<Self, String> {
        let places: Vec<usize> =
            places.iter().map(|&place| usize::try_from(place).unwrap_or(usize::MAX)).collect();
        let ascending = places.windows(2).all(|pair| pair[0] < pair[1]);
        if places.last().is_none_or(|last| *last >= count) || !ascending {
            return Err(String::from("its ensemble is of coefficients that it does not have"));
        }
        if values.iter().any(|value| !value.is_finite()) {
            return Err(String::from("a coefficient of its ensemble is not a finite number"));
        }
        Ok(Self { places, values })
    }

    /// Places and values, as [`from_parts`](Self::from_parts) takes them.
    pub(super) fn parts(&self) -> (&[usize], &[f64]) {
        (&self.places, &self.values)
    }

    /// Number of members.
    pub fn len(&self) -> usize {
        self.values.len() / self.places.len().max(1)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Whether they are of a table of so many numbers.
    pub fn fit(&self, count: usize) -> bool {
        self.places.last().is_none_or(|last| *last < count)
    }
}

impl Model {
    /// Length of the table that members have values for.
    fn numbers(&self) -> usize {
        match &self.body {
            Body::Equations(equations) => equations.coefficients().len(),
            Body::Direct(direct) => direct.weights.len(),
            Body::Recurrent(_) | Body::Affine(_) | Body::Plant(_) => 0,
        }
    }

    /// A session for each member of the ensemble; none where the model has no ensemble. Their rollouts spread as
    /// far as the coefficients are uncertain.
    pub fn member_sessions(&self) -> Vec<Box<dyn Predictor>> {
        let (places, values) = self.members.parts();
        if self.learning.is_some() || self.members.is_empty() || !self.members.fit(self.numbers()) {
            return Vec::new();
        }
        let equations = match &self.body {
            Body::Equations(equations) => equations,
            Body::Direct(direct) => {
                let session = |values: &[f64]| -> Option<Box<dyn Predictor>> {
                    let mut weights = vec![0.0; direct.weights.len()];
                    for (&place, &value) in places.iter().zip(values) {
                        weights[place] = value;
                    }
                    let own = Direct { weights, ..Direct::clone(direct) };
                    Some(Box::new(DirectSession::new(Arc::new(own)).ok()?))
                };
                return values.chunks_exact(places.len()).filter_map(session).collect();
            }
            Body::Recurrent(_) | Body::Affine(_) | Body::Plant(_) => return Vec::new(),
        };
        let session = |values: &[f64]| -> Option<Box<dyn Predictor>> {
            let mut table = vec![0.0; equations.coefficients().len()];
            for (&place, &value) in places.iter().zip(values) {
                table[place] = value;
            }
            // What compiled for the model compiles for its members.
            let own = Equations::with_signals(
                equations.terms().to_vec(),
                table,
                equations.outputs(),
                equations.inputs(),
                equations.signals().to_vec(),
                equations.dt(),
                equations.substeps(),
            )
            .ok()?;
            Some(Box::new(EquationsSession::new(Arc::new(own))))
        };
        values.chunks_exact(places.len()).filter_map(session).collect()
    }
}
