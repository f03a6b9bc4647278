//! Sparse equations whose coefficients travel with the session.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;

use crate::model::sparse::{Equations, EquationsSession};
use crate::predict::{Predictor, Workspace};

/// A session of equations that are its own, with their coefficients in its snapshots.
///
/// Snapshot: that of [`EquationsSession`], then the coefficients at the adapted places.
#[derive(Clone, Debug)]
pub struct ParametricSession {
    session: EquationsSession,
    /// Coefficients, `outputs x terms`, and where the adapted ones stand.
    coefficients: Vec<f64>,
    places: Vec<usize>,
}

impl ParametricSession {
    /// A session at the start of a run. The equations have a coefficient at every place that is adapted.
    pub(super) fn new(equations: Equations, places: Vec<usize>) -> Self {
        let coefficients = equations.coefficients().to_vec();
        Self { session: EquationsSession::new(Arc::new(equations)), coefficients, places }
    }

    /// The equations of the moment.
    pub fn equations(&self) -> &Equations {
        self.session.equations()
    }

    /// Writes outputs, inputs and signals of the moment into `slots[1..]` (see [`Equations::load`]).
    pub(super) fn load(&self, c: &[f64], slots: &mut [f64]) {
        self.session.equations().load(self.session.state(), c, slots);
    }

    /// The state of the moment, as [`Equations::step`] moves it.
    pub(super) fn state(&self) -> &[f64] {
        self.session.state()
    }

    /// The same, to put others in their place.
    pub(super) fn state_mut(&mut self) -> &mut [f64] {
        self.session.state_mut()
    }

    /// All coefficients, `outputs x terms`.
    pub(super) fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Where the adapted coefficients stand in `outputs x terms`.
    pub fn places(&self) -> &[usize] {
        &self.places
    }

    /// Copies the adapted coefficients out, in the order of the places.
    pub(super) fn weights(&self, into: &mut [f64]) {
        assert_eq!(into.len(), self.places.len(), "one number for each place");
        for (weight, &place) in into.iter_mut().zip(&self.places) {
            *weight = self.coefficients[place];
        }
    }

    /// Takes others into use.
    pub(super) fn set_weights(&mut self, weights: &[f64]) {
        assert_eq!(weights.len(), self.places.len(), "one number for each place");
        for (weight, &place) in weights.iter().zip(&self.places) {
            self.coefficients[place] = *weight;
        }
        self.session.equations_mut().set_coefficients(&self.coefficients);
    }
}

impl Predictor for ParametricSession {
    fn outputs(&self) -> usize {
        self.session.outputs()
    }

    fn inputs(&self) -> usize {
        self.session.inputs()
    }

    fn warm_up(&self) -> usize {
        self.session.warm_up()
    }

    fn reset(&mut self) {
        self.session.reset();
    }

    fn observe(&mut self, y: &[f64]) {
        self.session.observe(y);
    }

    fn advance(&mut self, c: &[f64]) {
        self.session.advance(c);
    }

    fn output(&self, y: &mut [f64]) {
        self.session.output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.session.rollout(commands, work, y);
    }

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

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.session.rollout_batch(count, commands, work, y);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        // Equations of its own at once: restoring must not allocate.
        let mut fork = self.clone();
        let _ = fork.session.equations_mut();
        Box::new(fork)
    }
}
