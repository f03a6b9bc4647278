//! A batch of sequences with a record for backpropagation through time.

use super::cells::{Back, Cells, Forward};
use super::{clear_padding, padded};
use crate::math::Scalar;
use crate::math::aligned::Aligned;
use crate::model::recurrent::network::Network;

/// A batch of sequences, step by step, forward and backward through time.
///
/// ```text
/// state_{k+1} = f(state_k, x_k),   y_k = g(state_{k+1}),   k = 0 .. steps - 1
/// ```
///
/// All matrices are `features x lanes`, row by row, one sequence in each lane; padding [`lanes`](Self::lanes) have no
/// effect. Inputs and adjoints are given step by step, because they may depend on earlier results: with output
/// feedback, `y_k` is written into the input of step `k + 1`, and the backward pass adds the input's adjoint of step
/// `k + 1` to the output's adjoint of step `k`. Only [`new`](Self::new) allocates.
///
/// ```
/// use hydroid_core::model::recurrent::{Cell, Network, Tape};
///
/// let network = Network { cell: Cell::Gru { hidden: 8 }, inputs: 2, outputs: 1, read_out: true };
/// let weights = vec![0.1; network.weights()];
/// let mut tape = Tape::new(&network, 10, 3); // 10 steps of 3 sequences
/// tape.load(&weights);
/// tape.state_mut().fill(0.0);
/// for k in 0..10 {
///     tape.input_mut(k).fill(0.5);
///     tape.step(k);
/// }
/// tape.begin_backward();
/// for k in (0..10).rev() {
///     let lanes = tape.lanes();
///     tape.output_adjoint_mut(k)[..lanes].fill(1.0); // L = the sum of all outputs
///     tape.step_back(k);
/// }
/// let mut gradient = vec![0.0; network.weights()];
/// tape.gradient(&mut gradient);
/// assert_eq!(*gradient.last().unwrap(), 30.0_f64); // bias of the read-out
/// ```
#[derive(Clone, Debug)]
pub struct Tape<T> {
    cells: Cells<T>,
    steps: usize,
    sequences: usize,
    lanes: usize,
    state_len: usize,
    input_len: usize,
    output_len: usize,
    record_len: usize,
    /// Offset of the output in a state, without read-out.
    shown: Option<usize>,
    states: Aligned<T>,
    inputs: Aligned<T>,
    records: Aligned<T>,
    outputs: Aligned<T>,
    output_adjoints: Aligned<T>,
    state_adjoint: Aligned<T>,
    input_adjoint: Aligned<T>,
    scratch: Aligned<T>,
}

impl<T: Scalar> Tape<T> {
    /// A tape for `steps` steps of `sequences` sequences, all numbers zero.
    ///
    /// # Panics
    /// If the network is invalid ([`Network::check`]), or there is no sequence.
    pub fn new(network: &Network, steps: usize, sequences: usize) -> Self {
        if let Err(error) = network.check() {
            panic!("{error}");
        }
        assert!(sequences > 0, "a batch of no sequences: give one at least");
        let lanes = padded(sequences);
        let cells = Cells::new(network, lanes);
        let outputs = if network.read_out { network.outputs } else { 0 };
        let shown = (!network.read_out).then(|| (network.state_len() - network.outputs) * lanes);
        Self {
            steps,
            sequences,
            lanes,
            state_len: network.state_len() * lanes,
            input_len: network.inputs * lanes,
            output_len: network.outputs * lanes,
            record_len: cells.record_rows() * lanes,
            shown,
            states: Aligned::zeros((steps + 1) * network.state_len() * lanes),
            inputs: Aligned::zeros(steps * network.inputs * lanes),
            records: Aligned::zeros(steps * cells.record_rows() * lanes),
            outputs: Aligned::zeros(steps * outputs * lanes),
            output_adjoints: Aligned::zeros(steps * network.outputs * lanes),
            state_adjoint: Aligned::zeros(network.state_len() * lanes),
            input_adjoint: Aligned::zeros(network.inputs * lanes),
            scratch: Aligned::zeros(cells.scratch_rows() * lanes),
            cells,
        }
    }

    /// Largest number of steps.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Number of sequences.
    pub fn sequences(&self) -> usize {
        self.sequences
    }

    /// Number of sequences rounded up: the length of a row.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Loads the flat weights of the network ([`Network::tensors`]).
    ///
    /// # Panics
    /// If there are fewer weights than the network has.
    pub fn load(&mut self, weights: &[T]) {
        self.cells.load(weights);
    }

    /// The state before the first step, `state_len x lanes`.
    pub fn state_mut(&mut self) -> &mut [T] {
        &mut self.states[..self.state_len]
    }

    /// The state before step `k`, `state_len x lanes`; after the last step for `k = steps`.
    pub fn state(&self, k: usize) -> &[T] {
        &self.states[k * self.state_len..(k + 1) * self.state_len]
    }

    /// The input of step `k`, `inputs x lanes`.
    pub fn input_mut(&mut self, k: usize) -> &mut [T] {
        &mut self.inputs[k * self.input_len..(k + 1) * self.input_len]
    }

    /// Step `k`: from state `k` and input `k` to state `k + 1` and output `k`.
    pub fn step(&mut self, k: usize) {
        let sequences = self.sequences;
        if k == 0 {
            clear_padding(self.state_mut(), sequences);
        }
        clear_padding(self.input_mut(k), sequences);
        let (before, after) = self.states.split_at_mut((k + 1) * self.state_len);
        let output_len = if self.shown.is_some() { 0 } else { self.output_len };
        self.cells.forward(Forward {
            state: &before[k * self.state_len..],
            input: &self.inputs[k * self.input_len..(k + 1) * self.input_len],
            record: &mut self.records[k * self.record_len..(k + 1) * self.record_len],
            next: &mut after[..self.state_len],
            output: &mut self.outputs[k * output_len..(k + 1) * output_len],
        });
    }

    /// The output of step `k`, computed from state `k + 1`, `outputs x lanes`.
    pub fn output(&self, k: usize) -> &[T] {
        match self.shown {
            Some(shown) => &self.state(k + 1)[shown..],
            None => &self.outputs[k * self.output_len..(k + 1) * self.output_len],
        }
    }

    /// Begins a backward pass: sets the gradient and all adjoints to zero.
    pub fn begin_backward(&mut self) {
        self.cells.clear();
        self.output_adjoints.fill(T::zero());
        self.state_adjoint.fill(T::zero());
        self.input_adjoint.fill(T::zero());
    }

    /// `dL/dy_k`, the direct effect of output `k` on the loss, `outputs x lanes`; read by `step_back(k)`.
    pub fn output_adjoint_mut(&mut self, k: usize) -> &mut [T] {
        &mut self.output_adjoints[k * self.output_len..(k + 1) * self.output_len]
    }

    /// Backward step `k`: adds to the gradient of the weights, and propagates the state's adjoint from state `k + 1` to
    /// state `k`. Called from the last step down, once after each [`step`](Self::step), whose record is overwritten.
    pub fn step_back(&mut self, k: usize) {
        let sequences = self.sequences;
        clear_padding(self.output_adjoint_mut(k), sequences);
        clear_padding(&mut self.state_adjoint, sequences);
        self.cells.back(Back {
            state: &self.states[k * self.state_len..(k + 1) * self.state_len],
            input: &self.inputs[k * self.input_len..(k + 1) * self.input_len],
            record: &mut self.records[k * self.record_len..(k + 1) * self.record_len],
            next: &self.states[(k + 1) * self.state_len..(k + 2) * self.state_len],
            output_adjoint: &self.output_adjoints[k * self.output_len..(k + 1) * self.output_len],
            state_adjoint: &mut self.state_adjoint,
            input_adjoint: &mut self.input_adjoint,
            scratch: &mut self.scratch,
        });
    }

    /// `dL/dx_k` of the last backward step, `inputs x lanes`.
    pub fn input_adjoint(&self) -> &[T] {
        &self.input_adjoint
    }

    /// `dL/dstate`, `state_len x lanes`; of state `k` after `step_back(k)`. Between steps it may be added to (a loss on
    /// the state) or set to zero (truncation).
    pub fn state_adjoint_mut(&mut self) -> &mut [T] {
        &mut self.state_adjoint
    }

    /// The gradient of the flat weights, summed over steps and sequences in a fixed order.
    ///
    /// # Panics
    /// If `into` is shorter than the weights.
    pub fn gradient(&self, into: &mut [T]) {
        self.cells.gradient(into);
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use pulp::Arch;

    use super::*;
    use crate::model::recurrent::Cell;

    fn results<T: Scalar>(network: &Network, arch: Arch) -> Vec<T> {
        let number = |k: usize| T::of(0.9 * (0.7 * (k + 1) as f64).sin());
        let weights: Vec<T> = (0..network.weights()).map(number).collect();
        let mut tape = Tape::<T>::new(network, 6, 75);
        tape.cells.arch = arch;
        tape.load(&weights);
        for k in 0..6 {
            tape.input_mut(k).iter_mut().enumerate().for_each(|(j, x)| *x = number(31 * k + j));
            tape.step(k);
        }
        tape.begin_backward();
        for k in (0..6).rev() {
            tape.output_adjoint_mut(k).iter_mut().enumerate().for_each(|(j, x)| *x = number(17 * k + j));
            tape.step_back(k);
        }
        let mut gradient = vec![T::zero(); weights.len()];
        tape.gradient(&mut gradient);
        [&gradient, tape.state(6), &tape.state_adjoint].concat()
    }

    #[test]
    fn every_path_gives_the_same_bits() {
        let mut paths = Vec::new();
        paths.extend(pulp::x86::V3::try_new().map(Arch::V3));
        paths.extend(pulp::x86::V4::try_new().map(Arch::V4));
        for (cell, read_out) in [
            (Cell::Lstm { hidden: 7, projection: Some(3) }, false),
            (Cell::Lstm { hidden: 5, projection: None }, true),
            (Cell::Gru { hidden: 7 }, true),
            (Cell::Vanilla { hidden: 6, layers: 3 }, true),
        ] {
            let network = Network { cell, inputs: 5, outputs: 3, read_out };
            let single: Vec<u32> =
                results::<f32>(&network, Arch::Scalar).into_iter().map(f32::to_bits).collect();
            let double: Vec<u64> =
                results::<f64>(&network, Arch::Scalar).into_iter().map(f64::to_bits).collect();
            for &arch in &paths {
                assert!(
                    results::<f32>(&network, arch).into_iter().map(f32::to_bits).eq(single.iter().copied())
                );
                assert!(
                    results::<f64>(&network, arch).into_iter().map(f64::to_bits).eq(double.iter().copied())
                );
            }
        }
    }
}
