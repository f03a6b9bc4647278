//! Rehearsal of known waters.

use alloc::vec;
use alloc::vec::Vec;

use super::courses::Courses;
use super::filter::{Correction, Filter};
use super::learnable::Learnable;
use crate::adapt::memory::{Reader, Writer};
use crate::math::Scalar;

/// How windows of known waters are walked beside what is sailed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rehearsal {
    /// Windows that are kept, at most.
    pub windows: usize,
    /// Samples of a window.
    pub samples: usize,
    /// One sample is rehearsed after so many that are sailed.
    pub every: usize,
    /// Variance of each number of the hidden state at the start of a window, which is that of the weights from shore.
    pub initial_state: f64,
    /// `R` of what is rehearsed, in that of what is measured.
    pub noise_factor: f64,
}

impl Rehearsal {
    /// Whether its numbers can be.
    pub(super) fn is_sound(&self) -> bool {
        let Self { windows, samples, every, initial_state, noise_factor } = *self;
        let finite = initial_state.is_finite() && noise_factor.is_finite();
        windows.min(samples).min(every) > 0 && finite && initial_state >= 0.0 && noise_factor > 0.0
    }
}

/// `x` and `z`.
type Sample<'a, T> = (&'a mut [T], &'a mut [T]);

/// Windows, and where in them the second of two [`Courses`] is.
#[derive(Clone, Debug)]
pub(super) struct Rehearser<T> {
    settings: Rehearsal,
    /// Of each window: hidden state at its start; `x` and `z` of each sample.
    states: Vec<T>,
    samples: Vec<T>,
    /// Numbers of `x`, and of both.
    inputs: usize,
    row: usize,
    kept: usize,
    /// The next sample of all windows' samples; samples sailed since the last.
    at: usize,
    sailed: usize,
}

impl<T: Scalar> Rehearser<T> {
    /// Without windows, for a model on one course.
    pub(super) fn new<M: Learnable<T>>(model: &M, settings: Rehearsal) -> Self {
        let row = model.inputs() + model.outputs();
        Self {
            states: vec![T::zero(); settings.windows * model.state_len()],
            samples: vec![T::zero(); settings.windows * settings.samples * row],
            inputs: model.inputs(),
            row,
            kept: 0,
            at: 0,
            sailed: 0,
            settings,
        }
    }

    pub(super) fn settings(&self) -> &Rehearsal {
        &self.settings
    }

    /// Room for one more window: its state at the start, and its samples, `x` and `z` of each.
    pub(super) fn room(&mut self) -> Option<(&mut [T], impl Iterator<Item = Sample<'_, T>>)> {
        let Self { settings: Rehearsal { windows, samples, .. }, kept, inputs, row, .. } = *self;
        if kept == windows {
            return None;
        }
        self.kept += 1;
        let n = self.states.len() / windows;
        let rows = self.samples[kept * samples * row..(kept + 1) * samples * row].chunks_exact_mut(row);
        Some((&mut self.states[kept * n..(kept + 1) * n], rows.map(move |row| row.split_at_mut(inputs))))
    }

    /// The next sample is the first of a window.
    pub(super) fn begin_again(&mut self) {
        self.at -= self.at % self.settings.samples;
        self.sailed = 0;
    }

    /// After a sample was sailed: walks the next one of a window if it is time to. Says whether the weights may have moved.
    ///
    /// It counts as one more sample for the weights: they leak, and gain their noise.
    pub(super) fn walk<M: Learnable<T>>(&mut self, filter: &mut Filter<T, Courses<M>>) -> bool {
        self.sailed += 1;
        if self.kept == 0 || !filter.learns() || self.sailed < self.settings.every {
            return false;
        }
        self.sailed = 0;
        let Rehearsal { windows, samples, initial_state, noise_factor, .. } = self.settings;
        let n = self.states.len() / windows;
        filter.model.turn(1);
        if self.at.is_multiple_of(samples) {
            let window = self.at / samples;
            filter.begin_part(&self.states[window * n..(window + 1) * n], T::of(initial_state));
        }
        let (x, z) = self.samples[self.at * self.row..(self.at + 1) * self.row].split_at(self.inputs);
        filter.advance(x);
        let outside = filter.replace_inflation(T::of(noise_factor));
        let lost = filter.observe(z) == Correction::Lost;
        filter.replace_inflation(outside);
        filter.model.turn(0);
        self.at = (self.at + 1) % (self.kept * samples);
        if lost {
            self.begin_again();
        }
        true
    }

    /// How many numbers [`save`](Self::save) gives.
    pub(super) fn memory_len(&self) -> usize {
        self.states.len() + self.samples.len() + 3
    }

    pub(super) fn save(&self, writer: &mut Writer<'_>) {
        for numbers in [&self.states, &self.samples] {
            let into = writer.part(numbers.len());
            into.iter_mut().zip(numbers).for_each(|(into, x)| *into = x.wide());
        }
        for count in [self.kept, self.at, self.sailed] {
            writer.count(count);
        }
    }

    pub(super) fn load(&mut self, reader: &mut Reader<'_>) {
        for numbers in [&mut self.states, &mut self.samples] {
            let from = reader.part(numbers.len());
            numbers.iter_mut().zip(from).for_each(|(into, &x)| *into = T::of(x));
        }
        self.kept = reader.count(self.settings.windows);
        self.at = reader.count((self.kept * self.settings.samples).saturating_sub(1));
        self.sailed = reader.count(self.settings.every);
    }
}
