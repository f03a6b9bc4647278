//! Truncated backpropagation through time (BPTT) of recurrent networks: gradients over windows of fixed length.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::{BaseModel, Network, Scaling, Tape};

use super::base::BaseStep;
use super::windows::{ScaledRun, Shape, Window};

/// A recurrent network unrolled over windows in parallel lanes.
///
/// With the scaled outputs `z`, inputs `m`, network `f`, `g`, and base `b`, step `k` of a window is
///
/// ```text
/// h_{k+1} = f(h_k, [m_k z_k]),   p_{k+1} = b(z_k, c_k) + ratio . g(h_{k+1})
/// z_k     = the measurement up to the origin, p_k where it is missing and after the origin (p_0 = 0)
/// L       = sum over k >= origin, outputs i:  w_i (p_{k+1,i} - measured_{k+1,i})^2
/// ```
///
/// In the backward pass, with `a_k = dL/dp_k`,
///
/// ```text
/// dL/dg_{k+1} = ratio . a_{k+1}
/// a_k         = 2 w (p_k - measured_k)  +  (dL/dz_k of f, through feedback) + (db/dz)' a_{k+1},
/// ```
///
/// where the last two terms apply if `z_k` is `p_k`. Source: P. J. Werbos, *Backpropagation through time*, 1990.
#[derive(Clone, Debug)]
pub(super) struct Bptt<T> {
    shape: Shape,
    feedback: bool,
    /// Whether all steps are recorded for the backward pass.
    back: bool,
    tape: Tape<T>,
    base: BaseStep,
    windows: Vec<Window>,
    /// `p_0 .. p_steps`, each `outputs x lanes`.
    predicted: Vec<T>,
    /// `z_k` of the present step.
    seen: Vec<T>,
    /// 1 where `z_k` is `p_k`, `(wash_out + 1) x outputs x lanes`.
    own: Vec<T>,
    /// `dL/dp_k` of the backward pass.
    adjoint: Vec<T>,
    /// Hidden state between steps if steps are not recorded.
    state: Vec<T>,
}

impl<T: Scalar> Bptt<T> {
    pub(super) fn new(
        network: &Network,
        base: &BaseModel,
        scaling: &Scaling,
        feedback: bool,
        shape: Shape,
        size: usize,
        back: bool,
    ) -> Self {
        let steps = shape.wash_out + shape.length;
        let tape = Tape::new(network, if back { steps } else { 1 }, size);
        let (n, lanes) = (shape.outputs, tape.lanes());
        let zeros = |steps: usize| vec![T::zero(); steps * n * lanes];
        Self {
            shape,
            feedback,
            back,
            state: if back { Vec::new() } else { tape.state(0).to_vec() },
            base: BaseStep::new(base, scaling, lanes, if back { steps } else { 0 }),
            tape,
            windows: Vec::with_capacity(size),
            predicted: zeros(steps + 1),
            seen: zeros(1),
            own: zeros(shape.wash_out + 1),
            adjoint: zeros(1),
        }
    }

    pub(super) fn forward(&mut self, weights: &[T], runs: &[ScaledRun<T>], windows: &[Window]) {
        self.windows.clear();
        self.windows.extend_from_slice(windows);
        self.tape.load(weights);
        self.tape.state_mut().fill(T::zero());
        self.base.reset();
        let row = self.shape.outputs * self.tape.lanes();
        self.predicted[..row].fill(T::zero());
        for k in 0..self.shape.wash_out + self.shape.length {
            self.step(k, runs);
        }
    }

    fn step(&mut self, k: usize, runs: &[ScaledRun<T>]) {
        let Shape { outputs: n, inputs: m, wash_out, .. } = self.shape;
        let lanes = self.tape.lanes();
        let row = n * lanes;
        let record = if self.back { k } else { 0 };
        let used = self.windows.len();
        let input = self.tape.input_mut(record);
        // Unused lanes stay zero: old values there may be NaN, and gradients are summed over lanes.
        for row in input.chunks_exact_mut(lanes) {
            row[used..].fill(T::zero());
        }
        for (lane, window) in self.windows.iter().enumerate() {
            let at = (window.origin - wash_out + k) * m;
            for (i, &value) in runs[window.run].inputs[at..at + m].iter().enumerate() {
                input[i * lanes + lane] = value;
            }
        }
        let recurs = self.base.is_recursive();
        let (before, after) = self.predicted.split_at_mut((k + 1) * row);
        let predicted = &before[k * row..];
        if self.feedback || recurs {
            self.seen.copy_from_slice(predicted);
            if k <= wash_out {
                let own = &mut self.own[k * row..(k + 1) * row];
                own.fill(T::one());
                for (lane, window) in self.windows.iter().enumerate() {
                    let at = (window.origin - wash_out + k) * n;
                    for (i, &value) in runs[window.run].outputs[at..at + n].iter().enumerate() {
                        if !value.is_nan() {
                            self.seen[i * lanes + lane] = value;
                            own[i * lanes + lane] = T::zero();
                        }
                    }
                }
            }
        }
        if self.feedback {
            input[m * lanes..].copy_from_slice(&self.seen);
        }
        self.tape.step(record);
        let next = &mut after[..row];
        let windows = &self.windows;
        let command = |lane: usize| {
            let window: &Window = windows.get(lane)?;
            let at = (window.origin - wash_out + k) * m;
            runs[window.run].commands.get(at..at + m)
        };
        self.base.step(k, &self.seen, command, next);
        let given = self.tape.output(record);
        for (i, &ratio) in self.base.ratio.iter().enumerate() {
            let ratio = T::of(ratio);
            let range = i * lanes..(i + 1) * lanes;
            for (next, &g) in next[range.clone()].iter_mut().zip(&given[range]) {
                *next += ratio * g;
            }
            next[i * lanes + used..(i + 1) * lanes].fill(T::zero());
        }
        if !self.back {
            self.state.copy_from_slice(self.tape.state(1));
            self.tape.state_mut().copy_from_slice(&self.state);
        }
    }

    pub(super) fn compare(&self, runs: &[ScaledRun<T>], step: usize, mut each: impl FnMut(usize, usize, T)) {
        let (n, lanes) = (self.shape.outputs, self.tape.lanes());
        let predicted = &self.predicted[(self.shape.wash_out + step + 1) * n * lanes..][..n * lanes];
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
        let (n, lanes) = (self.shape.outputs, self.tape.lanes());
        let most = T::of(most);
        let rows = self.predicted[(self.shape.wash_out + 1) * n * lanes..].chunks_exact(lanes);
        rows.into_iter().any(|row| row[..self.windows.len()].iter().any(|z| z.is_nan() || z.abs() > most))
    }

    /// Writes the gradient of `factor` times the loss of the last [`forward`](Self::forward) to `gradient`.
    pub(super) fn backward(
        &mut self,
        runs: &[ScaledRun<T>],
        channel_weights: &[f64],
        factor: f64,
        gradient: &mut [T],
    ) {
        let Shape { outputs: n, inputs: m, wash_out, length, .. } = self.shape;
        let lanes = self.tape.lanes();
        let row = n * lanes;
        let factors: Vec<T> = channel_weights.iter().map(|w| T::of(2.0 * factor * w)).collect();
        let recurrent = self.feedback || self.base.is_recursive();
        self.tape.begin_backward();
        let mut adjoint = core::mem::take(&mut self.adjoint);
        adjoint.fill(T::zero());
        for k in (0..wash_out + length).rev() {
            if k >= wash_out {
                self.compare(runs, k - wash_out, |i, lane, error| {
                    adjoint[i * lanes + lane] += factors[i] * error;
                });
            }
            let given = self.tape.output_adjoint_mut(k);
            for (i, &ratio) in self.base.ratio.iter().enumerate() {
                let ratio = T::of(ratio);
                let range = i * lanes..(i + 1) * lanes;
                for (given, &a) in given[range.clone()].iter_mut().zip(&adjoint[range]) {
                    *given = ratio * a;
                }
            }
            self.tape.step_back(k);
            if !recurrent {
                adjoint.fill(T::zero());
                continue;
            }
            self.base.back(k, &mut adjoint);
            if self.feedback {
                for (a, &x) in adjoint.iter_mut().zip(&self.tape.input_adjoint()[m * lanes..]) {
                    *a += x;
                }
            }
            if k <= wash_out {
                for (a, &own) in adjoint.iter_mut().zip(&self.own[k * row..(k + 1) * row]) {
                    *a *= own;
                }
            }
        }
        self.adjoint = adjoint;
        self.tape.gradient(gradient);
    }
}
