//! The last samples of a run, over ground.

use alloc::vec;
use alloc::vec::Vec;

/// Outputs over ground, heading, and command of the last samples.
#[derive(Clone, Debug)]
pub(super) struct Past {
    /// Up to twice as many rows as are needed, so that they move rarely.
    rows: Vec<f64>,
    outputs: usize,
    width: usize,
    /// Rows that are needed.
    span: usize,
    /// Rows, the newest last.
    len: usize,
    /// Complete consecutive rows up to the newest, at most `span`.
    complete: usize,
}

impl Past {
    pub(super) fn new(outputs: usize, inputs: usize, span: usize) -> Self {
        let width = outputs + 1 + inputs;
        Self { rows: vec![0.0; 2 * span * width], outputs, width, span, len: 0, complete: 0 }
    }

    pub(super) fn clear(&mut self) {
        self.len = 0;
        self.complete = 0;
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
        let complete = heading.is_finite() && y.iter().all(|y| y.is_finite());
        self.complete = if complete { (self.complete + 1).min(self.span) } else { 0 };
    }

    /// Sets the command of the newest sample.
    pub(super) fn set_command(&mut self, c: &[f64]) {
        if let Some(newest) = self.len.checked_sub(1) {
            self.rows[newest * self.width..][self.outputs + 1..self.width].copy_from_slice(c);
        }
    }

    /// Whether all rows that are needed are complete.
    pub(super) fn is_complete(&self) -> bool {
        self.complete == self.span
    }

    /// Outputs, heading and command `back` samples before the newest.
    pub(super) fn row(&self, back: usize) -> (&[f64], f64, &[f64]) {
        let row = &self.rows[(self.len - 1 - back) * self.width..][..self.width];
        let (y, rest) = row.split_at(self.outputs);
        (y, rest[0], &rest[1..])
    }
}
