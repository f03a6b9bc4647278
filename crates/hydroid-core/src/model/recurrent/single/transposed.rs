//! Products of a step's transposed Jacobians with matrices.

use super::linearization::Linearization;
use super::packed::Packed;
use crate::math::rows::add_rows;

/// Results of a transposed product: matrices with columns, row by row, overwritten; `None` where not needed.
#[derive(Debug, Default)]
pub struct Gradient<'a> {
    /// `state x columns`.
    pub state: Option<&'a mut [f64]>,
    /// `inputs x columns`.
    pub input: Option<&'a mut [f64]>,
    /// `weights x columns`.
    pub weights: Option<&'a mut [f64]>,
}

impl Gradient<'_> {
    fn clear(&mut self) {
        for part in [&mut self.state, &mut self.input, &mut self.weights].into_iter().flatten() {
            part.fill(0.0);
        }
    }
}

impl Linearization {
    /// Transposed Jacobian times matrix (reverse mode, vjp, for several columns at a time): `(df/dstate)' w`,
    /// `(df/dx)' w` and `(df/dweights)' w` for `w` of `state x columns`.
    ///
    /// # Panics
    /// If a matrix has not its rows times `columns`, or `scratch` is shorter than [`scratch`](Self::scratch).
    pub fn transposed_times(
        &self,
        packed: &Packed,
        w: &[f64],
        columns: usize,
        mut into: Gradient<'_>,
        scratch: &mut [f64],
    ) {
        into.clear();
        let len = packed.layer_state() * columns;
        let shown = self.shown.len() * columns;
        // Adjoint of this layer's `h+` from the layer above.
        let (adjoint, scratch) = scratch.split_at_mut(shown);
        adjoint.fill(0.0);
        for layer in (0..self.layers.len()).rev() {
            let own = layer * len..(layer + 1) * len;
            for (adjoint, &w) in adjoint.iter_mut().zip(&w[own.end - shown..own.end]) {
                *adjoint += w;
            }
            let state = into.state.as_deref_mut().map(|state| &mut state[own.clone()]);
            let weights = into.weights.as_deref_mut();
            let into = Gradient { state, input: into.input.as_deref_mut(), weights };
            self.layer_transposed(packed, layer, (&w[own], adjoint), columns, into, scratch);
        }
    }

    /// One layer: from `w` of its state and `adjoint` of its `h+`, replaced by that of the layer before.
    fn layer_transposed(
        &self,
        packed: &Packed,
        index: usize,
        (w, adjoint): (&[f64], &mut [f64]),
        columns: usize,
        mut into: Gradient<'_>,
        scratch: &mut [f64],
    ) {
        let (layer, place) = (&self.layers[index], &packed.layout().layers[index]);
        let (weights, units) = (packed.weights(), layer.units());
        let (last, rows) = scratch.split_at_mut(units * columns);
        let (of_a, rest) = rows.split_at_mut(columns);
        let of_b = &mut rest[..columns];
        if let Some(projection) = &packed.layout().projection {
            last.fill(0.0);
            for (s, adjoint) in adjoint.chunks_exact(columns).enumerate() {
                let run = projection.start + s * units..projection.start + (s + 1) * units;
                add_outer(last, &weights[run.clone()], adjoint);
                if let Some(into) = into.weights.as_deref_mut() {
                    add_outer(&mut into[run.start * columns..run.end * columns], layer.projected(), adjoint);
                }
            }
        } else {
            last.copy_from_slice(adjoint);
        }
        adjoint.fill(0.0);
        for unit in 0..units {
            // The adjoint of the last result is `last`; that of an LSTM's `c+`, the first result, is `w`.
            for gate in 0..layer.gates() {
                of_a.fill(0.0);
                of_b.fill(0.0);
                for result in 0..layer.results() {
                    let from = if result + 1 == layer.results() { &*last } else { w };
                    let from = &from[unit * columns..(unit + 1) * columns];
                    add_rows(of_a, from, &[layer.input(result, gate)[unit]]);
                    add_rows(of_b, from, &[layer.hidden(result, gate)[unit]]);
                }
                let of = place.row(gate * units + unit);
                if let Some(state) = into.state.as_deref_mut() {
                    add_outer(&mut state[layer.h_at() * columns..], &weights[of.weight_hh.clone()], of_b);
                }
                if index > 0 {
                    add_outer(adjoint, &weights[of.weight_ih.clone()], of_a);
                } else if let Some(input) = into.input.as_deref_mut() {
                    add_outer(input, &weights[of.weight_ih.clone()], of_a);
                }
                if let Some(all) = into.weights.as_deref_mut() {
                    let mut at = |from: usize, x: &[f64], row: &[f64]| {
                        add_outer(&mut all[from * columns..(from + x.len()) * columns], x, row);
                    };
                    at(of.weight_ih.start, layer.x(), of_a);
                    at(of.weight_hh.start, layer.h(), of_b);
                    at(of.bias_ih, &[1.0], of_a);
                    at(of.bias_hh, &[1.0], of_b);
                }
            }
            if let Some(state) = into.state.as_deref_mut() {
                let carried = &mut state[unit * columns..(unit + 1) * columns];
                for result in 0..layer.results() {
                    let from = if result + 1 == layer.results() { &*last } else { w };
                    let from = &from[unit * columns..(unit + 1) * columns];
                    add_rows(carried, from, &[layer.carry(result)[unit]]);
                }
            }
        }
    }

    /// `(dg/dstate+)' w` and `(dg/dweights)' w` for `w` of `outputs x columns`; the part of the input is zero.
    ///
    /// # Panics
    /// If a matrix has not its rows times `columns`.
    pub fn output_transposed_times(
        &self,
        packed: &Packed,
        w: &[f64],
        columns: usize,
        mut into: Gradient<'_>,
    ) {
        into.clear();
        let shown = self.shown.len();
        let at = (packed.network().state_len() - shown) * columns;
        let Some((weight, bias)) = &packed.layout().read_out else {
            if let Some(state) = into.state {
                state[at..].copy_from_slice(w);
            }
            return;
        };
        for (i, row) in w.chunks_exact(columns).enumerate() {
            let run = weight.start + i * shown..weight.start + (i + 1) * shown;
            if let Some(state) = into.state.as_deref_mut() {
                add_outer(&mut state[at..], &packed.weights()[run.clone()], row);
            }
            if let Some(all) = into.weights.as_deref_mut() {
                add_outer(&mut all[run.start * columns..run.end * columns], &self.shown, row);
                add_outer(&mut all[(bias.start + i) * columns..][..columns], &[1.0], row);
            }
        }
    }
}

/// `matrix += x row'`.
fn add_outer(matrix: &mut [f64], x: &[f64], row: &[f64]) {
    for (into, &x) in matrix.chunks_exact_mut(row.len()).zip(x) {
        for (into, &r) in into.iter_mut().zip(row) {
            *into += x * r;
        }
    }
}
