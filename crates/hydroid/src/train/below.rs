//! What equations say of the horizon that begins at each sample of a run. It does not depend on the weights, and is made once.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::Scaling;
use hydroid_core::model::sparse::Equations;
use rayon::prelude::*;

use crate::log::Trajectory;

/// Rollouts of equations along a run.
///
/// At the sample `k` they begin from what was measured, or from the value that was measured last where one is missing, with
/// what the equations remember (lags, past values) walked along the samples before, as a session walks. It takes `H` times
/// the memory of the outputs themselves, in the precision of the training: 17 MB of single precision for two hours of three
/// outputs at 10 Hz and 20 steps.
#[derive(Clone, Debug)]
pub(super) struct Below<T> {
    /// `e_{k+1} .. e_{k+H}` of each sample, scaled, `samples x H x outputs`: NaN where the past is not known; behind the end of
    /// the run the last one stands.
    ahead: Vec<T>,
    /// Numbers of a sample: `H x outputs`.
    row: usize,
    /// State of the equations at each sample, `samples x state`: outputs, then what they remember.
    states: Vec<f64>,
    state: usize,
}

impl<T: Scalar> Below<T> {
    /// Along a run, for a horizon.
    ///
    /// # Errors
    /// The time \[s\] from which they run away within the horizon: no network could correct that.
    pub(super) fn new(
        equations: &Equations,
        run: &Trajectory,
        scaling: &Scaling,
        horizon: usize,
    ) -> Result<Self, f64> {
        let (n, state) = (equations.outputs(), equations.state_len());
        let states = walk(equations, run);
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
        let below = Self { ahead, row, states, state };
        let runs_away = |&k: &usize| {
            let given = k..(k + horizon).min(run.len() - 1);
            let known = below.states[k * state..(k + 1) * state].iter().all(|x| x.is_finite());
            known
                && !below.knows(k)
                && given.into_iter().all(|j| run.inputs.row(j).iter().all(|c| c.is_finite()))
        };
        match (first..run.len()).find(runs_away) {
            Some(k) => Err(run.t0 + k as f64 * run.dt),
            None => Ok(below),
        }
    }

    /// Whether it is known what they say from a sample on.
    pub(super) fn knows(&self, k: usize) -> bool {
        self.ahead(k).iter().all(|e| e.is_finite())
    }

    /// `e_{k+1} .. e_{k+H}`, row by row.
    pub(super) fn ahead(&self, k: usize) -> &[T] {
        &self.ahead[k * self.row..(k + 1) * self.row]
    }

    /// The state at a sample.
    pub(super) fn state(&self, k: usize) -> &[f64] {
        &self.states[k * self.state..(k + 1) * self.state]
    }
}

/// The state of equations at each sample of a run.
fn walk(equations: &Equations, run: &Trajectory) -> Vec<f64> {
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
