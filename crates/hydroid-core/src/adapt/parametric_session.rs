//! A session of sparse equations with its own coefficients.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;

use crate::model::sparse::{Equations, EquationsSession};
use crate::predict::{Predictor, delegate, plain};

/// A session of equations whose coefficients are part of its snapshots.
///
/// Snapshot: the snapshot of [`EquationsSession`], then the coefficients at the adapted places.
#[derive(Clone, Debug)]
pub struct ParametricSession {
    session: EquationsSession,
    coefficients: Vec<f64>,
    places: Vec<usize>,
}

impl ParametricSession {
    pub(super) fn new(equations: Equations, places: Vec<usize>) -> Self {
        let coefficients = equations.coefficients().to_vec();
        Self { session: EquationsSession::new(Arc::new(equations)), coefficients, places }
    }

    /// The equations with the current coefficients.
    pub fn equations(&self) -> &Equations {
        self.session.equations()
    }

    pub(super) fn load(&self, c: &[f64], slots: &mut [f64]) {
        self.session.equations().load(self.session.state(), c, slots);
    }

    pub(super) fn state(&self) -> &[f64] {
        self.session.state()
    }

    pub(super) fn state_mut(&mut self) -> &mut [f64] {
        self.session.state_mut()
    }

    pub(super) fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Indices of the adapted coefficients.
    pub fn places(&self) -> &[usize] {
        &self.places
    }

    pub(super) fn weights(&self, into: &mut [f64]) {
        assert_eq!(into.len(), self.places.len(), "one number for each place");
        for (weight, &place) in into.iter_mut().zip(&self.places) {
            *weight = self.coefficients[place];
        }
    }

    pub(super) fn set_weights(&mut self, weights: &[f64]) {
        assert_eq!(weights.len(), self.places.len(), "one number for each place");
        for (weight, &place) in weights.iter().zip(&self.places) {
            self.coefficients[place] = *weight;
        }
        self.session.equations_mut().set_coefficients(&self.coefficients);
    }
}

impl Predictor for ParametricSession {
    plain!(advance_observe rollout_snapshots);
    delegate!(session: outputs inputs warm_up reset observe_heading current output_through_water observe advance);
    delegate!(session: output rollout rollout_batch);

    fn snapshot_len(&self) -> usize {
        self.session.snapshot_len() + self.places.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        let (state, weights) = into.split_at_mut(self.session.snapshot_len());
        self.session.snapshot(state);
        self.weights(weights);
    }

    fn restore(&mut self, from: &[f64]) {
        let (state, weights) = from.split_at(self.session.snapshot_len());
        self.session.restore(state);
        self.set_weights(weights);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        // The copy gets its own equations here, because `restore` must not allocate.
        let mut fork = self.clone();
        let _ = fork.session.equations_mut();
        Box::new(fork)
    }
}
