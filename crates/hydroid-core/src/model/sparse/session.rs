//! The session of sparse equations: present outputs and the memory of the signals.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::equations::{BatchRollout, Equations};
use crate::model::persistence::take_measured;
use crate::predict::{
    Predictor, Workspace, delegate, plain, restore_and_roll_out, rollout_each, rollout_steps,
};

/// A run of [`Equations`]: measurements replace the outputs; missing ones are predicted. Predictions start once each
/// output has been measured; until then measured values are held, so that sensors may report in turns.
#[derive(Clone, Debug)]
pub struct EquationsSession {
    equations: Arc<Equations>,
    state: Vec<f64>,
    scratch: Vec<f64>,
}

impl EquationsSession {
    /// A session at the start of a run.
    pub fn new(equations: Arc<Equations>) -> Self {
        let state = vec![f64::NAN; equations.state_len()];
        let scratch = vec![0.0; equations.scratch()];
        Self { equations, state, scratch }
    }

    /// The present equations.
    pub fn equations(&self) -> &Equations {
        &self.equations
    }

    /// The present state ([`Equations::step`]).
    pub fn state(&self) -> &[f64] {
        &self.state
    }

    pub(crate) fn state_mut(&mut self) -> &mut [f64] {
        &mut self.state
    }

    /// The equations, copied first where sessions share them.
    pub(crate) fn equations_mut(&mut self) -> &mut Equations {
        Arc::make_mut(&mut self.equations)
    }
}

impl Predictor for EquationsSession {
    plain!(over_ground);
    delegate!(equations: outputs inputs warm_up);

    fn reset(&mut self) {
        self.state.fill(f64::NAN);
    }

    fn observe(&mut self, y: &[f64]) {
        let outputs = self.equations.outputs();
        take_measured(&mut self.state[..outputs], y);
    }

    fn advance(&mut self, c: &[f64]) {
        if self.state[..self.equations.outputs()].iter().any(|y| y.is_nan()) {
            self.equations.wait(&mut self.state, c, &mut self.scratch);
        } else {
            self.equations.step(&mut self.state, c, &mut self.scratch);
        }
    }

    fn advance_observe(&mut self, c: &[f64], y: &[f64]) {
        if y.iter().all(|y| !y.is_nan()) {
            self.equations.wait(&mut self.state, c, &mut self.scratch);
        } else {
            self.advance(c);
        }
        self.observe(y);
    }

    fn output(&self, y: &mut [f64]) {
        y.copy_from_slice(&self.state[..self.equations.outputs()]);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let (n, m) = (self.outputs(), self.inputs());
        let steps = rollout_steps(commands, m, y, n);
        let len = self.state.len();
        let (state, scratch) = work.take(len + self.equations.scratch()).split_at_mut(len);
        state.copy_from_slice(&self.state);
        for step in 0..steps {
            self.equations.step(state, &commands[step * m..(step + 1) * m], scratch);
            y[step * n..(step + 1) * n].copy_from_slice(&state[..n]);
        }
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let equations = &*self.equations;
        let fits = |memory: &BatchRollout| memory.fits(equations, count);
        match work.batch(fits, || BatchRollout::new(equations, count)) {
            Some(memory) => memory.rollout(equations, &self.state, count, commands, y),
            None => rollout_each(self, count, commands, work, y),
        }
    }

    fn rollout_snapshots(
        &mut self,
        count: usize,
        snapshots: &[f64],
        commands: &[f64],
        work: &mut Workspace,
        y: &mut [f64],
    ) {
        let equations = &*self.equations;
        let fits = |memory: &BatchRollout| memory.fits(equations, count);
        match work.batch(fits, || BatchRollout::new(equations, count)) {
            Some(memory) => memory.rollout_each(equations, snapshots, count, commands, y),
            None => restore_and_roll_out(self, count, snapshots, commands, work, y),
        }
    }

    fn snapshot_len(&self) -> usize {
        self.state.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        into.copy_from_slice(&self.state);
    }

    fn restore(&mut self, from: &[f64]) {
        self.state.copy_from_slice(from);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}
