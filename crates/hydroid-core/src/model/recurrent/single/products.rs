//! Products of a step's Jacobians with matrices.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use pulp::{Arch, Simd, WithSimd};

use super::linearization::Linearization;
use super::packed::Packed;
use super::sums::Sums;
use crate::math::rows::add_rows;

/// Changes of the arguments of a step, as matrices with columns, row by row; `None` for no change.
#[derive(Clone, Copy, Debug, Default)]
pub struct Change<'a> {
    /// `state x columns`.
    pub state: Option<&'a [f64]>,
    /// `inputs x columns`.
    pub input: Option<&'a [f64]>,
    /// `weights x columns`.
    pub weights: Option<&'a [f64]>,
    /// Effect of the weights on each row of [`Blocks`](super::Blocks), if computed beforehand: `rows x columns`.
    pub local: Option<&'a [f64]>,
}

pub(crate) struct Times<'a> {
    linear: &'a Linearization,
    packed: &'a Packed,
    change: Change<'a>,
    columns: usize,
    out: &'a mut [f64],
    scratch: &'a mut [f64],
}

impl WithSimd for Times<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.linear.times_here(simd, self.packed, self.change, self.columns, self.out, self.scratch);
    }
}

pub(crate) struct OutputTimes<'a> {
    linear: &'a Linearization,
    packed: &'a Packed,
    change: Change<'a>,
    columns: usize,
    out: &'a mut [f64],
}

impl WithSimd for OutputTimes<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.linear.output_times_here(simd, self.packed, self.change, self.columns, self.out);
    }
}

impl Linearization {
    /// Length of the scratch of products with matrices of `columns` columns.
    pub fn scratch(&self, columns: usize) -> usize {
        let units = self.layers[0].units();
        let widest = self.layers.iter().map(|layer| layer.x().len().max(layer.h().len())).max();
        // The projection's part of a product, and a sum's coefficients; or two rows and the adjoint of the layer above.
        units * columns + (2 * columns).max(widest.unwrap_or(0).max(units)) + self.shown.len() * columns
    }

    /// Jacobian times matrix (forward mode, jvp, for several columns at a time):
    /// `out = df/dstate change.state + df/dx change.input + df/dweights change.weights` (`state x columns`).
    ///
    /// # Panics
    /// If a matrix has not its rows times `columns`, or `scratch` is shorter than [`scratch`](Self::scratch).
    #[inline(never)]
    pub fn times(
        &self,
        packed: &Packed,
        change: Change<'_>,
        columns: usize,
        out: &mut [f64],
        scratch: &mut [f64],
    ) {
        Arch::new().dispatch(Times { linear: self, packed, change, columns, out, scratch });
    }

    #[inline(always)]
    fn times_here<S: Simd>(
        &self,
        simd: S,
        packed: &Packed,
        change: Change<'_>,
        columns: usize,
        out: &mut [f64],
        scratch: &mut [f64],
    ) {
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
            self.layer_times(simd, (packed, layer), change, columns, &mut out[..len * columns], scratch);
        }
    }

    #[inline(always)]
    fn layer_times<S: Simd>(
        &self,
        simd: S,
        (packed, index): (&Packed, usize),
        change: Change<'_>,
        columns: usize,
        out: &mut [f64],
        scratch: &mut [f64],
    ) {
        let layer = &self.layers[index];
        let (units, results) = (layer.units(), layer.results());
        let block = units * columns;
        let (projected, coefficients) = scratch.split_at_mut(block);
        let local = change.local.unwrap_or(&[]);
        let (state, input) = (change.state.unwrap_or(&[]), change.input.unwrap_or(&[]));
        let h = if state.is_empty() { state } else { &state[layer.h_at() * columns..] };
        let sums = |result: usize| Sums {
            columns,
            begin: (local, index * units * results + result, results),
            own: (&[], &[]),
            parts: [(layer.of_h(result), h), (layer.of_x(result), input)],
        };
        let (first, rest) = out.split_at_mut(block);
        Sums { own: (layer.carry(0), state), ..sums(0) }.of(simd, first);
        self.add_weights(packed, (index, 0), change.weights, columns, first, coefficients);
        if results == 1 {
            return;
        }
        let place = packed.layout().projection.as_ref();
        let last = if place.is_some() { &mut *projected } else { &mut *rest };
        Sums { own: (layer.through(), first), ..sums(1) }.of(simd, last);
        self.add_weights(packed, (index, 1), change.weights, columns, last, coefficients);
        let Some(place) = place else { return };
        let by = &packed.weights()[place.clone()];
        let begin = (local, units * results, results);
        Sums { columns, begin, own: (&[], &[]), parts: [(by, projected), (&[], &[])] }.of(simd, rest);
        if let Some(all) = change.weights {
            let changes = all[place.start * columns..place.end * columns].chunks_exact(block);
            for (row, changes) in rest.chunks_exact_mut(columns).zip(changes) {
                add_rows(row, changes, layer.projected());
            }
        }
    }

    #[inline(always)]
    fn add_weights(
        &self,
        packed: &Packed,
        (index, result): (usize, usize),
        changes: Option<&[f64]>,
        columns: usize,
        out: &mut [f64],
        coefficients: &mut [f64],
    ) {
        let Some(changes) = changes else { return };
        let (layer, place) = (&self.layers[index], &packed.layout().layers[index]);
        let (x, h) = (layer.x(), layer.h());
        let rows = |from: usize, len: usize| &changes[from * columns..(from + len) * columns];
        for (unit, row) in out.chunks_exact_mut(columns).enumerate() {
            for gate in layer.own_gates(result) {
                let (a, b) = (layer.input(result, gate)[unit], layer.hidden(result, gate)[unit]);
                let of = place.row(gate * layer.units() + unit);
                add_rows(row, rows(of.weight_ih.start, x.len()), scaled(x, a, coefficients));
                add_rows(row, rows(of.weight_hh.start, h.len()), scaled(h, b, coefficients));
                add_rows(row, rows(of.bias_ih, 1), &[a]);
                add_rows(row, rows(of.bias_hh, 1), &[b]);
            }
        }
    }

    /// `out = dg/dstate+ change.state + dg/dweights change.weights` (`outputs x columns`), without a part of the input.
    ///
    /// # Panics
    /// If a matrix has not its rows times `columns`.
    #[inline(never)]
    pub fn output_times(&self, packed: &Packed, change: Change<'_>, columns: usize, out: &mut [f64]) {
        Arch::new().dispatch(OutputTimes { linear: self, packed, change, columns, out });
    }

    #[inline(always)]
    fn output_times_here<S: Simd>(
        &self,
        simd: S,
        packed: &Packed,
        change: Change<'_>,
        columns: usize,
        out: &mut [f64],
    ) {
        let shown = self.shown.len();
        let state = change.state.map(|state| &state[(packed.network().state_len() - shown) * columns..]);
        let Some((weight, bias)) = &packed.layout().read_out else {
            match state {
                Some(state) => out.copy_from_slice(state),
                None => out.fill(0.0),
            }
            return;
        };
        let results = self.layers[0].results();
        let begin = (change.local.unwrap_or(&[]), self.first_output_block() * results, results);
        let part = (&packed.weights()[weight.clone()], state.unwrap_or(&[]));
        Sums { columns, begin, own: (&[], &[]), parts: [part, (&[], &[])] }.of(simd, out);
        let Some(changes) = change.weights else { return };
        for (i, row) in out.chunks_exact_mut(columns).enumerate() {
            let run = weight.start + i * shown..weight.start + (i + 1) * shown;
            add_rows(row, &changes[run.start * columns..run.end * columns], &self.shown);
            add_rows(row, &changes[(bias.start + i) * columns..][..columns], &[1.0]);
        }
    }
}

#[inline(always)]
fn scaled<'a>(x: &[f64], factor: f64, scratch: &'a mut [f64]) -> &'a [f64] {
    for (scaled, &x) in scratch.iter_mut().zip(x) {
        *scaled = x * factor;
    }
    &scratch[..x.len()]
}
