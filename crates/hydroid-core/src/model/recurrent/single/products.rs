//! Products of a step's Jacobians with matrices.
#![expect(
    clippy::inline_always,
    reason = "what a product is made of must become a part of the function that was compiled for the processor"
)]

use pulp::{Arch, Simd, WithSimd};

use super::super::layout::Layout;
use super::linearization::Linearization;
use super::packed::Packed;
use crate::math::Scalar;
use crate::math::rows::add_rows;

/// Changes of what a step depends on, as matrices of one or more columns, row by row. What is `None` does not change.
#[derive(Clone, Copy, Debug)]
pub struct Change<'a, T> {
    /// `state x columns`.
    pub state: Option<&'a [T]>,
    /// `inputs x columns`.
    pub input: Option<&'a [T]>,
    /// `weights x columns`.
    pub weights: Option<&'a [T]>,
    /// What the weights do to each row of [`Blocks`](super::Blocks), where that is known already: `rows x columns`.
    pub local: Option<&'a [T]>,
}

impl<T> Default for Change<'_, T> {
    fn default() -> Self {
        Self { state: None, input: None, weights: None, local: None }
    }
}

/// A product as what [`Arch`] compiles for the processor.
struct Times<'a, T> {
    linear: &'a Linearization<T>,
    packed: &'a Packed<T>,
    change: Change<'a, T>,
    columns: usize,
    out: &'a mut [T],
    scratch: &'a mut [T],
}

impl<T: Scalar> WithSimd for Times<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.linear.times_here(self.packed, self.change, self.columns, self.out, self.scratch);
    }
}

impl<T: Scalar> Linearization<T> {
    /// Numbers of scratch that products with matrices of so many columns need.
    pub fn scratch(&self, columns: usize) -> usize {
        let units = self.layers[0].units();
        let widest = self.layers.iter().map(|layer| layer.x().len().max(layer.h().len())).max();
        // The projection's part of a product, and a sum's coefficients; or two rows and what the layers above want.
        units * columns + (2 * columns).max(widest.unwrap_or(0).max(units)) + self.shown.len() * columns
    }

    /// Jacobian times matrix (forward mode, `jvp` of other programs, for several columns at a time):
    /// `out = df/dstate change.state + df/dx change.input + df/dweights change.weights` (`state x columns`).
    ///
    /// # Panics
    /// If a matrix has not its rows times `columns`, or `scratch` is shorter than [`scratch`](Self::scratch).
    pub fn times(
        &self,
        packed: &Packed<T>,
        change: Change<'_, T>,
        columns: usize,
        out: &mut [T],
        scratch: &mut [T],
    ) {
        Arch::new().dispatch(Times { linear: self, packed, change, columns, out, scratch });
    }

    #[inline(always)]
    fn times_here(
        &self,
        packed: &Packed<T>,
        change: Change<'_, T>,
        columns: usize,
        out: &mut [T],
        scratch: &mut [T],
    ) {
        out.fill(T::zero());
        let len = packed.layer_state();
        let own_state = |layer: usize| layer * len * columns..(layer + 1) * len * columns;
        for layer in 0..self.layers.len() {
            let (below, out) = out.split_at_mut(layer * len * columns);
            let change = Change {
                state: change.state.map(|state| &state[own_state(layer)]),
                input: if layer == 0 { change.input } else { Some(&below[own_state(layer - 1)]) },
                weights: change.weights,
                local: change.local,
            };
            self.layer_times(packed, layer, change, columns, &mut out[..len * columns], scratch);
        }
    }

    #[inline(always)]
    fn layer_times(
        &self,
        packed: &Packed<T>,
        index: usize,
        change: Change<'_, T>,
        columns: usize,
        out: &mut [T],
        scratch: &mut [T],
    ) {
        let layer = &self.layers[index];
        let units = layer.units();
        let Layout { projection, .. } = packed.layout();
        let (projected, coefficients) = scratch.split_at_mut(units * columns);
        projected.fill(T::zero());
        // Results side by side: they read the same rows of the weights' change.
        for unit in 0..units {
            for result in 0..layer.results() {
                // The last result is what the projection reads, where there is one.
                let row = if projection.is_some() && result + 1 == layer.results() {
                    &mut projected[unit * columns..(unit + 1) * columns]
                } else {
                    &mut out[(result * units + unit) * columns..][..columns]
                };
                self.unit_times(packed, (index, result, unit), change, row, coefficients);
                if let Some(local) = change.local {
                    let at = (index * units + unit) * layer.results() + result;
                    add_rows(row, &local[at * columns..(at + 1) * columns], &[T::one()]);
                }
            }
        }
        if let Some(place) = projection {
            let weights = &packed.weights()[place.clone()];
            let changes = change.weights.map(|all| &all[place.start * columns..place.end * columns]);
            for (s, row) in out[units * columns..].chunks_exact_mut(columns).enumerate() {
                add_rows(row, projected, &weights[s * units..(s + 1) * units]);
                if let Some(changes) = changes {
                    let changes = &changes[s * units * columns..(s + 1) * units * columns];
                    add_rows(row, changes, layer.projected());
                }
                if let Some(local) = change.local {
                    let at = (units + s) * layer.results();
                    add_rows(row, &local[at * columns..(at + 1) * columns], &[T::one()]);
                }
            }
        }
    }

    /// `row +=` the change of one result of one unit.
    #[inline(always)]
    fn unit_times(
        &self,
        packed: &Packed<T>,
        (index, result, unit): (usize, usize, usize),
        change: Change<'_, T>,
        row: &mut [T],
        coefficients: &mut [T],
    ) {
        let (layer, place) = (&self.layers[index], &packed.layout().layers[index]);
        let (columns, units) = (row.len(), layer.units());
        let (x, h) = (layer.x(), layer.h());
        if let Some(state) = change.state {
            add_rows(row, &state[unit * columns..(unit + 1) * columns], &[layer.carry(result)[unit]]);
            add_rows(row, &state[layer.h_at() * columns..], layer.of_h(result, unit));
        }
        if let Some(input) = change.input {
            add_rows(row, input, layer.of_x(result, unit));
        }
        let Some(changes) = change.weights else { return };
        for gate in 0..layer.gates() {
            let (a, b) = (layer.input(result, gate)[unit], layer.hidden(result, gate)[unit]);
            let of = place.row(gate * units + unit);
            let rows = |from: usize, len: usize| &changes[from * columns..(from + len) * columns];
            add_rows(row, rows(of.weight_ih.start, x.len()), scaled(x, a, coefficients));
            add_rows(row, rows(of.weight_hh.start, h.len()), scaled(h, b, coefficients));
            add_rows(row, rows(of.bias_ih, 1), &[a]);
            add_rows(row, rows(of.bias_hh, 1), &[b]);
        }
    }

    /// `out = dg/dstate+ change.state + dg/dweights change.weights` (`outputs x columns`); the output does not depend
    /// on the input but through the state.
    ///
    /// # Panics
    /// If a matrix has not its rows times `columns`.
    pub fn output_times(&self, packed: &Packed<T>, change: Change<'_, T>, columns: usize, out: &mut [T]) {
        out.fill(T::zero());
        let shown = self.shown.len();
        let state = change.state.map(|state| &state[(packed.network().state_len() - shown) * columns..]);
        let Some((weight, bias)) = &packed.layout().read_out else {
            if let Some(state) = state {
                out.copy_from_slice(state);
            }
            return;
        };
        for (i, row) in out.chunks_exact_mut(columns).enumerate() {
            let run = weight.start + i * shown..weight.start + (i + 1) * shown;
            if let Some(state) = state {
                add_rows(row, state, &packed.weights()[run.clone()]);
            }
            if let Some(changes) = change.weights {
                add_rows(row, &changes[run.start * columns..run.end * columns], &self.shown);
                add_rows(row, &changes[(bias.start + i) * columns..][..columns], &[T::one()]);
            }
            if let Some(local) = change.local {
                let at = (self.first_output_block() + i) * self.layers[0].results();
                add_rows(row, &local[at * columns..(at + 1) * columns], &[T::one()]);
            }
        }
    }
}

/// `x factor` in scratch.
#[inline(always)]
fn scaled<'a, T: Scalar>(x: &[T], factor: T, scratch: &'a mut [T]) -> &'a [T] {
    for (scaled, &x) in scratch.iter_mut().zip(x) {
        *scaled = x * factor;
    }
    &scratch[..x.len()]
}
