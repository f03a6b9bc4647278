//! Actuators with a limited rate in front of a model.
//!
//! A rudder or an azimuth follows its command at the rate of its steering gear. The position `a_k` under the command `c_k`,
//! in samples of `dt` seconds, is
//!
//! ```text
//! a_k = sat(c_k, a_{k-1} - rate dt, a_{k-1} + rate dt),        a_0 = c_0
//! ```
//!
//! and the model takes the positions as its inputs. The map is idempotent: positions are their own positions. First-order
//! lags are part of the models themselves.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use crate::adapt::{Adapter, Learning, Rehearsing, SaveState};
use crate::memory::Memory;
use crate::predict::{Predictor, Workspace, delegate};

/// Positions of the actuators behind a row of commands.
#[derive(Clone, Debug, PartialEq)]
pub struct RateLimiter {
    /// Largest change in a sample; infinite without a limit.
    steps: Vec<f64>,
    /// Last positions; NaN before the first command.
    positions: Vec<f64>,
}

impl RateLimiter {
    /// A limiter at the start of a run, for one rate per input \[unit/s\] (`None`: no limit) and samples of `dt` seconds;
    /// `None` if nothing is limited, or a rate is not positive.
    pub fn new(rates: impl IntoIterator<Item = Option<f64>>, dt: f64) -> Option<Self> {
        let steps: Vec<f64> =
            rates.into_iter().map(|rate| rate.map_or(f64::INFINITY, |rate| rate * dt)).collect();
        let limited = steps.iter().any(|step| step.is_finite());
        let positive = steps.iter().all(|&step| step > 0.0);
        (limited && positive).then(|| Self { positions: vec![f64::NAN; steps.len()], steps })
    }

    /// Replaces a row of commands by the positions. A command that is NaN stays, and moves nothing.
    ///
    /// # Panics
    /// If the row has fewer numbers than there are inputs.
    pub fn advance(&mut self, row: &mut [f64]) {
        advance(&self.steps, &mut self.positions, row);
    }

    /// Returns to the start of a run.
    pub fn reset(&mut self) {
        self.positions.fill(f64::NAN);
    }

    /// Last positions; NaN before the first command.
    pub fn positions(&self) -> &[f64] {
        &self.positions
    }

    /// Restores [`positions`](Self::positions).
    ///
    /// # Panics
    /// If there is not one number for each input.
    pub fn restore(&mut self, positions: &[f64]) {
        self.positions.copy_from_slice(positions);
    }

    /// Replaces rows of commands that follow the present positions, which stay.
    fn filter(&self, positions: &mut [f64], commands: &mut [f64]) {
        positions.copy_from_slice(&self.positions);
        for row in commands.chunks_exact_mut(self.steps.len()) {
            advance(&self.steps, positions, row);
        }
    }
}

fn advance(steps: &[f64], positions: &mut [f64], row: &mut [f64]) {
    for ((position, step), command) in positions.iter_mut().zip(steps).zip(row) {
        if position.is_finite() && !command.is_nan() {
            *command = command.clamp(*position - step, *position + step);
        }
        if command.is_finite() {
            *position = *command;
        }
    }
}

/// A session of a model behind actuators with limited rates: a predictor or an adapter.
pub struct RateLimited<P: Predictor + ?Sized = dyn Predictor> {
    inner: Box<P>,
    limiter: RateLimiter,
    row: Vec<f64>,
}

impl<P: Predictor + ?Sized> RateLimited<P> {
    /// A session behind a limiter at the start of a run.
    ///
    /// # Panics
    /// If the limiter has another number of inputs.
    pub fn new(inner: Box<P>, limiter: RateLimiter) -> Self {
        assert_eq!(limiter.steps.len(), inner.inputs(), "a rate for each input");
        let row = vec![0.0; limiter.steps.len()];
        Self { inner, limiter, row }
    }

    fn take_command(&mut self, c: &[f64]) {
        self.row.copy_from_slice(c);
        self.limiter.advance(&mut self.row);
    }
}

/// Scratch for rows of commands and a row of positions, and the workspace of the model.
fn scratch(work: &mut Workspace, commands: usize, inputs: usize) -> (&mut [f64], &mut [f64], &mut Workspace) {
    let (buffer, [work, _]) = work.take_pair(commands + inputs);
    let (commands, positions) = buffer.split_at_mut(commands);
    (commands, positions, work)
}

impl<P: Predictor + ?Sized> Predictor for RateLimited<P> {
    delegate!(inner: outputs inputs warm_up observe_heading current output output_through_water observe);

    fn reset(&mut self) {
        self.limiter.reset();
        self.inner.reset();
    }

    fn advance(&mut self, c: &[f64]) {
        self.take_command(c);
        self.inner.advance(&self.row);
    }

    fn advance_observe(&mut self, c: &[f64], y: &[f64]) {
        self.take_command(c);
        self.inner.advance_observe(&self.row, y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let (rows, positions, work) = scratch(work, commands.len(), self.inputs());
        rows.copy_from_slice(commands);
        self.limiter.filter(positions, rows);
        self.inner.rollout(rows, work, y);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let (rows, positions, work) = scratch(work, commands.len(), self.inputs());
        rows.copy_from_slice(commands);
        for sequence in rows.chunks_exact_mut((commands.len() / count.max(1)).max(1)) {
            self.limiter.filter(positions, sequence);
        }
        self.inner.rollout_batch(count, rows, work, y);
    }

    fn snapshot_len(&self) -> usize {
        self.inputs() + self.inner.snapshot_len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        let (own, inner) = into.split_at_mut(self.inputs());
        own.copy_from_slice(&self.limiter.positions);
        self.inner.snapshot(inner);
    }

    fn restore(&mut self, from: &[f64]) {
        let (own, inner) = from.split_at(self.inputs());
        self.limiter.positions.copy_from_slice(own);
        self.inner.restore(inner);
    }

    fn rollout_snapshots(
        &mut self,
        count: usize,
        snapshots: &[f64],
        commands: &[f64],
        work: &mut Workspace,
        y: &mut [f64],
    ) {
        let (own, inner) = (self.inputs(), self.inner.snapshot_len());
        assert_eq!(snapshots.len(), count * (own + inner), "whole snapshots");
        let (buffer, [work, _]) = work.take_pair(commands.len() + count * inner);
        let (rows, states) = buffer.split_at_mut(commands.len());
        rows.copy_from_slice(commands);
        for (state, from) in
            states.chunks_exact_mut(inner.max(1)).zip(snapshots.chunks_exact((own + inner).max(1)))
        {
            state.copy_from_slice(&from[own..]);
        }
        let sequences = rows.chunks_exact_mut((commands.len() / count.max(1)).max(1));
        for (sequence, from) in sequences.zip(snapshots.chunks_exact((own + inner).max(1))) {
            self.limiter.positions.copy_from_slice(&from[..own]);
            sequence.chunks_exact_mut(own.max(1)).for_each(|row| self.limiter.advance(row));
        }
        let (rows, states) = buffer.split_at(commands.len());
        self.inner.rollout_snapshots(count, states, rows, work, y);
        if let Some(last) = snapshots.chunks_exact((own + inner).max(1)).last() {
            self.restore(last);
        }
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(RateLimited::<dyn Predictor> {
            inner: self.inner.fork(),
            limiter: self.limiter.clone(),
            row: self.row.clone(),
        })
    }
}

impl Learning for RateLimited<dyn Adapter> {
    delegate!(inner: outcome innovations weights freeze scale_noise restart health guard);

    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    ) {
        let (rows, positions, work) = scratch(work, commands.len(), self.inner.inputs());
        rows.copy_from_slice(commands);
        self.limiter.filter(positions, rows);
        self.inner.deviations(rows, horizons, work, deviations);
    }
}

impl SaveState for RateLimited<dyn Adapter> {
    delegate!(inner: is_sound);

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.numbers(&mut self.limiter.positions);
        self.inner.visit_state(memory);
    }
}

impl Rehearsing for RateLimited<dyn Adapter> {
    delegate!(inner: rehearsal);

    fn store_window(&mut self, outputs: &[f64], commands: &[f64]) {
        let mut rows = commands.to_vec();
        let mut limiter = self.limiter.clone();
        limiter.reset();
        rows.chunks_exact_mut(limiter.steps.len()).for_each(|row| limiter.advance(row));
        self.inner.store_window(outputs, &rows);
    }
}
