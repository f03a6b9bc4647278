//! Snapshots of a model at the last windows.

use alloc::vec;
use alloc::vec::Vec;

use crate::adapt::memory::{Reader, Writer};
use crate::predict::Predictor;

/// The last snapshots, the oldest first. As many windows back as are kept, a window begins.
#[derive(Clone, Debug)]
pub(super) struct Earlier {
    numbers: Vec<f64>,
    /// Numbers of a snapshot.
    size: usize,
    /// Snapshots.
    count: usize,
    most: usize,
}

impl Earlier {
    pub(super) fn new(most: usize, size: usize) -> Self {
        Self { numbers: vec![0.0; most * size], size, count: 0, most }
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    pub(super) fn push(&mut self, snapshot: &[f64]) {
        if self.count == self.most {
            self.numbers.copy_within(self.size.., 0);
            self.count -= 1;
        }
        self.numbers[self.count * self.size..][..self.size].copy_from_slice(snapshot);
        self.count += 1;
    }

    /// The oldest snapshot; the present one of the model if there is none.
    pub(super) fn oldest<P: Predictor + ?Sized>(&self, into: &mut [f64], model: &P) {
        if self.count > 0 {
            into.copy_from_slice(&self.numbers[..self.size]);
        } else {
            model.snapshot(into);
        }
    }

    pub(super) fn memory_len(&self) -> usize {
        self.numbers.len() + 1
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.count(self.count);
        let (kept, rest) = into.part(self.numbers.len()).split_at_mut(self.count * self.size);
        kept.copy_from_slice(&self.numbers[..kept.len()]);
        rest.fill(0.0);
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        self.count = from.count(self.most);
        from.numbers(&mut self.numbers);
    }
}
