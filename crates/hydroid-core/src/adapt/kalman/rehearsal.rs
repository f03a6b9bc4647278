//! Rehearsal: windows of the training data are replayed during the run, so that the weights do not forget them.
//!
//! Robins, "Catastrophic forgetting, rehearsal and pseudorehearsal", Connection Science 7 (1995) 123.

use alloc::vec;
use alloc::vec::Vec;

use super::filter::{Correction, Filter};
use super::learnable::{Learnable, SharedWeightStates};
use crate::memory::Memory;

/// Most samples of all windows together, which bounds their memory.
const MOST_SAMPLES: usize = 1_000_000;

/// Options of rehearsal (experience replay).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RehearsalOptions {
    /// Largest number of stored windows. All of them have at most 1,000,000 samples together.
    pub windows: usize,
    /// Samples of a window.
    pub samples: usize,
    /// Samples of the run for each rehearsed sample.
    pub every: usize,
    /// Variance of each hidden state at the start of a window; the state is that of the initial weights.
    pub initial_state: f64,
    /// Factor of the measurement noise `R` for rehearsed samples.
    pub noise_factor: f64,
}

impl RehearsalOptions {
    pub(super) fn is_valid(&self) -> bool {
        let Self { windows, samples, every, initial_state, noise_factor } = *self;
        let finite = initial_state.is_finite() && noise_factor.is_finite();
        windows.min(samples).min(every) > 0
            && windows.saturating_mul(samples) <= MOST_SAMPLES
            && finite
            && initial_state >= 0.0
            && noise_factor > 0.0
    }
}

type Sample<'a> = (&'a mut [f64], &'a mut [f64]);

/// Stored windows, and the position in them. They are replayed on the second of two [`SharedWeightStates`].
#[derive(Clone, Debug)]
pub(super) struct Rehearsal {
    options: RehearsalOptions,
    /// Hidden state at the start of each window; `x` and `z` of each sample.
    states: Vec<f64>,
    samples: Vec<f64>,
    /// Length of `x`, and of `x` and `z`.
    inputs: usize,
    row: usize,
    stored: usize,
    position: usize,
    /// Samples of the run since the last rehearsed one.
    since: usize,
}

impl Rehearsal {
    pub(super) fn new<M: Learnable>(model: &M, options: RehearsalOptions) -> Self {
        let row = model.inputs() + model.outputs();
        Self {
            states: vec![0.0; options.windows * model.state_len()],
            samples: vec![0.0; options.windows * options.samples * row],
            inputs: model.inputs(),
            row,
            stored: 0,
            position: 0,
            since: 0,
            options,
        }
    }

    pub(super) fn options(&self) -> &RehearsalOptions {
        &self.options
    }

    /// Memory of one more window: the state at its start, and `x` and `z` of each sample.
    pub(super) fn next_window(&mut self) -> Option<(&mut [f64], impl Iterator<Item = Sample<'_>>)> {
        let Self { options: RehearsalOptions { windows, samples, .. }, stored, inputs, row, .. } = *self;
        if stored == windows {
            return None;
        }
        self.stored += 1;
        let n = self.states.len() / windows;
        let rows = self.samples[stored * samples * row..(stored + 1) * samples * row].chunks_exact_mut(row);
        Some((&mut self.states[stored * n..(stored + 1) * n], rows.map(move |row| row.split_at_mut(inputs))))
    }

    pub(super) fn begin_window(&mut self) {
        self.position -= self.position % self.options.samples;
        self.since = 0;
    }

    /// To be called after each sample of the run: rehearses the next sample of a window if it is due. Returns whether
    /// the weights may have changed; they leak and gain noise in a rehearsed sample as well.
    pub(super) fn advance<M: Learnable>(&mut self, filter: &mut Filter<SharedWeightStates<M>>) -> bool {
        self.since += 1;
        if self.stored == 0 || !filter.learns() || self.since < self.options.every {
            return false;
        }
        self.since = 0;
        let RehearsalOptions { windows, samples, initial_state, noise_factor, .. } = self.options;
        let n = self.states.len() / windows;
        filter.model.select(1);
        if self.position.is_multiple_of(samples) {
            let window = self.position / samples;
            filter.begin_active(&self.states[window * n..(window + 1) * n], initial_state);
        }
        let (x, z) =
            self.samples[self.position * self.row..(self.position + 1) * self.row].split_at(self.inputs);
        filter.advance(x);
        let of_run = filter.replace_noise_scale(noise_factor);
        let diverged = filter.observe(z) == Correction::Diverged;
        filter.replace_noise_scale(of_run);
        filter.model.select(0);
        self.position = (self.position + 1) % (self.stored * samples);
        if diverged {
            self.begin_window();
        }
        true
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.numbers(&mut self.states);
        memory.numbers(&mut self.samples);
        memory.count(&mut self.stored, self.options.windows);
        memory.count(&mut self.position, (self.stored * self.options.samples).saturating_sub(1));
        memory.count(&mut self.since, self.options.every);
    }
}
