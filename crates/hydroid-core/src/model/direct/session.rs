//! The session of a direct predictor: the last outputs and commands.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::base_rollout::BaseRollout;
use super::batch_rollout::BatchRollout;
use super::check::DirectError;
use super::forward_pass::ForwardPass;
use super::model::Direct;
use super::window::{Window, push};
use crate::predict::{Predictor, Workspace, plain, rollout_each, rollout_steps};

/// A run of a [`Direct`] model. Measurements replace the present output; missing ones are predicted.
///
/// At the start of a run, the first measurement of an output fills its history. Until the history of commands is
/// complete (with base equations, also all their past values), measured values are held and rollouts are NaN.
///
/// The snapshot is the past: `history` rows of outputs, the present one last, then `history - 1` rows of commands; then
/// the memory of the equations, and the session's own last layer if it has one.
#[derive(Clone, Debug)]
pub struct DirectSession {
    model: Arc<Direct>,
    forward: ForwardPass,
    window: Window,
    past: Vec<f64>,
    /// State of the equations: outputs (unused), then the memory before the present sample. Empty without equations.
    below: Vec<f64>,
    /// The session's own last layer; empty where the layer of the model is used.
    own: Vec<f64>,
    scratch: Vec<f64>,
    next: Vec<f64>,
}

impl DirectSession {
    /// A session at the start of a run.
    ///
    /// # Errors
    /// As [`Direct::check`].
    pub fn new(model: Arc<Direct>) -> Result<Self, DirectError> {
        model.check()?;
        let window = Window::of(&model);
        let forward = ForwardPass::new(&model.network);
        let scratch = vec![0.0; forward.scratch(&model)];
        Ok(Self {
            past: vec![f64::NAN; window.past()],
            below: vec![f64::NAN; model.below()],
            own: Vec::new(),
            next: vec![0.0; window.n],
            model,
            forward,
            window,
            scratch,
        })
    }

    /// The model.
    pub fn model(&self) -> &Direct {
        &self.model
    }

    pub(super) fn shared_model(&self) -> &Arc<Direct> {
        &self.model
    }

    /// Past outputs and commands in physical units.
    pub(super) fn whole_past(&self) -> &[f64] {
        &self.past
    }

    pub(crate) fn with_own_last_layer(model: Arc<Direct>) -> Result<Self, DirectError> {
        let mut session = Self::new(model)?;
        session.own = session.forward.last_layer(&session.model.weights).to_vec();
        Ok(session)
    }

    /// Weights of the last layer: its matrix row by row, then its bias.
    pub(crate) fn last_layer(&self) -> &[f64] {
        if self.own.is_empty() { self.forward.last_layer(&self.model.weights) } else { &self.own }
    }

    pub(crate) fn last_layer_mut(&mut self) -> &mut [f64] {
        &mut self.own
    }

    pub(crate) fn past(&self) -> (&[f64], &[f64]) {
        self.past.split_at(self.window.outputs())
    }

    pub(crate) fn memory(&self) -> &[f64] {
        self.below.get(self.window.n..).unwrap_or_default()
    }

    /// Rollout of the equations over a past window, from its last outputs and memory; a no-op without equations.
    pub(crate) fn of_equations(
        &mut self,
        present: &[f64],
        memory: &[f64],
        commands: &[f64],
        into: &mut [f64],
    ) {
        BaseRollout::begin(&self.model, present, memory, &mut self.scratch).roll(commands, into);
    }

    pub(crate) fn features(&self) -> usize {
        self.forward.features()
    }

    /// Inputs of the last layer for a window of outputs and commands in physical units; the last given command is held.
    pub(crate) fn window_features(
        &mut self,
        outputs: &[f64],
        passed: &[f64],
        ahead: &[f64],
        into: &mut [f64],
    ) {
        self.forward.window_features(&self.model, [outputs, passed, ahead], &mut self.scratch, into);
    }

    /// Inputs of the last layer for the present window.
    pub(crate) fn present_features(&mut self, ahead: &[f64], into: &mut [f64]) {
        let (outputs, passed) = self.past.split_at(self.window.outputs());
        self.forward.window_features(&self.model, [outputs, passed, ahead], &mut self.scratch, into);
    }

    pub(crate) fn apply_last_layer(&self, features: &[f64], into: &mut [f64]) {
        self.forward.apply_last_layer(self.last_layer(), features, into);
    }

    pub(crate) fn is_waiting(&self) -> bool {
        self.past.iter().any(|x| x.is_nan())
    }
}

impl Predictor for DirectSession {
    plain!(over_ground advance_observe rollout_snapshots);

    fn outputs(&self) -> usize {
        self.window.n
    }

    fn inputs(&self) -> usize {
        self.window.m
    }

    fn warm_up(&self) -> usize {
        self.window.p.max(self.model.equations().map_or(0, |equations| equations.warm_up()))
    }

    fn reset(&mut self) {
        self.past.fill(f64::NAN);
        self.below.fill(f64::NAN);
    }

    fn observe(&mut self, y: &[f64]) {
        let Window { n, p, .. } = self.window;
        let outputs = &mut self.past[..p * n];
        for (c, &y) in y.iter().enumerate().filter(|(_, y)| y.is_finite()) {
            let present = (p - 1) * n + c;
            if outputs[present].is_nan() {
                // The first measurement of this output fills its history.
                for k in 0..p {
                    outputs[k * n + c] = y;
                }
            }
            outputs[present] = y;
        }
    }

    fn advance(&mut self, c: &[f64]) {
        let Window { n, p, .. } = self.window;
        self.next.copy_from_slice(&self.past[(p - 1) * n..p * n]);
        if !self.is_waiting() {
            let Self { model, forward, past, below, own, scratch, next, .. } = self;
            let last_layer = if own.is_empty() { forward.last_layer(&model.weights) } else { own };
            let memory = below.get(n..).unwrap_or_default();
            forward.roll((model, last_layer), (past, memory), c, scratch, next);
        }
        if let Some(equations) = self.model.equations() {
            let present = &self.past[(p - 1) * n..p * n];
            // A prediction that is not finite (unknown past, divergence) does not enter the history.
            if !self.next.iter().all(|y| y.is_finite()) {
                self.next.copy_from_slice(present);
            }
            self.below[..n].copy_from_slice(present);
            equations.wait(&mut self.below, c, &mut self.scratch);
        }
        let (outputs, commands) = self.past.split_at_mut(p * n);
        push(outputs, &self.next);
        push(commands, c);
    }

    fn output(&self, y: &mut [f64]) {
        let Window { n, p, .. } = self.window;
        y.copy_from_slice(&self.past[(p - 1) * n..p * n]);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        rollout_steps(commands, self.window.m, y, self.window.n);
        let scratch = work.take(self.scratch.len());
        self.forward.roll(
            (&self.model, self.last_layer()),
            (&self.past, self.memory()),
            commands,
            scratch,
            y,
        );
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let fits = |memory: &BatchRollout| memory.fits(self, count);
        match work.batch(fits, || BatchRollout::new(self, count)) {
            Some(memory) => memory.rollout(self, count, commands, y),
            None => rollout_each(self, count, commands, work, y),
        }
    }

    fn snapshot_len(&self) -> usize {
        self.past.len() + self.memory().len() + self.own.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        let (past, rest) = into.split_at_mut(self.past.len());
        let (memory, own) = rest.split_at_mut(self.memory().len());
        past.copy_from_slice(&self.past);
        memory.copy_from_slice(self.memory());
        own.copy_from_slice(&self.own);
    }

    fn restore(&mut self, from: &[f64]) {
        let (past, rest) = from.split_at(self.past.len());
        let (memory, own) = rest.split_at(self.memory().len());
        self.past.copy_from_slice(past);
        if let Some(into) = self.below.get_mut(self.window.n..) {
            into.copy_from_slice(memory);
        }
        self.own.copy_from_slice(own);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}
