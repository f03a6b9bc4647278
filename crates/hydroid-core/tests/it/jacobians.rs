//! Dense Jacobians of a step.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::{Gradient, Linearization, Packed};

/// A `rows x columns` matrix, whose row `i` is `row` of unit vector `i`.
fn expand<T: Scalar>(rows: usize, columns: usize, mut row: impl FnMut(&[T], &mut [T])) -> Vec<T> {
    let (mut matrix, mut unit) = (vec![T::zero(); rows * columns], vec![T::zero(); rows]);
    for (i, into) in matrix.chunks_exact_mut(columns).enumerate() {
        unit.fill(T::zero());
        unit[i] = T::one();
        row(&unit, into);
    }
    matrix
}

/// Dense Jacobians, row by row.
pub(crate) trait Dense<T> {
    /// `df/dstate`, `state x state`, row by row.
    fn dense_state(&self, packed: &Packed<T>) -> Vec<T>;
    /// `df/dx`, `state x inputs`, row by row.
    fn dense_input(&self, packed: &Packed<T>) -> Vec<T>;
    /// `df/dweights`, `state x weights`, row by row.
    fn dense_weights(&self, packed: &Packed<T>) -> Vec<T>;
    /// `dg/dstate+`, `outputs x state`, row by row.
    fn dense_output_state(&self, packed: &Packed<T>) -> Vec<T>;
    /// `dg/dweights`, `outputs x weights`, row by row.
    fn dense_output_weights(&self, packed: &Packed<T>) -> Vec<T>;
}

impl<T: Scalar> Dense<T> for Linearization<T> {
    fn dense_state(&self, packed: &Packed<T>) -> Vec<T> {
        let (n, mut scratch) = (packed.network().state_len(), vec![T::zero(); self.scratch(1)]);
        expand(n, n, |w, row| {
            let into = Gradient { state: Some(row), ..Gradient::default() };
            self.transposed_times(packed, w, 1, into, &mut scratch);
        })
    }

    fn dense_input(&self, packed: &Packed<T>) -> Vec<T> {
        let (n, mut scratch) = (packed.network().state_len(), vec![T::zero(); self.scratch(1)]);
        expand(n, packed.network().inputs, |w, row| {
            let into = Gradient { input: Some(row), ..Gradient::default() };
            self.transposed_times(packed, w, 1, into, &mut scratch);
        })
    }

    fn dense_weights(&self, packed: &Packed<T>) -> Vec<T> {
        let (n, mut scratch) = (packed.network().state_len(), vec![T::zero(); self.scratch(1)]);
        expand(n, packed.weights().len(), |w, row| {
            let into = Gradient { weights: Some(row), ..Gradient::default() };
            self.transposed_times(packed, w, 1, into, &mut scratch);
        })
    }

    fn dense_output_state(&self, packed: &Packed<T>) -> Vec<T> {
        expand(packed.network().outputs, packed.network().state_len(), |w, row| {
            let into = Gradient { state: Some(row), ..Gradient::default() };
            self.output_transposed_times(packed, w, 1, into);
        })
    }

    fn dense_output_weights(&self, packed: &Packed<T>) -> Vec<T> {
        expand(packed.network().outputs, packed.weights().len(), |w, row| {
            let into = Gradient { weights: Some(row), ..Gradient::default() };
            self.output_transposed_times(packed, w, 1, into);
        })
    }
}
