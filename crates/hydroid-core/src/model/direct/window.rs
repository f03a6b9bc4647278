//! The input of a direct predictor, in one row, shifted from sample to sample.

use super::model::Direct;

/// Sizes of a window: `[z_{k-p+1} .. z_k m_{k-p+1} .. m_{k+H-1}]`, in any units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    pub(crate) n: usize,
    pub(crate) m: usize,
    pub(crate) p: usize,
    pub(crate) h: usize,
}

impl Window {
    pub(crate) fn of(model: &Direct) -> Self {
        Self { n: model.outputs(), m: model.inputs(), p: model.history, h: model.horizon }
    }

    pub(crate) fn outputs(&self) -> usize {
        self.p * self.n
    }

    pub(crate) fn past(&self) -> usize {
        self.outputs() + (self.p - 1) * self.m
    }

    pub(super) fn scale_past(&self, model: &Direct, past: &[f64], window: &mut [f64]) {
        let (outputs, commands) = past.split_at(self.outputs());
        for (k, (x, &y)) in window.iter_mut().zip(outputs).enumerate() {
            *x = model.scaled_output(k % self.n, y);
        }
        for (k, (x, &c)) in window[self.outputs()..].iter_mut().zip(commands).enumerate() {
            *x = model.scaled_command(k % self.m, c);
        }
    }

    /// Writes commands from the present one on into a window; the last one is held.
    pub(crate) fn set_commands<T: Copy>(&self, window: &mut [T], given: impl Iterator<Item = T>) {
        let ahead = &mut window[self.past()..];
        let mut count = 0;
        for (slot, value) in ahead.iter_mut().zip(given) {
            *slot = value;
            count += 1;
        }
        let last = count.max(self.m) - self.m;
        for at in count..ahead.len() {
            ahead[at] = ahead[last + (at - count) % self.m.max(1)];
        }
    }

    /// Shifts a window by a horizon: predicted outputs and passed commands become the past.
    pub(crate) fn shift<T: Copy>(&self, window: &mut [T], predicted: &[T]) {
        let (outputs, commands) = window.split_at_mut(self.outputs());
        push(outputs, &predicted[..self.h * self.n]);
        commands.copy_within(self.h * self.m.., 0);
    }
}

/// Shifts a row and appends numbers; of a longer slice only the end is kept.
pub(crate) fn push<T: Copy>(row: &mut [T], others: &[T]) {
    let (len, new) = (row.len(), others.len());
    if new >= len {
        row.copy_from_slice(&others[new - len..]);
    } else {
        row.copy_within(new.., 0);
        row[len - new..].copy_from_slice(others);
    }
}
