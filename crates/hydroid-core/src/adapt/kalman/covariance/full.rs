//! The full joint covariance of state and weights.
#![expect(
    clippy::inline_always,
    reason = "the parts of a kernel must be inlined into the function that is compiled for the processor's vectors"
)]

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use super::super::cholesky::{reset_rows, subtract_outer, transpose};
use super::super::learnable::Learnable;
use super::super::measurement::MeasurementUpdate;
use super::super::options::FilterOptions;
use super::lane_sums::LaneSums;
use super::packed::{Block, FusedUpdate, PackedSymmetric, least};
use crate::math::aligned::Aligned;
use crate::math::rows::{add_rows, dot};

/// `P` in the notation of [`kalman`](super::super).
///
/// The covariance of the weights is read and written once a sample, in `advance`: the pass that computes the products
/// for the next step also applies the downdate of the last measurement ([`PackedSymmetric::update`]).
#[derive(Clone, Debug)]
pub(in super::super) struct FullCovariance {
    /// `P_hh` (`n x n`), `P_ht` (`n x width`, in panels), `P_tt`.
    hh: Vec<f64>,
    ht: Aligned<f64>,
    tt: PackedSymmetric,
    learned: Vec<usize>,
    /// Index of each padded weight among the weights; `None` for padding.
    pub(super) places: Vec<Option<usize>>,
    weight_noise: Vec<f64>,
    /// `W_t'` of the last measurement (`rank x width`, in panels), and whether it has not been subtracted from `P_tt`
    /// yet.
    downdate: Aligned<f64>,
    pub(super) pending: bool,
    /// `L` (`rows x width`) and `L P_tt` (`blocks rows x width`), in panels.
    local: Aligned<f64>,
    products: Aligned<f64>,
    scratch: Scratch,
}

#[derive(Clone, Debug)]
struct Scratch {
    /// `blocks rows x n` and `blocks rows x outputs`; rows of blocks without learned weights are zero.
    by_state: Vec<f64>,
    by_output: Vec<f64>,
    square: Vec<f64>,
    transposed: Vec<f64>,
    wide: Aligned<f64>,
    downdated: Vec<f64>,
    /// `(H P)_h` (`outputs x n`).
    by_measurement: Vec<f64>,
    model: Vec<f64>,
}

impl FullCovariance {
    pub(super) fn new<M: Learnable>(model: &M, options: &FilterOptions, learned: Vec<usize>) -> Self {
        let (n, outputs, rows) = (model.state_len(), model.outputs(), model.rows());
        let tt = PackedSymmetric::new(
            learned.iter().map(|&b| (model.blocks()[b].len(), b * rows, model.rows_of(b))),
        );
        let width = tt.width();
        let mut places = vec![None; width];
        for (block, &b) in tt.blocks().iter().zip(&learned) {
            for (column, &place) in block.weights().zip(&model.blocks()[b]) {
                places[column] = Some(place);
            }
        }
        let weight_noise = places.iter().map(|p| p.map_or(0.0, |p| options.weight_noise[p])).collect();
        let (all_rows, side) = (model.blocks().len() * rows, n.max(outputs));
        let widest = tt.blocks().iter().map(|block| block.padded).max().unwrap_or(0);
        Self {
            hh: vec![0.0; n * n],
            ht: Aligned::zeros(n * width),
            tt,
            learned,
            places,
            weight_noise,
            downdate: Aligned::zeros(PackedSymmetric::rank(outputs) * width),
            pending: false,
            local: Aligned::zeros(rows * width),
            products: Aligned::zeros(all_rows * width),
            scratch: Scratch {
                by_state: vec![0.0; all_rows * n],
                by_output: vec![0.0; all_rows * outputs],
                square: vec![0.0; n * side],
                transposed: vec![0.0; n * side],
                wide: Aligned::zeros(n * widest),
                downdated: vec![0.0; PackedSymmetric::rank(outputs)],
                by_measurement: vec![0.0; outputs * n],
                model: vec![0.0; model.scratch(widest.max(side))],
            },
        }
    }

    pub(super) fn restart(&mut self, initial: &[f64]) {
        self.tt.set_diagonal(initial);
        self.ht.fill(0.0);
        self.pending = false;
    }

    pub(super) fn reset(&mut self, initial: &[f64]) {
        let n = initial.len();
        self.hh.fill(0.0);
        for (i, &initial) in initial.iter().enumerate() {
            self.hh[i * (n + 1)] = initial;
        }
        self.ht.fill(0.0);
    }

    pub(super) fn reset_part(&mut self, part: Range<usize>, initial: f64) {
        let n = self.hh.len().isqrt();
        reset_rows(&mut self.hh, part.clone(), initial);
        for block in self.tt.blocks() {
            self.ht[block.panel(n)][part.start * block.padded..part.end * block.padded].fill(0.0);
        }
    }

    pub(super) fn variances(&self) -> (Vec<f64>, Vec<f64>) {
        let n = self.hh.len().isqrt();
        let mut padded = vec![0.0; self.tt.width()];
        self.tt.clone().diagonal(&mut padded);
        if self.pending {
            let rank = self.scratch.downdated.len();
            for block in self.tt.blocks() {
                for w in self.downdate[block.panel(rank)].chunks_exact(block.padded) {
                    padded[block.panel(1)].iter_mut().zip(w).for_each(|(p, &w)| *p -= w * w);
                }
            }
        }
        ((0..n).map(|i| self.hh[i * (n + 1)]).collect(), padded)
    }

    /// The smallest variance: after the last measurement for the state, before it for the weights.
    pub(super) fn least_variance(&self) -> f64 {
        let n = self.hh.len().isqrt();
        least((0..n).map(|i| self.hh[i * (n + 1)]).chain([self.tt.least()]))
    }

    pub(super) fn add_variances(&mut self, v_h: &[f64], v_t: &[f64], into: &mut [f64]) {
        let (n, width, rank) = (self.hh.len().isqrt(), self.tt.width(), self.scratch.downdated.len());
        self.tt.add_quadratic(v_t, into);
        let downdated = &mut self.scratch.downdated;
        for (r, into) in into.iter_mut().enumerate() {
            let (v_h, v_t) = (&v_h[r * n..][..n], &v_t[r * width..][..width]);
            for (row, &v_i) in self.hh.chunks_exact(n).zip(v_h) {
                *into += v_i * dot(row, v_h);
            }
            downdated.fill(0.0);
            for block in self.tt.blocks() {
                let v = &v_t[block.panel(1)];
                for (ht, &v_i) in self.ht[block.panel(n)].chunks_exact(block.padded).zip(v_h) {
                    *into += 2.0 * v_i * dot(ht, v);
                }
                if self.pending {
                    let w = self.downdate[block.panel(rank)].chunks_exact(block.padded);
                    w.zip(&mut *downdated).for_each(|(w, sum)| *sum += dot(w, v));
                }
            }
            *into -= downdated.iter().map(|x| x * x).sum::<f64>();
        }
    }

    pub(super) fn len(&self) -> usize {
        self.hh.len() + self.ht.len() + self.tt.numbers().len()
    }

    pub(super) fn parts(&mut self) -> [&mut [f64]; 6] {
        let Self { hh, ht, tt, downdate, local, products, .. } = self;
        [hh, ht, tt.numbers_mut(), downdate, local, products]
    }

    pub(super) fn advance<M: Learnable>(&mut self, model: &M, growth: f64, noise: f64) {
        self.linearize(model);
        let all_rows = model.blocks().len() * model.rows();
        self.tt.update(&mut FusedUpdate {
            downdate: self.pending.then_some(&self.downdate),
            rank: self.scratch.downdated.len(),
            scale: growth * growth,
            noise: &self.weight_noise,
            local: &self.local,
            rows: model.rows(),
            products: &mut self.products,
            all_rows,
        });
        self.pending = false;
        self.propagate(model, growth, noise);
    }

    /// Subtracts `W W'` from `P`. The downdate of `P_tt` is pending if the filter `learns`.
    pub(super) fn correct(
        &mut self,
        measured: &MeasurementUpdate,
        state: &mut [f64],
        change: &mut [f64],
        learns: bool,
    ) {
        Downdate { covariance: self, measured, state, change }.run();
        self.pending = learns;
    }

    fn linearize<M: Learnable>(&mut self, model: &M) {
        let rows = model.rows();
        for (block, &b) in self.tt.blocks().iter().zip(&self.learned) {
            let panel = &mut self.local[block.panel(rows)];
            for (row, partials) in panel.chunks_exact_mut(block.padded).enumerate() {
                model.local_jacobian(b, row, &mut partials[..block.len]);
            }
        }
    }

    /// `P_hh` and `P_ht` of the time update: `P_hh+ = G P G'` and `P_ht+ = G P` with `G = [A B]`.
    fn propagate<M: Learnable>(&mut self, model: &M, growth: f64, noise: f64) {
        let (n, rows) = (model.state_len(), model.rows());
        let all_rows = model.blocks().len() * rows;
        let sums = &mut LaneSums::new();
        let Scratch { by_state, square, transposed, wide, model: scratch, .. } = &mut self.scratch;
        // Columns of the state of G P: A P_hh + B P_th, with B P_th = C (L P_th).
        for block in self.tt.blocks() {
            let (local, matrix) = (&self.local[block.panel(rows)], &self.ht[block.panel(n)]);
            LocalProducts { sums, block, local, matrix, out: by_state }.run();
        }
        model.apply_state_jacobian(&self.hh, by_state, n, &mut square[..n * n], scratch);
        transpose(n, n, &square[..n * n], &mut transposed[..n * n]);
        for block in self.tt.blocks() {
            // Columns of the weights of G P, and L times them for G (G P)'.
            let (ht, wide) = (&mut self.ht[block.panel(n)], &mut wide[..n * block.padded]);
            let products = &mut self.products[block.panel(all_rows)];
            model.apply_state_jacobian(ht, products, block.padded, wide, scratch);
            let (local, noise) = (&self.local[block.panel(rows)], &self.weight_noise[block.weights()]);
            let first_row = model.first_output_block() * rows;
            CrossCovariance { sums, block, local, wide, by_state, growth, ht, noise, first_row, products }
                .run();
        }
        model.apply_state_jacobian(&transposed[..n * n], by_state, n, &mut square[..n * n], scratch);
        for i in 0..n {
            for j in 0..=i {
                // The triangles differ by rounding only; a copy makes the matrix exactly symmetric.
                let p = square[i * n + j];
                self.hh[i * n + j] = p;
                self.hh[j * n + i] = p;
            }
        }
        model.active_state().for_each(|i| self.hh[i * (n + 1)] += noise);
    }

    /// Writes `H P` of all outputs into the downdate, and `H P H'` into `measured`.
    pub(super) fn predict_output<M: Learnable>(&mut self, model: &M, measured: &mut MeasurementUpdate) {
        let (n, q, rows) = (model.state_len(), model.outputs(), model.rows());
        let (all_rows, rank) = (model.blocks().len() * rows, self.scratch.downdated.len());
        let sums = &mut LaneSums::new();
        let Scratch { by_state, by_output, transposed, by_measurement, .. } = &mut self.scratch;
        for block in self.tt.blocks() {
            let (local, ht) = (&self.local[block.panel(rows)], &self.ht[block.panel(n)]);
            let affects_output = block.row >= model.first_output_block() * rows;
            if affects_output {
                LocalProducts { sums, block, local, matrix: ht, out: by_state }.run();
            }
            let product = &mut self.downdate[block.panel(rank)][..q * block.padded];
            model.apply_output_jacobian(ht, &self.products[block.panel(all_rows)], block.padded, product);
            if affects_output {
                LocalProducts { sums, block, local, matrix: product, out: by_output }.run();
            }
        }
        model.apply_output_jacobian(&self.hh, by_state, n, by_measurement);
        transpose(q, n, by_measurement, &mut transposed[..n * q]);
        model.apply_output_jacobian(&transposed[..n * q], by_output, q, &mut measured.covariance);
    }
}

/// The rows of `L M'` of a block, from its panels of `L` and `M`. `M` has one row for each column of `out`.
struct LocalProducts<'a> {
    sums: &'a mut LaneSums,
    block: &'a Block,
    local: &'a [f64],
    matrix: &'a [f64],
    out: &'a mut [f64],
}

impl LocalProducts<'_> {
    #[inline(never)]
    fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for LocalProducts<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { sums, block, local, matrix, out } = self;
        let count = matrix.len() / block.padded;
        let rows = block.rows;
        let out = out[block.row * count..(block.row + rows) * count].chunks_exact_mut(count);
        for (partials, out) in local.chunks_exact(block.padded).zip(out) {
            sums.product(simd, partials, matrix, out);
        }
    }
}

/// The time update of a panel of `P_ht` from the panel `wide` of `G P`, and of the panel of `L P_tt`.
struct CrossCovariance<'a> {
    sums: &'a mut LaneSums,
    block: &'a Block,
    local: &'a [f64],
    wide: &'a [f64],
    by_state: &'a mut [f64],
    growth: f64,
    ht: &'a mut [f64],
    noise: &'a [f64],
    first_row: usize,
    products: &'a mut [f64],
}

impl CrossCovariance<'_> {
    #[inline(never)]
    fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for CrossCovariance<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { sums, block, local, wide, by_state, growth, ht, noise, first_row, products } = self;
        LocalProducts { sums, block, local, matrix: wide, out: by_state }.with_simd(simd);
        for (ht, &wide) in ht.iter_mut().zip(wide) {
            *ht = wide * growth;
        }
        // The output update needs L P_tt after the time update, in the rows of the output blocks.
        let scale = growth * growth;
        if scale != 1.0 {
            for p in &mut products[first_row * block.padded..] {
                *p *= scale;
            }
        }
        if block.row < first_row {
            return;
        }
        let own = &mut products[block.row * block.padded..];
        for (own, local) in own.chunks_exact_mut(block.padded).zip(local.chunks_exact(block.padded)) {
            for ((p, &l), &noise) in own.iter_mut().zip(local).zip(noise) {
                *p += noise * l;
            }
        }
    }
}

struct Downdate<'a> {
    covariance: &'a mut FullCovariance,
    measured: &'a MeasurementUpdate,
    state: &'a mut [f64],
    change: &'a mut [f64],
}

impl Downdate<'_> {
    #[inline(never)]
    fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for Downdate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            covariance: FullCovariance { hh, ht, tt, downdate, scratch, .. },
            measured,
            state,
            change,
        } = self;
        let (n, rank, count) = (state.len(), scratch.downdated.len(), measured.measured.len());
        let (w_h, e) = (&mut scratch.by_measurement, &measured.whitened[..count]);
        measured.whiten(w_h, n);
        add_rows(state, &w_h[..count * n], e);
        for block in tt.blocks() {
            let w_t = &mut downdate[block.panel(rank)];
            measured.whiten(w_t, block.padded);
            let (w_t, rest) = w_t.split_at_mut(count * block.padded);
            rest.fill(0.0);
            let change = &mut change[block.panel(1)];
            change.fill(0.0);
            add_rows(change, w_t, e);
            for (i, ht) in ht[block.panel(n)].chunks_exact_mut(block.padded).enumerate() {
                subtract_outer(ht, w_t, w_h, i, n);
            }
        }
        for (i, hh) in hh.chunks_exact_mut(n).enumerate() {
            subtract_outer(hh, &w_h[..count * n], w_h, i, n);
        }
    }
}
