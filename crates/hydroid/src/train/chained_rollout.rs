//! Rollouts of the base equations of a direct predictor beyond its first horizon.

use std::sync::Arc;

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::Scaling;
use hydroid_core::model::sparse::Equations;

use super::windows::{ScaledRun, Window};

/// State of the equations in each lane, in double precision and physical units. For validation only: the gradient is of
/// the first horizon ([`BaseRollout`](super::base_rollout::BaseRollout)).
#[derive(Clone, Debug)]
pub(super) struct ChainedRollout {
    equations: Arc<Equations>,
    mean: Vec<f64>,
    scale: Vec<f64>,
    lanes: usize,
    /// State at the start of the present horizon, for each lane.
    states: Vec<f64>,
    /// State within the horizon.
    now: Vec<f64>,
    scratch: Vec<f64>,
}

impl ChainedRollout {
    pub(super) fn new(equations: &Arc<Equations>, scaling: &Scaling, lanes: usize) -> Self {
        let len = equations.state_len();
        Self {
            mean: scaling.output_mean.clone(),
            scale: scaling.output_scale.clone(),
            lanes,
            states: vec![f64::NAN; lanes * len],
            now: vec![f64::NAN; len],
            scratch: vec![0.0; equations.scratch()],
            equations: Arc::clone(equations),
        }
    }

    /// Writes the rollout from `first` samples after the origins to `after`; `before` are the predictions up to there.
    pub(super) fn continue_from<T: Scalar>(
        &mut self,
        runs: &[ScaledRun<T>],
        windows: &[Window],
        first: usize,
        before: &[T],
        after: &mut [T],
    ) {
        let (n, m, lanes) = (self.equations.outputs(), self.equations.inputs(), self.lanes);
        let (row, len) = (n * lanes, self.equations.state_len());
        let horizon = before.len() / row;
        for (lane, window) in windows.iter().enumerate() {
            let run = &runs[window.run];
            let state = &mut self.states[lane * len..(lane + 1) * len];
            if first == horizon
                && let Some(base_rollout) = &run.base_rollout
            {
                state.copy_from_slice(base_rollout.state(window.origin));
            }
            let command = |k: usize| &run.commands[(window.origin + k) * m..(window.origin + k + 1) * m];
            // The signal memory follows the predictions.
            for (j, z) in before.chunks_exact(row).enumerate() {
                self.equations.wait(state, command(first - horizon + j), &mut self.scratch);
                for i in 0..n {
                    state[i] = self.mean[i] + self.scale[i] * z[i * lanes + lane].wide();
                }
            }
            self.now.copy_from_slice(state);
            for (j, e) in after.chunks_exact_mut(row).enumerate() {
                self.equations.step(&mut self.now, command(first + j), &mut self.scratch);
                for i in 0..n {
                    e[i * lanes + lane] = T::of((self.now[i] - self.mean[i]) / self.scale[i]);
                }
            }
        }
    }
}
