//! The last samples of a run, over ground.

use alloc::vec;
use alloc::vec::Vec;

use crate::memory::Memory;

/// Outputs over ground, heading, and command of the last samples; predicted where nothing was measured.
#[derive(Clone, Debug)]
pub(super) struct Past {
    /// Up to twice as many rows as are kept, so that they move rarely.
    rows: Vec<f64>,
    outputs: usize,
    width: usize,
    /// Rows that are needed, and rows that are kept.
    least: usize,
    span: usize,
    /// Rows, the newest last.
    len: usize,
}

impl Past {
    /// Keeps `span` rows, of which at least `least` are needed.
    pub(super) fn new(outputs: usize, inputs: usize, [least, span]: [usize; 2]) -> Self {
        let width = outputs + 1 + inputs;
        Self { rows: vec![0.0; 2 * span * width], outputs, width, least, span, len: 0 }
    }

    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    pub(super) fn push(&mut self, y: &[f64], heading: f64) {
        if self.len == 2 * self.span {
            self.rows.copy_within((self.span + 1) * self.width.., 0);
            self.len = self.span - 1;
        }
        let row = &mut self.rows[self.len * self.width..][..self.width];
        row[..self.outputs].copy_from_slice(y);
        row[self.outputs] = heading;
        self.len += 1;
    }

    /// Sets the command of the newest sample.
    pub(super) fn set_command(&mut self, c: &[f64]) {
        if let Some(newest) = self.len.checked_sub(1) {
            self.rows[newest * self.width..][self.outputs + 1..self.width].copy_from_slice(c);
        }
    }

    /// Whether there are as many rows as are needed.
    pub(super) fn is_full(&self) -> bool {
        self.len >= self.least
    }

    /// Rows that are kept.
    pub(super) fn len(&self) -> usize {
        self.len.min(self.span)
    }

    /// Outputs, heading and command `back` samples before the newest.
    pub(super) fn row(&self, back: usize) -> (&[f64], f64, &[f64]) {
        let row = &self.rows[(self.len - 1 - back) * self.width..][..self.width];
        let (y, rest) = row.split_at(self.outputs);
        (y, rest[0], &rest[1..])
    }

    /// Visits the rows that are kept, after they were moved to the front.
    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        let rows = self.len();
        self.rows.copy_within((self.len - rows) * self.width..self.len * self.width, 0);
        self.rows[rows * self.width..self.span * self.width].fill(0.0);
        self.len = rows;
        memory.count(&mut self.len, self.span);
        memory.numbers(&mut self.rows[..self.span * self.width]);
    }
}
