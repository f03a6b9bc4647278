//! A batch of sequences without a record.

use core::mem;

use super::cells::{Cells, Forward};
use super::{clear_padding, padded};
use crate::math::Scalar;
use crate::math::aligned::Aligned;
use crate::model::recurrent::network::Network;

/// A batch of sequences, forward only: each state overwrites the one before.
///
/// Matrices are as in [`Tape`](super::Tape), and results are bit-identical. Some 250 sequences at a time are fastest:
/// more do not fit the second-level cache. Only [`new`](Self::new) allocates.
///
/// ```
/// use hydroid_core::model::recurrent::{Cell, Network, Rollout};
///
/// let network = Network { cell: Cell::Vanilla { hidden: 8, layers: 2 }, inputs: 2, outputs: 1, read_out: true };
/// let mut rollout = Rollout::new(&network, 1000);
/// rollout.load(&vec![0.1_f32; network.weights()]);
/// rollout.state_mut().fill(0.0);
/// for _ in 0..100 {
///     rollout.input_mut().fill(0.5);
///     rollout.step();
/// }
/// assert!(rollout.output()[999] > 0.0);
/// ```
#[derive(Clone, Debug)]
pub struct Rollout<T> {
    cells: Cells<T>,
    network: Network,
    room: usize,
    sequences: usize,
    lanes: usize,
    /// Offset of the output in the state, without read-out.
    shown: Option<usize>,
    state: Aligned<T>,
    next: Aligned<T>,
    input: Aligned<T>,
    record: Aligned<T>,
    output: Aligned<T>,
}

impl<T: Scalar> Rollout<T> {
    /// A batch of `sequences` sequences, all numbers zero.
    ///
    /// # Panics
    /// If the network is invalid ([`Network::check`]), or there is no sequence.
    pub fn new(network: &Network, sequences: usize) -> Self {
        if let Err(error) = network.check() {
            panic!("{error}");
        }
        assert!(sequences > 0, "a batch of no sequences: give one at least");
        let lanes = padded(sequences);
        let cells = Cells::new(network, lanes);
        let outputs = if network.read_out { network.outputs } else { 0 };
        Self {
            network: *network,
            room: sequences,
            sequences,
            lanes,
            shown: (!network.read_out).then(|| (network.state_len() - network.outputs) * lanes),
            state: Aligned::zeros(network.state_len() * lanes),
            next: Aligned::zeros(network.state_len() * lanes),
            input: Aligned::zeros(network.inputs * lanes),
            record: Aligned::zeros(cells.record_rows() * lanes),
            output: Aligned::zeros(outputs * lanes),
            cells,
        }
    }

    /// Number of sequences.
    pub fn sequences(&self) -> usize {
        self.sequences
    }

    /// Sets the number of sequences and discards the present states and inputs.
    ///
    /// # Panics
    /// If there is none, or there are more than at construction.
    pub fn set_sequences(&mut self, sequences: usize) {
        assert!((1..=self.room).contains(&sequences), "number of sequences out of range");
        let lanes = padded(sequences);
        self.sequences = sequences;
        if lanes == self.lanes {
            return;
        }
        let Network { inputs, outputs, .. } = self.network;
        self.lanes = lanes;
        self.cells.set_lanes(lanes);
        self.state.set_len(self.network.state_len() * lanes);
        self.next.set_len(self.network.state_len() * lanes);
        self.input.set_len(inputs * lanes);
        self.record.set_len(self.cells.record_rows() * lanes);
        if self.shown.is_some() {
            self.shown = Some((self.network.state_len() - outputs) * lanes);
        } else {
            self.output.set_len(outputs * lanes);
        }
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

    /// The present state, `state_len x lanes`.
    pub fn state(&self) -> &[T] {
        &self.state
    }

    /// The present state, `state_len x lanes`.
    pub fn state_mut(&mut self) -> &mut [T] {
        &mut self.state
    }

    /// The input of the next step, `inputs x lanes`.
    pub fn input_mut(&mut self) -> &mut [T] {
        &mut self.input
    }

    /// Steps to the next state and its output.
    pub fn step(&mut self) {
        clear_padding(&mut self.state, self.sequences);
        clear_padding(&mut self.input, self.sequences);
        self.cells.forward(Forward {
            state: &self.state,
            input: &self.input,
            record: &mut self.record,
            next: &mut self.next,
            output: &mut self.output,
        });
        mem::swap(&mut self.state, &mut self.next);
    }

    /// The output of the last step, `outputs x lanes`.
    pub fn output(&self) -> &[T] {
        self.shown.map_or(&self.output, |shown| &self.state[shown..])
    }
}
