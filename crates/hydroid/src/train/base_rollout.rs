//! Rollouts of the base equations of a direct predictor. They do not depend on the weights and are computed once.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::Scaling;
use hydroid_core::model::sparse::Equations;
use rayon::prelude::*;

use crate::log::Trajectory;

/// Rollouts of equations from each sample of a run: from the measurement (a missing value is held) and the signal
/// memory (lags, past values) of the run so far. The memory use is `H` times that of the outputs.
#[derive(Clone, Debug)]
pub(super) struct BaseRollout<T> {
    /// Scaled `e_{k+1} .. e_{k+H}` of each sample, `samples x H x outputs`: NaN while the signal memory is incomplete;
    /// the last value is held beyond the end of the run.
    ahead: Vec<T>,
    /// Row length: `H x outputs`.
    row: usize,
    /// State of the equations at each sample, `samples x state`: outputs, then signal memory.
    states: Vec<f64>,
    state: usize,
}

impl<T: Scalar> BaseRollout<T> {
    /// Rollouts along a run over `horizon` samples; the error is the time \[s\] from which the equations diverge.
    pub(super) fn new(
        equations: &Equations,
        run: &Trajectory,
        scaling: &Scaling,
        horizon: usize,
    ) -> Result<Self, f64> {
        let (n, state) = (equations.outputs(), equations.state_len());
        let states = forward(equations, run);
        let row = horizon * n;
        let mut ahead = vec![T::nan(); run.len() * row];
        let first = equations.warm_up() - 1;
        let room = || (vec![0.0; state], vec![0.0; equations.scratch()]);
        ahead.par_chunks_mut(row).enumerate().skip(first).for_each_init(room, |(now, scratch), (k, into)| {
            now.copy_from_slice(&states[k * state..(k + 1) * state]);
            for (j, into) in into.chunks_exact_mut(n).enumerate() {
                if k + j + 1 < run.len() {
                    equations.step(now, run.inputs.row(k + j), scratch);
                }
                for (i, into) in into.iter_mut().enumerate() {
                    *into = T::of((now[i] - scaling.output_mean[i]) / scaling.output_scale[i]);
                }
            }
        });
        let base_rollout = Self { ahead, row, states, state };
        let runs_away = |&k: &usize| {
            let given = k..(k + horizon).min(run.len() - 1);
            let known = base_rollout.states[k * state..(k + 1) * state].iter().all(|x| x.is_finite());
            known
                && !base_rollout.is_known(k)
                && given.into_iter().all(|j| run.inputs.row(j).iter().all(|c| c.is_finite()))
        };
        match (first..run.len()).find(runs_away) {
            Some(k) => Err(run.t0 + k as f64 * run.dt),
            None => Ok(base_rollout),
        }
    }

    /// Whether the rollout from a sample is finite.
    pub(super) fn is_known(&self, k: usize) -> bool {
        self.ahead(k).iter().all(|e| e.is_finite())
    }

    /// `e_{k+1} .. e_{k+H}`, row by row.
    pub(super) fn ahead(&self, k: usize) -> &[T] {
        &self.ahead[k * self.row..(k + 1) * self.row]
    }

    pub(super) fn state(&self, k: usize) -> &[f64] {
        &self.states[k * self.state..(k + 1) * self.state]
    }
}

fn forward(equations: &Equations, run: &Trajectory) -> Vec<f64> {
    let (n, len) = (equations.outputs(), equations.state_len());
    let mut now = vec![f64::NAN; len];
    let mut scratch = vec![0.0; equations.scratch()];
    let mut states = Vec::with_capacity(run.len() * len);
    for k in 0..run.len() {
        for (own, y) in now[..n].iter_mut().zip(run.outputs.row(k)) {
            *own = if y.is_nan() { *own } else { *y };
        }
        states.extend_from_slice(&now);
        equations.wait(&mut now, run.inputs.row(k), &mut scratch);
    }
    states
}
