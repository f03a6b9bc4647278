//! Dense Jacobians of a step.

use hydroid_core::model::recurrent::{Gradient, Linearization, Packed};

/// A `rows x columns` matrix, whose row `i` is `row` of unit vector `i`.
fn expand(rows: usize, columns: usize, mut row: impl FnMut(&[f64], &mut [f64])) -> Vec<f64> {
    let (mut matrix, mut unit) = (vec![0.0; rows * columns], vec![0.0; rows]);
    for (i, into) in matrix.chunks_exact_mut(columns).enumerate() {
        unit.fill(0.0);
        unit[i] = 1.0;
        row(&unit, into);
    }
    matrix
}

/// Dense Jacobians, row by row.
pub(crate) trait Dense {
    /// `df/dstate`, `state x state`, row by row.
    fn dense_state(&self, packed: &Packed) -> Vec<f64>;
    /// `df/dx`, `state x inputs`, row by row.
    fn dense_input(&self, packed: &Packed) -> Vec<f64>;
    /// `df/dweights`, `state x weights`, row by row.
    fn dense_weights(&self, packed: &Packed) -> Vec<f64>;
    /// `dg/dstate+`, `outputs x state`, row by row.
    fn dense_output_state(&self, packed: &Packed) -> Vec<f64>;
    /// `dg/dweights`, `outputs x weights`, row by row.
    fn dense_output_weights(&self, packed: &Packed) -> Vec<f64>;
}

impl Dense for Linearization {
    fn dense_state(&self, packed: &Packed) -> Vec<f64> {
        let (n, mut scratch) = (packed.network().state_len(), vec![0.0; self.scratch(1)]);
        expand(n, n, |w, row| {
            let into = Gradient { state: Some(row), ..Gradient::default() };
            self.transposed_times(packed, w, 1, into, &mut scratch);
        })
    }

    fn dense_input(&self, packed: &Packed) -> Vec<f64> {
        let (n, mut scratch) = (packed.network().state_len(), vec![0.0; self.scratch(1)]);
        expand(n, packed.network().inputs, |w, row| {
            let into = Gradient { input: Some(row), ..Gradient::default() };
            self.transposed_times(packed, w, 1, into, &mut scratch);
        })
    }

    fn dense_weights(&self, packed: &Packed) -> Vec<f64> {
        let (n, mut scratch) = (packed.network().state_len(), vec![0.0; self.scratch(1)]);
        expand(n, packed.weights().len(), |w, row| {
            let into = Gradient { weights: Some(row), ..Gradient::default() };
            self.transposed_times(packed, w, 1, into, &mut scratch);
        })
    }

    fn dense_output_state(&self, packed: &Packed) -> Vec<f64> {
        expand(packed.network().outputs, packed.network().state_len(), |w, row| {
            let into = Gradient { state: Some(row), ..Gradient::default() };
            self.output_transposed_times(packed, w, 1, into);
        })
    }

    fn dense_output_weights(&self, packed: &Packed) -> Vec<f64> {
        expand(packed.network().outputs, packed.weights().len(), |w, row| {
            let into = Gradient { weights: Some(row), ..Gradient::default() };
            self.output_transposed_times(packed, w, 1, into);
        })
    }
}
