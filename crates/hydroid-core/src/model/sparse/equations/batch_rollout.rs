//! Rollouts of equations for many command sequences side by side.
#![allow(clippy::inline_always)] // inlined into functions compiled for the processor

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;
use pulp::{Arch, Simd, WithSimd};

use super::{Equations, Sparse};
use crate::actuator::lag_step;
use crate::model::sparse::program::Program;
use crate::model::sparse::signal::Signal;

/// Scratch memory for rollouts of one set of equations under many command sequences at once. Numbers are
/// laid out as in [`Program::evaluate_block`]: a row for each variable, sub-product and output. Results equal
/// [`Equations::step`] up to the order of sums and the last digits of the logistic function of a gate.
#[derive(Clone, Debug)]
pub(crate) struct BatchRollout {
    arch: Arch,
    /// Outputs, inputs and slots of the equations.
    shape: (usize, usize, usize),
    signals: Vec<Signal>,
    dt: f64,
    substeps: usize,
    sequences: usize,
    lags: Vec<Lag>,
    slots: Vec<f64>,
    state: Vec<f64>,
    held: Vec<f64>,
    k: Vec<f64>,
    sum: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
struct Lag {
    slot: usize,
    input: usize,
    /// Decay of a difference to the command after zero, one and two half integration steps.
    decays: [f64; 3],
}

impl BatchRollout {
    /// Memory for `sequences` sequences; `None`, without allocating, for past values, rolled out one by one.
    pub(crate) fn new(equations: &Equations, sequences: usize) -> Option<Self> {
        if equations.signals.iter().any(|signal| !matches!(signal, Signal::Lag { .. })) {
            return None;
        }
        let (n, m) = (equations.outputs, equations.inputs);
        let h = equations.dt / equations.substeps as f64;
        let mut lags = Vec::new();
        for (index, signal) in equations.signals.iter().enumerate() {
            let Signal::Lag { input, time_constant_s } = *signal else { return None };
            let half = Float::exp(-0.5 * h / time_constant_s.0);
            let input = usize::from(input) - n;
            lags.push(Lag { slot: 1 + n + m + index, input, decays: [1.0, half, half * half] });
        }
        let rows = |count: usize| vec![0.0; count * sequences];
        Some(Self {
            arch: Arch::new(),
            shape: (n, m, equations.program.slots()),
            signals: equations.signals.clone(),
            dt: equations.dt,
            substeps: equations.substeps,
            sequences,
            slots: rows(equations.program.slots()),
            state: rows(n + lags.len()),
            held: rows(n),
            k: rows(n),
            sum: rows(n),
            lags,
        })
    }

    /// Rolls out `count` sequences from `state` ([`Equations::step`]): `commands` are `count x steps x inputs`, `y` are
    /// `count x steps x outputs`.
    ///
    /// # Panics
    /// If `count` is too large, the sequences are not whole, or the equations do not [fit](Self::fits).
    pub(crate) fn rollout(
        &mut self,
        equations: &Equations,
        state: &[f64],
        count: usize,
        commands: &[f64],
        y: &mut [f64],
    ) {
        self.begin(state, count);
        self.go(equations, count, commands, y);
    }

    /// As [`rollout`](Self::rollout), each sequence from a state of its own: `states` are `count x` state length.
    ///
    /// # Panics
    /// As [`rollout`](Self::rollout).
    pub(crate) fn rollout_each(
        &mut self,
        equations: &Equations,
        states: &[f64],
        count: usize,
        commands: &[f64],
        y: &mut [f64],
    ) {
        let len = equations.state_len();
        assert!(states.len() == count * len, "one state for each sequence");
        self.begin(&states[..len], count);
        for (variable, row) in self.state.chunks_exact_mut(count).take(len).enumerate() {
            for (x, state) in row.iter_mut().zip(states.chunks_exact(len)) {
                *x = state[variable];
            }
        }
        self.go(equations, count, commands, y);
    }

    fn go(&mut self, equations: &Equations, count: usize, commands: &[f64], y: &mut [f64]) {
        let (n, m) = (equations.outputs, equations.inputs);
        let steps = y.len() / (n * count);
        assert!(y.len() == steps * n * count && commands.len() == steps * m * count, "whole sequences");
        for step in 0..steps {
            self.step(equations, count, |i, j| commands[(i * steps + step) * m + j]);
            for (output, row) in self.outputs_mut(n, count).chunks_exact(count).enumerate() {
                for (i, &x) in row.iter().enumerate() {
                    y[(i * steps + step) * n + output] = x;
                }
            }
        }
    }

    /// Whether the memory is for equations of this structure, with any coefficients, and holds `count` sequences.
    pub(crate) fn fits(&self, equations: &Equations, count: usize) -> bool {
        let shape = (equations.outputs, equations.inputs, equations.program.slots());
        count <= self.sequences
            && shape == self.shape
            && equations.signals == self.signals
            && equations.dt == self.dt
            && equations.substeps == self.substeps
    }

    /// Sets `count` sequences to one state.
    ///
    /// # Panics
    /// If `count` is too large, or the state is of other equations.
    pub(crate) fn begin(&mut self, state: &[f64], count: usize) {
        assert!((1..=self.sequences).contains(&count), "number of sequences out of range");
        assert!(state.len() * self.sequences == self.state.len(), "state of other equations");
        for (row, &x) in self.state.chunks_exact_mut(count).zip(state) {
            row.fill(x);
        }
        self.slots[..count].fill(1.0);
    }

    pub(crate) fn outputs_mut(&mut self, outputs: usize, count: usize) -> &mut [f64] {
        &mut self.state[..outputs * count]
    }

    /// Advances all sequences by a sample; `command` maps sequence and input to a command.
    pub(crate) fn step(
        &mut self,
        equations: &Equations,
        count: usize,
        command: impl Fn(usize, usize) -> f64,
    ) {
        let (n, m) = (equations.outputs, equations.inputs);
        let h = equations.dt / equations.substeps as f64;
        for j in 0..m {
            let row = &mut self.slots[(1 + n + j) * count..][..count];
            for (i, c) in row.iter_mut().enumerate() {
                *c = command(i, j);
            }
        }
        equations.program.block_functions(&mut self.slots, count, true);
        self.products(equations, count, true);
        for _ in 0..equations.substeps {
            self.sum[..n * count].fill(0.0);
            for (halves, weight) in [(0, 1.0), (1, 2.0), (1, 2.0), (2, 1.0)] {
                let offset = halves as f64 * 0.5 * h;
                let outputs = &mut self.slots[count..(1 + n) * count];
                outputs.copy_from_slice(&self.state[..n * count]);
                if halves > 0 {
                    for (x, k) in outputs.iter_mut().zip(&self.k) {
                        *x += offset * k;
                    }
                }
                self.lag(n, m, count, halves);
                equations.program.block_functions(&mut self.slots, count, false);
                self.products(equations, count, false);
                for (sum, k) in self.sum[..n * count].iter_mut().zip(&self.k) {
                    *sum += weight * k;
                }
            }
            for (x, sum) in self.state[..n * count].iter_mut().zip(&self.sum) {
                *x += h / 6.0 * sum;
            }
            self.lag(n, m, count, 2);
            for (index, lag) in self.lags.iter().enumerate() {
                let now = &self.slots[lag.slot * count..][..count];
                self.state[(n + index) * count..][..count].copy_from_slice(now);
            }
        }
    }

    fn lag(&mut self, n: usize, m: usize, count: usize, halves: usize) {
        for (index, lag) in self.lags.iter().enumerate() {
            let (variables, rest) = self.slots.split_at_mut((1 + n + m) * count);
            let commands = &variables[(1 + n + lag.input) * count..][..count];
            let states = &self.state[(n + index) * count..][..count];
            let slot = &mut rest[(lag.slot - 1 - n - m) * count..][..count];
            for ((now, &state), &command) in slot.iter_mut().zip(states).zip(commands) {
                *now = lag_step(state, command, lag.decays[halves]);
            }
        }
    }

    /// Products and sums of held variables, into `held`, or of all, into `k`.
    fn products(&mut self, equations: &Equations, count: usize, held: bool) {
        let (program, outputs) = (&equations.program, equations.outputs);
        let slots = &mut self.slots[..];
        if held {
            let (rows, into) = (&equations.held, &mut self.held[..outputs * count]);
            into.fill(0.0);
            self.arch.dispatch(Block { program, rows, slots, into, count, held });
        } else {
            let (rows, into) = (&equations.moving, &mut self.k[..outputs * count]);
            into.copy_from_slice(&self.held[..outputs * count]);
            self.arch.dispatch(Block { program, rows, slots, into, count, held });
        }
    }
}

struct Block<'a> {
    program: &'a Program,
    rows: &'a Sparse,
    slots: &'a mut [f64],
    into: &'a mut [f64],
    count: usize,
    held: bool,
}

impl WithSimd for Block<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { program, rows, slots, into, count, held } = self;
        program.block_products(slots, count, held);
        let mut start = 0;
        for (sum, &end) in into.chunks_exact_mut(count).zip(&rows.ends) {
            for &(slot, xi) in &rows.entries[start..end] {
                let row = &slots[usize::from(slot) * count..][..count];
                for (sum, x) in sum.iter_mut().zip(row) {
                    *sum += xi * x;
                }
            }
            start = end;
        }
    }
}
