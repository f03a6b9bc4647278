//! Rollouts of a recurrent model for many command sequences side by side.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::batch::Rollout;
use super::model::{BaseModel, Recurrent};
use super::session::RecurrentSession;
use crate::model::sparse;

/// Scratch memory for rollouts of one session under many command sequences at once, from its hidden state and with its
/// present weights. Results equal sequential rollouts up to the order of sums.
#[derive(Clone, Debug)]
pub(super) struct BatchRollout {
    sequences: usize,
    model: Arc<Recurrent>,
    network: Rollout<f64>,
    equations: Option<sparse::BatchRollout>,
    /// Present outputs, a row for each output; unused with equations.
    outputs: Vec<f64>,
}

impl BatchRollout {
    /// Memory for `sequences` sequences. `None`, without allocating, for past values in the base, rolled out one by
    /// one.
    pub(super) fn new(session: &RecurrentSession, sequences: usize) -> Option<Self> {
        let model = Arc::clone(session.shared_model());
        let equations = match &model.base {
            BaseModel::Equations(equations) => Some(sparse::BatchRollout::new(equations, sequences)?),
            BaseModel::Nothing | BaseModel::Hold => None,
        };
        let outputs = vec![0.0; if equations.is_some() { 0 } else { model.outputs() * sequences }];
        Some(Self { sequences, network: Rollout::new(&model.network, sequences), equations, outputs, model })
    }

    /// Whether the memory is for the session's model, with any weights, and holds `count` sequences.
    pub(super) fn fits(&self, session: &RecurrentSession, count: usize) -> bool {
        let (theirs, ours) = (session.shared_model(), &self.model);
        let same = |a: &Recurrent, b: &Recurrent| {
            a.network == b.network && a.feedback == b.feedback && a.scaling == b.scaling && a.base == b.base
        };
        count <= self.sequences && (Arc::ptr_eq(theirs, ours) || same(theirs, ours))
    }

    /// Rolls out `count` sequences from the state and with the weights of a session: `commands` are
    /// `count x steps x inputs`, `y` are `count x steps x outputs`.
    ///
    /// # Panics
    /// If the slices do not hold whole sequences of the same number of steps.
    pub(super) fn rollout(
        &mut self,
        session: &RecurrentSession,
        count: usize,
        commands: &[f64],
        y: &mut [f64],
    ) {
        let Self { model, network, equations, outputs, .. } = self;
        let state = session.state();
        network.load(session.weights());
        let (n, m, scaling) = (model.outputs(), model.inputs(), &model.scaling);
        network.set_sequences(count);
        let lanes = network.lanes();
        let steps = y.len() / (n * count);
        assert!(y.len() == steps * n * count && commands.len() == steps * m * count, "whole sequences");
        let (front, hidden) = state.split_at(state.len() - model.network.state_len());
        for (row, &h) in network.state_mut().chunks_exact_mut(lanes).zip(hidden) {
            row.fill(h);
        }
        match equations {
            Some(equations) => equations.begin(front, count),
            None => outputs.chunks_exact_mut(count).zip(front).for_each(|(row, &y)| row.fill(y)),
        }
        for step in 0..steps {
            let command = |i: usize, j: usize| commands[(i * steps + step) * m + j];
            let y_now = match equations {
                Some(equations) => equations.outputs_mut(n, count),
                None => &mut outputs[..n * count],
            };
            for (j, row) in network.input_mut().chunks_exact_mut(lanes).enumerate() {
                if let Some(c) = j.checked_sub(m) {
                    let (mean, scale) = (scaling.output_mean[c], scaling.output_scale[c]);
                    let now = &y_now[c * count..][..count];
                    row.iter_mut().zip(now).for_each(|(x, y)| *x = (y - mean) / scale);
                } else {
                    let (mean, scale) = (scaling.input_mean[j], scaling.input_scale[j]);
                    row[..count]
                        .iter_mut()
                        .enumerate()
                        .for_each(|(i, x)| *x = (command(i, j) - mean) / scale);
                }
            }
            network.step();
            let y_now = match (&model.base, equations.as_mut()) {
                (BaseModel::Equations(below), Some(equations)) => {
                    equations.step(below, count, command);
                    equations.outputs_mut(n, count)
                }
                (base, _) => {
                    if matches!(base, BaseModel::Nothing) {
                        let rows = outputs.chunks_exact_mut(count).zip(&scaling.output_mean);
                        rows.for_each(|(row, &mean)| row.fill(mean));
                    }
                    &mut outputs[..n * count]
                }
            };
            let added = network.output().chunks_exact(lanes).zip(&scaling.correction_scale);
            for (c, (row, (added, scale))) in y_now.chunks_exact_mut(count).zip(added).enumerate() {
                for (i, (now, g)) in row.iter_mut().zip(added).enumerate() {
                    *now += scale * g;
                    y[(i * steps + step) * n + c] = *now;
                }
            }
        }
    }
}
