//! Ensembles: coefficients or weights from resampled data, whose rollouts give prediction bands.

use hydroid_core::predict::Predictor;

use super::Model;

/// Largest number of ensemble members.
pub const MAX_MEMBERS: usize = 50;

/// Coefficients of ensemble members, stored at the indices where any member is not zero.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Members {
    /// Ascending indices in the coefficients `outputs x terms`, or in the weights.
    places: Vec<usize>,
    /// Values, `members x places`.
    values: Vec<f64>,
}

impl Members {
    /// The first [`MAX_MEMBERS`] of `tables`, which have one length.
    pub fn new(tables: &[Vec<f64>]) -> Self {
        let tables = &tables[..tables.len().min(MAX_MEMBERS)];
        let count = tables.iter().map(Vec::len).min().unwrap_or(0);
        let places: Vec<usize> =
            (0..count).filter(|&place| tables.iter().any(|table| table[place] != 0.0)).collect();
        let values = tables.iter().flat_map(|table| places.iter().map(|&place| table[place])).collect();
        Self { places, values }
    }

    pub(super) fn from_parts(places: &[u32], values: Vec<f64>, count: usize) -> Result<Self, String> {
        let places: Vec<usize> =
            places.iter().map(|&place| usize::try_from(place).unwrap_or(usize::MAX)).collect();
        let ascending = places.windows(2).all(|pair| pair[0] < pair[1]);
        if places.last().is_none_or(|last| *last >= count) || !ascending {
            return Err(String::from("its ensemble has coefficients that the model does not have"));
        }
        if values.iter().any(|value| !value.is_finite()) {
            return Err(String::from("a coefficient of its ensemble is not a finite number"));
        }
        Ok(Self { places, values })
    }

    pub(super) fn parts(&self) -> (&[usize], &[f64]) {
        (&self.places, &self.values)
    }

    /// The number at a place in each member.
    pub(super) fn values_at(&self, place: usize) -> Vec<f64> {
        let column = self.places.binary_search(&place);
        let rows = self.values.chunks_exact(self.places.len().max(1));
        rows.map(|row| column.map_or(0.0, |column| row[column])).collect()
    }

    /// Number of members.
    pub fn len(&self) -> usize {
        self.values.len() / self.places.len().max(1)
    }

    /// Whether there are no members.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Whether the places fit `count` numbers.
    pub fn fit(&self, count: usize) -> bool {
        self.places.last().is_none_or(|last| *last < count)
    }
}

impl Model {
    /// A session for each ensemble member; their spread reflects the uncertainty of the coefficients. None for models of the
    /// motion through the water, because members that start before each origin do not know the current.
    pub fn member_sessions(&self) -> Vec<Box<dyn Predictor>> {
        if self.learning.is_some() || self.description.current.is_some() {
            return Vec::new();
        }
        let sessions = self.member_motion_sessions().into_iter();
        sessions.map(|session| self.whole_session(session)).collect()
    }

    /// A session for each ensemble member, of the motion that the model predicts.
    pub(crate) fn member_motion_sessions(&self) -> Vec<Box<dyn Predictor>> {
        let kind = self.body.kind();
        let count = kind.ensemble_numbers();
        let (places, values) = self.members.parts();
        if self.members.is_empty() || !self.members.fit(count) {
            return Vec::new();
        }
        let session = |values: &[f64]| {
            let mut numbers = vec![0.0; count];
            for (&place, &value) in places.iter().zip(values) {
                numbers[place] = value;
            }
            kind.member_session(numbers)
        };
        values.chunks_exact(places.len()).filter_map(session).collect()
    }
}
