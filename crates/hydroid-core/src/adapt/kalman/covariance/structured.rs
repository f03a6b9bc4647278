//! A joint covariance whose memory does not grow with the square of the number of weights.
//!
//! Only blocks of the covariance of the weights, `P_tt`, are stored ([`BlockDiagonal`]). With `P_ht` and `P_hh` stored
//! separately, the joint covariance could become indefinite. The error of the state is decomposed instead,
//!
//! ```text
//! h~ = Psi theta~ + xi        P_ht = Psi P_tt        P_hh = Psi P_tt Psi' + Pi
//! ```
//!
//! where `xi`, of covariance `Pi`, is independent of the error `theta~` of the weights: the joint covariance is
//! positive semidefinite for any part of `P_tt`. With `A = df/dh`, `B = df/dtheta` and the growth `g = (1 - leak) /
//! sqrt(lambda)` of the error of the weights over a sample, the time update is
//!
//! ```text
//! Psi <- (A Psi + B) / g        Pi <- A Pi A' + Q_h        P_tt <- g^2 P_tt + Q_theta
//! ```
//!
//! since `h~+ = (A Psi + B) theta~ + A xi` and `theta~+ = g theta~`. `Psi` is applied to the noise of the weights as
//! well: `P_hh` is too large by `Psi Q_theta Psi'`, and `P_ht` by `Psi Q_theta`.
//!
//! The measurement update, with `H~ = H_h Psi + H_t`, is that of the weights with the noise `R~ = H_h Pi H_h' + R`:
//!
//! ```text
//! S = H~ P_tt H~' + R~        theta <- theta + P_tt H~' S^-1 e        h <- h + (Psi P_tt H~' + Pi H_h') S^-1 e
//! P_tt <- blocks of P_tt - P_tt H~' S^-1 H~ P_tt
//! Psi  <- Psi - Pi H_h' R~^-1 H~        Pi <- Pi - Pi H_h' R~^-1 H_h Pi
//! ```
//!
//! and, for weights that are not learned, with the gain `K` of the state,
//!
//! ```text
//! Psi <- Psi - K H~        Pi <- (I - K H_h) Pi (I - K H_h)' + K R K'
//! ```
//!
//! With all weights in one block and without weight noise this is the full filter.
//!
//! Block-diagonal covariances of weights: Puskorius and Feldkamp, "Decoupled extended Kalman filter training of
//! feedforward layered networks", IJCNN 1991.
#![expect(
    clippy::inline_always,
    reason = "the parts of a kernel must be inlined into the function that is compiled for the processor's vectors"
)]

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use super::super::cholesky::{Cholesky, gather, reset_rows, subtract_outer, transpose};
use super::super::learnable::Learnable;
use super::super::measurement::MeasurementUpdate;
use super::super::options::FilterOptions;
use super::block_diagonal::BlockDiagonal;
use super::packed::least;
use super::panels::Panel;
use crate::math::rows::{add_rows, dot};

/// The joint covariance in the notation of the [module](self). Matrices with a column for each weight are in panels.
#[derive(Clone, Debug)]
pub(in super::super) struct StructuredCovariance {
    panels: Vec<Panel>,
    pub(super) places: Vec<Option<usize>>,
    weight_noise: Vec<f64>,
    /// `Psi` (`n x width`), `Pi` (`n x n`), `P_tt`.
    psi: Vec<f64>,
    pi: Vec<f64>,
    tt: BlockDiagonal,
    local: Vec<f64>,
    cholesky: Cholesky,
    scratch: Scratch,
}

#[derive(Clone, Debug)]
struct Scratch {
    /// A panel of local rows of all blocks, and a zero matrix of as many rows with a column for each state or output.
    expanded: Vec<f64>,
    zeros: Vec<f64>,
    wide: Vec<f64>,
    /// `H~` and `H~ P_tt` (`outputs x width`).
    jacobian: Vec<f64>,
    product: Vec<f64>,
    /// `H_h Pi`, then `W_h'`; `U'`; `K L~ - U` (`outputs x n`).
    by_state: Vec<f64>,
    whitened: Vec<f64>,
    left: Vec<f64>,
    /// `H_h Pi H_h'`, and `L^-1 L~` (`outputs x outputs`).
    own: Vec<f64>,
    factors: Vec<f64>,
    square: Vec<f64>,
    transposed: Vec<f64>,
    model: Vec<f64>,
}

impl StructuredCovariance {
    /// Zero covariance of the learned blocks, with `group` neighbouring blocks in each block of `P_tt`.
    pub(super) fn new<M: Learnable>(
        model: &M,
        options: &FilterOptions,
        group: usize,
        learned: &[usize],
    ) -> Self {
        let (n, outputs, rows) = (model.state_len(), model.outputs(), model.rows());
        let panels = Panel::all(model, learned, group);
        let places: Vec<usize> = panels.iter().flat_map(|panel| panel.places(model.blocks())).collect();
        let weight_noise = places.iter().map(|&place| options.weight_noise[place]).collect();
        let (width, all_rows, side) = (places.len(), model.blocks().len() * rows, n.max(outputs));
        let widest = panels.iter().map(|panel| panel.width).max().unwrap_or(0);
        let zeros = |len: usize| vec![0.0; len];
        Self {
            tt: BlockDiagonal::new(&panels),
            panels,
            places: places.into_iter().map(Some).collect(),
            weight_noise,
            psi: zeros(n * width),
            pi: zeros(n * n),
            local: zeros(rows * width),
            cholesky: Cholesky::new(outputs),
            scratch: Scratch {
                expanded: zeros(all_rows * widest),
                zeros: zeros(all_rows * side),
                wide: zeros(n * widest),
                jacobian: zeros(outputs * width),
                product: zeros(outputs * width),
                by_state: zeros(outputs * n),
                whitened: zeros(outputs * n),
                left: zeros(outputs * n),
                own: zeros(outputs * outputs),
                factors: zeros(outputs * outputs),
                square: zeros(n * side),
                transposed: zeros(n * side),
                model: zeros(model.scratch(widest.max(side))),
            },
        }
    }

    pub(super) fn restart(&mut self, initial: &[f64]) {
        self.fold();
        self.psi.fill(0.0);
        self.tt.set_diagonal(&self.panels, initial);
    }

    pub(super) fn reset(&mut self, initial: &[f64]) {
        let n = initial.len();
        self.psi.fill(0.0);
        self.pi.fill(0.0);
        (0..n).for_each(|i| self.pi[i * (n + 1)] = initial[i]);
    }

    pub(super) fn reset_part(&mut self, part: Range<usize>, initial: f64) {
        let n = self.pi.len().isqrt();
        reset_rows(&mut self.pi, part.clone(), initial);
        for panel in &self.panels {
            self.psi[panel.of(n)][part.start * panel.width..part.end * panel.width].fill(0.0);
        }
    }

    /// `Pi <- Pi + Psi P_tt Psi'`, as many rows at a time as there are outputs.
    fn fold(&mut self) {
        let Self { panels, psi, pi, tt, scratch: Scratch { jacobian, product, own, .. }, .. } = self;
        let (n, q) = (pi.len().isqrt(), own.len().isqrt());
        for from in (0..n).step_by(q) {
            let rows = from..n.min(from + q);
            let count = rows.len();
            for panel in &*panels {
                let psi = &psi[panel.of(n)][rows.start * panel.width..rows.end * panel.width];
                jacobian[panel.of(count)].copy_from_slice(psi);
            }
            tt.times(panels, count, jacobian, product);
            for panel in &*panels {
                let product = product[panel.of(count)].chunks_exact(panel.width);
                for (i, product) in rows.clone().zip(product) {
                    for (j, psi) in psi[panel.of(n)].chunks_exact(panel.width).take(i + 1).enumerate() {
                        pi[i * n + j] += dot(product, psi);
                    }
                }
            }
        }
        for i in 0..n {
            (0..i).for_each(|j| pi[j * n + i] = pi[i * n + j]);
        }
    }

    pub(super) fn variances(&self) -> (Vec<f64>, Vec<f64>) {
        let n = self.pi.len().isqrt();
        let mut own = self.clone();
        own.fold();
        ((0..n).map(|i| own.pi[i * (n + 1)]).collect(), self.tt.diagonal(&self.panels))
    }

    pub(super) fn least_variance(&self) -> f64 {
        let n = self.pi.len().isqrt();
        least((0..n).map(|i| self.pi[i * (n + 1)]))
    }

    pub(super) fn add_variances(&mut self, v_h: &[f64], v_t: &[f64], into: &mut [f64]) {
        let n = self.pi.len().isqrt();
        let width: usize = self.panels.iter().map(|panel| panel.width).sum();
        for (r, into) in into.iter_mut().enumerate() {
            *into += self.variance(&v_h[r * n..][..n], &v_t[r * width..][..width]);
        }
    }

    /// `v' P v = w' P_tt w + v_h' Pi v_h` with `w = Psi' v_h + v_t`.
    fn variance(&mut self, v_h: &[f64], v_t: &[f64]) -> f64 {
        let Self { panels, psi, pi, tt, scratch: Scratch { jacobian, product, .. }, .. } = self;
        let (n, width) = (v_h.len(), v_t.len());
        jacobian[..width].copy_from_slice(v_t);
        for panel in &*panels {
            add_rows(&mut jacobian[panel.of(1)], &psi[panel.of(n)], v_h);
        }
        tt.times(panels, 1, &jacobian[..width], &mut product[..width]);
        let of_state: f64 = pi.chunks_exact(n).zip(v_h).map(|(row, &v)| v * dot(row, v_h)).sum();
        of_state + dot(&jacobian[..width], &product[..width])
    }

    pub(super) fn len(&self) -> usize {
        self.psi.len() + self.pi.len() + self.tt.numbers.len()
    }

    pub(super) fn parts(&mut self) -> [&mut [f64]; 6] {
        [&mut self.psi, &mut self.pi, &mut self.local, &mut self.tt.numbers, &mut [], &mut []]
    }

    pub(super) fn advance<M: Learnable>(&mut self, model: &M, growth: f64, noise: f64) {
        let Self { panels, psi, pi, local, tt, weight_noise, scratch, .. } = self;
        let Scratch { expanded, zeros, wide, square, transposed, model: scratch, .. } = scratch;
        let (n, rows) = (model.state_len(), model.rows());
        let all_rows = model.blocks().len() * rows;
        let by = 1.0 / growth;
        for panel in &*panels {
            let (expanded, wide) = (&mut expanded[..all_rows * panel.width], &mut wide[..n * panel.width]);
            panel.linearize(model, &mut local[panel.of(rows)]);
            panel.expand(&local[panel.of(rows)], expanded);
            let psi = &mut psi[panel.of(n)];
            model.apply_state_jacobian(psi, expanded, panel.width, wide, scratch);
            Scale { x: wide, by, into: psi }.run();
        }
        let (zeros, square, transposed) =
            (&zeros[..all_rows * n], &mut square[..n * n], &mut transposed[..n * n]);
        model.apply_state_jacobian(pi, zeros, n, square, scratch);
        transpose(n, n, square, transposed);
        model.apply_state_jacobian(transposed, zeros, n, square, scratch);
        for i in 0..n {
            for j in 0..=i {
                // The triangles differ by rounding only; a copy makes the matrix exactly symmetric.
                pi[i * n + j] = square[i * n + j];
                pi[j * n + i] = square[i * n + j];
            }
        }
        model.active_state().for_each(|i| pi[i * (n + 1)] += noise);
        tt.advance(panels, growth, weight_noise);
    }

    /// `H~`, `H~ P_tt` and `H_h Pi` of all outputs, and `H P H'` into `measured`.
    pub(super) fn predict_output<M: Learnable>(&mut self, model: &M, measured: &mut MeasurementUpdate) {
        let Self { panels, psi, pi, local, tt, scratch, .. } = self;
        let Scratch { expanded, zeros, jacobian, product, by_state, own, transposed, .. } = scratch;
        let (n, q, rows) = (model.state_len(), model.outputs(), model.rows());
        let all_rows = model.blocks().len() * rows;
        for panel in &*panels {
            let expanded = &mut expanded[..all_rows * panel.width];
            panel.expand(&local[panel.of(rows)], expanded);
            model.apply_output_jacobian(&psi[panel.of(n)], expanded, panel.width, &mut jacobian[panel.of(q)]);
        }
        tt.times(panels, q, jacobian, product);
        model.apply_output_jacobian(pi, &zeros[..all_rows * n], n, by_state);
        transpose(q, n, by_state, &mut transposed[..n * q]);
        model.apply_output_jacobian(&transposed[..n * q], &zeros[..all_rows * q], q, own);
        measured.covariance.copy_from_slice(own);
        AddOutputCovariance { panels, jacobian, product, covariance: &mut measured.covariance }.run();
    }

    pub(super) fn correct(
        &mut self,
        measured: &MeasurementUpdate,
        state: &mut [f64],
        change: &mut [f64],
        learns: bool,
    ) -> bool {
        Correct { covariance: self, measured, state, change, learns }.run()
    }
}

struct Scale<'a> {
    x: &'a [f64],
    by: f64,
    into: &'a mut [f64],
}

impl Scale<'_> {
    #[inline(never)]
    fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for Scale<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.into.iter_mut().zip(self.x).for_each(|(into, &x)| *into = x * self.by);
    }
}

struct AddOutputCovariance<'a> {
    panels: &'a [Panel],
    jacobian: &'a [f64],
    product: &'a [f64],
    covariance: &'a mut [f64],
}

impl AddOutputCovariance<'_> {
    #[inline(never)]
    fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for AddOutputCovariance<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { panels, jacobian, product, covariance } = self;
        let q = covariance.len().isqrt();
        for panel in panels {
            for (i, jacobian) in jacobian[panel.of(q)].chunks_exact(panel.width).enumerate() {
                let product = product[panel.of(q)].chunks_exact(panel.width);
                for (j, product) in product.take(i + 1).enumerate() {
                    covariance[i * q + j] += dot(jacobian, product);
                }
            }
        }
    }
}

struct Correct<'a> {
    covariance: &'a mut StructuredCovariance,
    measured: &'a MeasurementUpdate,
    state: &'a mut [f64],
    change: &'a mut [f64],
    learns: bool,
}

impl Correct<'_> {
    #[inline(never)]
    fn run(self) -> bool {
        Arch::new().dispatch(self)
    }
}

impl WithSimd for Correct<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        let Self { covariance, measured, state, change, learns } = self;
        let StructuredCovariance { panels, psi, pi, tt, cholesky, scratch, .. } = covariance;
        let Scratch { jacobian, product, by_state, whitened: u, left, own, factors, .. } = scratch;
        let (n, q, places) = (state.len(), measured.noise.len(), &measured.measured);
        let (count, e) = (places.len(), &measured.whitened[..places.len()]);
        let of_noise = |i: usize, j: usize| {
            let noise = if i == j { measured.noise[places[i]] } else { 0.0 };
            own[places[i] * q + places[j]] + noise
        };
        if !cholesky.factor(count, of_noise) {
            return false;
        }
        // R~ = L~ L~' and U' = L~^-1 H_h Pi, the update of xi alone.
        u.copy_from_slice(by_state);
        gather(places, u, n);
        cholesky.forward(u, n);
        // S = L L' and W_h' = L^-1 (H~ P_tt Psi' + H_h Pi).
        for panel in &*panels {
            let product = product[panel.of(q)].chunks_exact(panel.width);
            for (product, by_state) in product.zip(by_state.chunks_exact_mut(n)) {
                for (psi, by_state) in psi[panel.of(n)].chunks_exact(panel.width).zip(by_state) {
                    *by_state += dot(product, psi);
                }
            }
        }
        measured.whiten(by_state, n);
        add_rows(state, &by_state[..count * n], e);
        for panel in &*panels {
            let (width, jacobian, product) =
                (panel.width, &mut jacobian[panel.of(q)], &mut product[panel.of(q)]);
            let by_state = if learns {
                gather(places, jacobian, width);
                cholesky.forward(jacobian, width);
                measured.whiten(product, width);
                let change = &mut change[panel.of(1)];
                change.fill(0.0);
                add_rows(change, &product[..count * width], e);
                &*u
            } else {
                measured.whiten(jacobian, width);
                &*by_state
            };
            for (i, psi) in psi[panel.of(n)].chunks_exact_mut(width).enumerate() {
                subtract_outer(psi, &jacobian[..count * width], by_state, i, n);
            }
        }
        if learns {
            tt.correct(panels, (q, count), product);
        } else {
            // K R~ K' - K H_h Pi - Pi H_h' K' = (K L~ - U) (K L~ - U)' - U U' with K L~ = W_h L^-1 L~.
            (0..count * count).for_each(|at| factors[at] = cholesky.at(at / count, at % count));
            measured.cholesky.forward(factors, count);
            for k in 0..count {
                let left = &mut left[k * n..(k + 1) * n];
                left.iter_mut().zip(&u[k * n..]).for_each(|(left, &u)| *left = -u);
                for (l, w) in by_state.chunks_exact(n).take(count).enumerate() {
                    add_rows(left, w, &[factors[l * count + k]]);
                }
            }
            for (i, pi) in pi.chunks_exact_mut(n).enumerate() {
                (0..count).for_each(|k| add_rows(pi, &left[k * n..(k + 1) * n], &[left[k * n + i]]));
            }
        }
        for (i, pi) in pi.chunks_exact_mut(n).enumerate() {
            subtract_outer(pi, &u[..count * n], u, i, n);
        }
        true
    }
}
