//! Forward and backward pass of direct predictors.

use hydroid_core::math::Scalar;
use hydroid_core::model::direct::{Batch, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, Scaling};

use super::chained_rollout::ChainedRollout;
use super::windows::{ScaledRun, Shape, Window};

/// Windows of a direct predictor in parallel lanes, gathered from the runs in place.
///
/// With the scaled outputs `z` and inputs `m`, the history `p` and the horizon `H`
/// ([`Direct`](hydroid_core::model::direct::Direct)), a window at the origin `o` is
///
/// ```text
/// p_{o+1} .. p_{o+H} = base + ratio . f([z_{o-p+1} .. z_o  m_{o-p+1} .. m_{o+H-1}])
/// L                  = sum over k = 1 .. H, outputs i:  w_i (p_{o+k,i} - measured_{o+k,i})^2
/// ```
///
/// `base` is zero, `z_o`, or the rollout of equations from `o` ([`BaseRollout`](super::base_rollout::BaseRollout)). A
/// missing measurement in the history is held, or taken from the next one at the start. A length beyond `H` is chained
/// as in a session; the gradient is of the first horizon only.
#[derive(Clone, Debug)]
pub(super) struct DirectBatch<T> {
    shape: Shape,
    horizon: usize,
    base: Kind,
    /// `correction_scale / output_scale`.
    ratio: Vec<T>,
    batch: Batch<T>,
    windows: Vec<Window>,
    /// Outputs of the history of each window without gaps, `history x outputs x lanes`.
    past: Vec<T>,
    /// `p_{o+1} ..`, each `outputs x lanes`.
    predicted: Vec<T>,
}

#[derive(Clone, Debug)]
enum Kind {
    Nothing,
    Hold,
    /// Equations; beyond the first horizon they continue from the predictions.
    Equations(Box<ChainedRollout>),
}

impl<T: Scalar> DirectBatch<T> {
    pub(super) fn new(
        network: &Perceptron,
        horizon: usize,
        base: &BaseModel,
        scaling: &Scaling,
        shape: Shape,
        size: usize,
    ) -> Self {
        let batch = Batch::new(network, size);
        let row = shape.outputs * batch.lanes();
        let base = match base {
            BaseModel::Nothing => Kind::Nothing,
            BaseModel::Hold => Kind::Hold,
            BaseModel::Equations(equations) => {
                Kind::Equations(Box::new(ChainedRollout::new(equations, scaling, batch.lanes())))
            }
        };
        let ratio = scaling.correction_scale.iter().zip(&scaling.output_scale).map(|(c, s)| T::of(c / s));
        Self {
            shape,
            horizon,
            base,
            ratio: ratio.collect(),
            windows: Vec::with_capacity(size),
            past: vec![T::zero(); (shape.wash_out + 1) * row],
            predicted: vec![T::zero(); shape.length * row],
            batch,
        }
    }

    pub(super) fn forward(&mut self, weights: &[T], runs: &[ScaledRun<T>], windows: &[Window]) {
        self.windows.clear();
        self.windows.extend_from_slice(windows);
        self.fill(runs);
        for first in (0..self.shape.length).step_by(self.horizon) {
            self.read(runs, first);
            self.batch.forward(weights);
            self.stand(runs, first);
            self.predict(first);
        }
    }

    fn fill(&mut self, runs: &[ScaledRun<T>]) {
        let (n, lanes, steps) = (self.shape.outputs, self.batch.lanes(), self.shape.wash_out + 1);
        for (lane, window) in self.windows.iter().enumerate() {
            let from = (window.origin + 1 - steps) * n;
            let seen = &runs[window.run].outputs[from..from + steps * n];
            for i in 0..n {
                let column = || seen[i..].iter().step_by(n);
                // Each output is measured at least once in a window.
                let mut last = column().copied().find(|z| !z.is_nan()).unwrap_or(T::zero());
                for (k, &z) in column().enumerate() {
                    if !z.is_nan() {
                        last = z;
                    }
                    self.past[(k * n + i) * lanes + lane] = last;
                }
            }
        }
    }

    /// Gathers the inputs of the network for predictions from `first` samples after the origins.
    fn read(&mut self, runs: &[ScaledRun<T>], first: usize) {
        let Shape { outputs: n, inputs: m, wash_out, length, .. } = self.shape;
        let lanes = self.batch.lanes();
        let row = n * lanes;
        let past = self.past.chunks_exact(row).chain(self.predicted.chunks_exact(row));
        let (outputs, commands) = self.batch.input_mut().split_at_mut((wash_out + 1) * row);
        for (into, from) in outputs.chunks_exact_mut(row).zip(past.skip(first)) {
            into.copy_from_slice(from);
        }
        for (lane, window) in self.windows.iter().enumerate() {
            let inputs = &runs[window.run].inputs;
            // The last command is held beyond the window.
            let end = window.origin + length - 1;
            let begin = window.origin + first - wash_out;
            for (k, into) in commands.chunks_exact_mut((m * lanes).max(1)).enumerate() {
                let at = (begin + k).min(end) * m;
                for (i, &value) in inputs[at..at + m].iter().enumerate() {
                    into[i * lanes + lane] = value;
                }
            }
        }
    }

    /// Writes the base of the predictions from `first` samples after the origins.
    fn stand(&mut self, runs: &[ScaledRun<T>], first: usize) {
        let lanes = self.batch.lanes();
        let row = self.shape.outputs * lanes;
        let (before, after) = self.predicted.split_at_mut(first * row);
        let last = after.len().min(self.horizon * row);
        let after = &mut after[..last];
        let present = if first == 0 { &self.past } else { &*before };
        let present = &present[present.len() - row..];
        match &mut self.base {
            Kind::Nothing => after.fill(T::zero()),
            Kind::Hold => after.chunks_exact_mut(row).for_each(|into| into.copy_from_slice(present)),
            Kind::Equations(_) if first == 0 => {
                for (lane, window) in self.windows.iter().enumerate() {
                    // Windows exist only in runs with rollouts of these equations.
                    let Some(base_rollout) = &runs[window.run].base_rollout else { continue };
                    for (into, &e) in
                        after.iter_mut().skip(lane).step_by(lanes).zip(base_rollout.ahead(window.origin))
                    {
                        *into = e;
                    }
                }
            }
            Kind::Equations(chain) => {
                let before = &before[(first - self.horizon) * row..];
                chain.continue_from(runs, &self.windows, first, before, after);
            }
        }
    }

    fn predict(&mut self, first: usize) {
        let (n, lanes) = (self.shape.outputs, self.batch.lanes());
        let row = n * lanes;
        let given = self.batch.output().chunks_exact(row);
        for (into, given) in self.predicted[first * row..].chunks_exact_mut(row).zip(given) {
            for i in 0..n {
                for lane in i * lanes..(i + 1) * lanes {
                    into[lane] += self.ratio[i] * given[lane];
                }
            }
        }
    }

    pub(super) fn compare(&self, runs: &[ScaledRun<T>], step: usize, mut each: impl FnMut(usize, usize, T)) {
        let (n, lanes) = (self.shape.outputs, self.batch.lanes());
        let predicted = &self.predicted[step * n * lanes..(step + 1) * n * lanes];
        for (lane, window) in self.windows.iter().enumerate() {
            let at = (window.origin + step + 1) * n;
            for (i, &value) in runs[window.run].outputs[at..at + n].iter().enumerate() {
                if !value.is_nan() {
                    each(i, lane, predicted[i * lanes + lane] - value);
                }
            }
        }
    }

    pub(super) fn exceeds(&self, most: f64) -> bool {
        let most = T::of(most);
        let mut rows = self.predicted.chunks_exact(self.batch.lanes());
        rows.any(|row| row[..self.windows.len()].iter().any(|z| z.is_nan() || z.abs() > most))
    }

    pub(super) fn backward(
        &mut self,
        weights: &[T],
        runs: &[ScaledRun<T>],
        channel_weights: &[f64],
        factor: f64,
        gradient: &mut [T],
    ) {
        let (n, lanes) = (self.shape.outputs, self.batch.lanes());
        let parts = channel_weights.iter().zip(&self.ratio);
        let factors: Vec<T> = parts.map(|(w, &ratio)| T::of(2.0 * factor * w) * ratio).collect();
        let adjoint = self.batch.output_adjoint_mut();
        adjoint.fill(T::zero());
        for (lane, window) in self.windows.iter().enumerate() {
            let at = (window.origin + 1) * n;
            let targets = &runs[window.run].outputs[at..at + self.horizon * n];
            for (c, &value) in targets.iter().enumerate() {
                if !value.is_nan() {
                    let error = self.predicted[c * lanes + lane] - value;
                    adjoint[c * lanes + lane] = factors[c % n] * error;
                }
            }
        }
        self.batch.backward(weights, gradient);
    }
}
