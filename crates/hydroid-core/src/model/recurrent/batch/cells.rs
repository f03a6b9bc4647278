//! One step of all lanes, forward and backward, as affine maps and the element-wise functions of the cells.

#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use alloc::vec::Vec;
use core::iter;

use pulp::{Arch, Simd, WithSimd};

use super::affine::{Affine, Place};
use crate::math::Scalar;
use crate::math::kernel::kernels;
use crate::model::recurrent::network::{Cell, Network, Tensor};
use crate::model::recurrent::{gru, lstm, vanilla};

kernels! {
    ForwardKernel: Forwards;
    BackwardKernel: Backs;
}

#[derive(Clone, Debug)]
enum Maps<T> {
    /// `[i f g o]` from `x` and `h`; `h` from `m`.
    Lstm { hidden: usize, gates: Affine<T>, projection: Option<Affine<T>> },
    /// `[r z]` from `x` and `h`, `a_n` from `x`, `b_n` from `h`.
    Gru { hidden: usize, gates: Affine<T>, candidate: Affine<T>, recalled: Affine<T> },
    /// One map for each layer.
    Vanilla { hidden: usize, layers: Vec<Affine<T>> },
}

/// Arguments of a step; all are `features x lanes`.
pub(super) struct Forward<'a, T> {
    pub(super) state: &'a [T],
    pub(super) input: &'a [T],
    pub(super) record: &'a mut [T],
    pub(super) next: &'a mut [T],
    /// Empty without read-out.
    pub(super) output: &'a mut [T],
}

/// Arguments of a backward step; all are `features x lanes`.
pub(super) struct Back<'a, T> {
    pub(super) state: &'a [T],
    pub(super) input: &'a [T],
    /// Overwritten.
    pub(super) record: &'a mut [T],
    pub(super) next: &'a [T],
    pub(super) output_adjoint: &'a [T],
    /// Adjoint of the state after the step on entry, before it on return.
    pub(super) state_adjoint: &'a mut [T],
    pub(super) input_adjoint: &'a mut [T],
    pub(super) scratch: &'a mut [T],
}

#[derive(Clone, Debug)]
pub(super) struct Cells<T> {
    maps: Maps<T>,
    read_out: Option<Affine<T>>,
    lanes: usize,
    pub(super) arch: Arch,
}

/// Offsets of a map from its tensors: `rows` rows from row `first` on.
fn place(
    a: Option<&Tensor>,
    b: Option<&Tensor>,
    bias: [Option<&Tensor>; 2],
    first: usize,
    rows: usize,
) -> Place {
    let matrix = |t: Option<&Tensor>| t.map_or((0, 0), |t| (t.offset + first * t.columns, t.columns));
    Place { rows, a: matrix(a), b: matrix(b), bias: bias.map(|t| t.map(|t| t.offset + first)) }
}

impl<T: Scalar> Cells<T> {
    pub(super) fn new(network: &Network, lanes: usize) -> Self {
        let tensors = network.tensors();
        let (mut layers, mut rest) = (Vec::new(), &tensors[..]);
        while let [ih, hh, bias_ih, bias_hh, others @ ..] = rest
            && layers.len() < network.cell.layers()
        {
            layers.push([ih, hh, bias_ih, bias_hh]);
            rest = others;
        }
        let whole = |[ih, hh, bias_ih, bias_hh]: [&Tensor; 4], first, rows| {
            Affine::new(place(Some(ih), Some(hh), [Some(bias_ih), Some(bias_hh)], first, rows))
        };
        let maps = match network.cell {
            Cell::Lstm { hidden, projection } => Maps::Lstm {
                hidden,
                gates: whole(layers[0], 0, 4 * hidden),
                projection: projection
                    .map(|rows| Affine::new(place(Some(&rest[0]), None, [None; 2], 0, rows))),
            },
            Cell::Gru { hidden } => {
                let [ih, hh, bias_ih, bias_hh] = layers[0];
                let half =
                    |w, bias| Affine::new(place(Some(w), None, [Some(bias), None], 2 * hidden, hidden));
                Maps::Gru {
                    hidden,
                    gates: whole(layers[0], 0, 2 * hidden),
                    candidate: half(ih, bias_ih),
                    recalled: half(hh, bias_hh),
                }
            }
            Cell::Vanilla { hidden, .. } => Maps::Vanilla {
                hidden,
                layers: layers.into_iter().map(|layer| whole(layer, 0, hidden)).collect(),
            },
        };
        let read_out = network.read_out.then(|| {
            let [.., weight, bias] = &tensors[..] else { unreachable!("a read-out has two tensors") };
            Affine::new(place(Some(weight), None, [Some(bias), None], 0, weight.rows))
        });
        Self { maps, read_out, lanes, arch: Arch::new() }
    }

    fn each(&mut self, mut f: impl FnMut(&mut Affine<T>)) {
        match &mut self.maps {
            Maps::Lstm { gates, projection, .. } => {
                f(gates);
                projection.iter_mut().for_each(&mut f);
            }
            Maps::Gru { gates, candidate, recalled, .. } => {
                [gates, candidate, recalled].into_iter().for_each(&mut f);
            }
            Maps::Vanilla { layers, .. } => layers.iter_mut().for_each(&mut f),
        }
        self.read_out.iter_mut().for_each(f);
    }

    pub(super) fn set_lanes(&mut self, lanes: usize) {
        self.lanes = lanes;
    }

    pub(super) fn record_rows(&self) -> usize {
        match self.maps {
            Maps::Lstm { hidden, .. } => 6 * hidden,
            Maps::Gru { hidden, .. } => 4 * hidden,
            Maps::Vanilla { .. } => 0,
        }
    }

    pub(super) fn scratch_rows(&self) -> usize {
        match self.maps {
            Maps::Lstm { hidden, .. } | Maps::Gru { hidden, .. } | Maps::Vanilla { hidden, .. } => hidden,
        }
    }

    pub(super) fn load(&mut self, weights: &[T]) {
        self.each(|map| map.load(weights));
    }

    pub(super) fn clear(&mut self) {
        self.each(Affine::clear);
    }

    pub(super) fn gradient(&self, into: &mut [T]) {
        let write = |map: &Affine<T>| map.gradient(into);
        match &self.maps {
            Maps::Lstm { gates, projection, .. } => {
                iter::once(gates).chain(projection).chain(&self.read_out).for_each(write);
            }
            Maps::Gru { gates, candidate, recalled, .. } => {
                [gates, candidate, recalled].into_iter().chain(&self.read_out).for_each(write);
            }
            Maps::Vanilla { layers, .. } => layers.iter().chain(&self.read_out).for_each(write),
        }
    }

    pub(super) fn forward(&self, step: Forward<'_, T>) {
        T::run::<ForwardKernel>(self.arch, Forwards(self, step));
    }

    pub(super) fn back(&mut self, step: Back<'_, T>) {
        T::run::<BackwardKernel>(self.arch, Backs(self, step));
    }

    #[inline(always)]
    fn forward_with<S: Simd>(&self, simd: S, step: Forward<'_, T>) {
        let lanes = self.lanes;
        let Forward { state, input, record, next, output } = step;
        let shown = match &self.maps {
            Maps::Lstm { hidden, gates, projection } => {
                let n = hidden * lanes;
                let ((c, h), (c_next, h_next)) = (state.split_at(n), next.split_at_mut(n));
                let (record, m) = record.split_at_mut(5 * n);
                gates.apply(simd, input, h, &mut record[..4 * n], lanes);
                match projection {
                    Some(projection) => {
                        lstm::forward(simd, record, c, c_next, m);
                        projection.apply(simd, m, &[], h_next, lanes);
                    }
                    None => lstm::forward(simd, record, c, c_next, h_next),
                }
                &*h_next
            }
            Maps::Gru { hidden, gates, candidate, recalled } => {
                let n = hidden * lanes;
                gates.apply(simd, input, state, &mut record[..2 * n], lanes);
                candidate.apply(simd, input, &[], &mut record[2 * n..3 * n], lanes);
                recalled.apply(simd, state, &[], &mut record[3 * n..], lanes);
                gru::forward(simd, record, state, next);
                &*next
            }
            Maps::Vanilla { hidden, layers } => {
                let n = hidden * lanes;
                for (l, layer) in layers.iter().enumerate() {
                    let (below, here) = next.split_at_mut(l * n);
                    let x = if l == 0 { input } else { &below[(l - 1) * n..] };
                    layer.apply(simd, x, &state[l * n..(l + 1) * n], &mut here[..n], lanes);
                    vanilla::forward(simd, &mut here[..n]);
                }
                &next[(layers.len() - 1) * n..]
            }
        };
        if let Some(read_out) = &self.read_out {
            read_out.apply(simd, shown, &[], output, lanes);
        }
    }

    #[inline(always)]
    fn back_with<S: Simd>(&mut self, simd: S, step: Back<'_, T>) {
        let lanes = self.lanes;
        let Back { state, input, record, next, output_adjoint, state_adjoint, input_adjoint, scratch } = step;
        let shown = match &self.maps {
            Maps::Lstm { hidden, .. } => hidden * lanes,
            Maps::Gru { .. } => 0,
            Maps::Vanilla { hidden, layers } => hidden * lanes * (layers.len() - 1),
        };
        match &mut self.read_out {
            Some(read_out) => {
                read_out.transpose(simd, output_adjoint, &mut state_adjoint[shown..], &mut [], lanes);
                read_out.accumulate(simd, output_adjoint, &next[shown..], &[], lanes);
            }
            None => {
                for (d, &y) in state_adjoint[shown..].iter_mut().zip(output_adjoint) {
                    *d += y;
                }
            }
        }
        input_adjoint.fill(T::zero());
        match &mut self.maps {
            Maps::Lstm { hidden, gates, projection } => {
                let n = *hidden * lanes;
                let ((c, h), (dc, dh)) = (state.split_at(n), state_adjoint.split_at_mut(n));
                let (record, m) = record.split_at_mut(5 * n);
                match projection {
                    Some(projection) => {
                        scratch.fill(T::zero());
                        projection.transpose(simd, dh, scratch, &mut [], lanes);
                        projection.accumulate(simd, dh, m, &[], lanes);
                        lstm::backward(simd, record, c, scratch, dc);
                    }
                    None => lstm::backward(simd, record, c, dh, dc),
                }
                dh.fill(T::zero());
                gates.transpose(simd, &record[..4 * n], input_adjoint, dh, lanes);
                gates.accumulate(simd, &record[..4 * n], input, h, lanes);
            }
            Maps::Gru { hidden, gates, candidate, recalled } => {
                let n = *hidden * lanes;
                gru::backward(simd, record, state, state_adjoint);
                let (da, rest) = record.split_at(2 * n);
                let (dn, db) = rest.split_at(n);
                gates.transpose(simd, da, input_adjoint, state_adjoint, lanes);
                candidate.transpose(simd, dn, input_adjoint, &mut [], lanes);
                recalled.transpose(simd, db, state_adjoint, &mut [], lanes);
                gates.accumulate(simd, da, input, state, lanes);
                candidate.accumulate(simd, dn, input, &[], lanes);
                recalled.accumulate(simd, db, state, &[], lanes);
            }
            Maps::Vanilla { hidden, layers } => {
                let n = *hidden * lanes;
                for (l, layer) in layers.iter_mut().enumerate().rev() {
                    let (below, here) = state_adjoint.split_at_mut(l * n);
                    let here = &mut here[..n];
                    vanilla::backward(simd, &next[l * n..(l + 1) * n], here, scratch);
                    here.fill(T::zero());
                    let (dx, x) = match l {
                        0 => (&mut *input_adjoint, input),
                        _ => (&mut below[(l - 1) * n..], &next[(l - 1) * n..l * n]),
                    };
                    layer.transpose(simd, scratch, dx, here, lanes);
                    layer.accumulate(simd, scratch, x, &state[l * n..(l + 1) * n], lanes);
                }
            }
        }
    }
}

pub(crate) struct Forwards<'a, T>(&'a Cells<T>, Forward<'a, T>);

impl<T: Scalar> WithSimd for Forwards<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.0.forward_with(simd, self.1);
    }
}

pub(crate) struct Backs<'a, T>(&'a mut Cells<T>, Back<'a, T>);

impl<T: Scalar> WithSimd for Backs<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.0.back_with(simd, self.1);
    }
}
