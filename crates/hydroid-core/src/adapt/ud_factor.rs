//! Covariance matrix in factored form, `P = U D U'`: symmetric and positive definite by construction.

#![expect(
    clippy::inline_always,
    reason = "must become a part of the function that was compiled for the processor"
)]

use alloc::vec;
use alloc::vec::Vec;

use pulp::{Arch, Simd, WithSimd};

use crate::memory::Memory;

/// `P = U D U'` with `U` unit upper triangular and `D` diagonal and positive (Bierman, *Factorization Methods for
/// Discrete Sequential Estimation*, 1977, chapter V; Ljung, *System Identification*, 2nd ed., section 11.7).
///
/// A measurement multiplies each `d_j` by a ratio of positive sums, so that no variance becomes negative by rounding.
/// An update needs `1.5 n^2` multiplications, as many as `P -= K phi' P`.
///
/// Layout: the part of column `j` of `U` above the diagonal is `columns[j(j-1)/2 ..][..j]`.
#[derive(Clone, Debug)]
pub struct UdFactor {
    columns: Vec<f64>,
    d: Vec<f64>,
    f: Vec<f64>,
    gain: Vec<f64>,
    arch: Arch,
}

impl UdFactor {
    /// `P = variance I`.
    pub fn new(n: usize, variance: f64) -> Self {
        Self {
            columns: vec![0.0; n * n.saturating_sub(1) / 2],
            d: vec![variance; n],
            f: vec![0.0; n],
            gain: vec![0.0; n],
            arch: Arch::new(),
        }
    }

    /// `P = variance (T'T)^-1` for a regular upper triangle `T` (`n x n`, row by row).
    ///
    /// # Panics
    /// If `r_factor` has not `n x n` numbers.
    pub fn inverse(r_factor: &[f64], variance: f64) -> Self {
        let n = r_factor.len().isqrt();
        assert_eq!(n * n, r_factor.len(), "a square matrix");
        let mut own = Self::new(n, variance);
        // The inverse of T is U D^(1/2): column j by back substitution, divided by its diagonal element.
        for j in 0..n {
            let diagonal = r_factor[j * n + j];
            own.d[j] = variance / (diagonal * diagonal);
            for i in (0..j).rev() {
                let column = &own.columns[start(j)..][..j];
                let known: f64 = (i + 1..j).map(|k| r_factor[i * n + k] * column[k]).sum();
                own.columns[start(j) + i] = -(known + r_factor[i * n + j]) / r_factor[i * n + i];
            }
        }
        own
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.numbers(&mut self.columns);
        memory.numbers(&mut self.d);
        if memory.is_loading() {
            self.f.fill(0.0);
        }
    }

    /// Whether all numbers are small enough for their squares and products to be finite.
    pub fn is_sound(&self) -> bool {
        let sizes = 1e-100..=1e100;
        self.d.iter().all(|d| sizes.contains(d)) && self.columns.iter().all(|u| u.abs() <= *sizes.end())
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.d.len()
    }

    /// The parts of the columns of `U` above the diagonal, one after the other.
    pub fn columns(&self) -> &[f64] {
        &self.columns
    }

    /// The diagonal of `D`.
    pub fn diagonal(&self) -> &[f64] {
        &self.d
    }

    /// Whether the matrix is empty.
    pub fn is_empty(&self) -> bool {
        self.d.is_empty()
    }

    fn column(&self, j: usize) -> &[f64] {
        &self.columns[start(j)..][..j]
    }

    /// `P_ij`.
    pub fn covariance(&self, i: usize, j: usize) -> f64 {
        let u = |i: usize, k: usize| if i == k { 1.0 } else { self.column(k)[i] };
        (i.max(j)..self.len()).map(|k| u(i, k) * self.d[k] * u(j, k)).sum()
    }

    /// `P *= factor`.
    pub fn scale(&mut self, factor: f64) {
        for d in &mut self.d {
            *d *= factor;
        }
    }

    /// Projects a regressor `phi` and returns `phi' P phi >= 0`.
    pub fn project(&mut self, phi: &[f64]) -> f64 {
        self.arch.dispatch(Project { factor: self, phi })
    }

    /// `phi' P phi` without a change of the projected regressor.
    pub(super) fn variance(&self, phi: impl Fn(usize) -> f64 + Copy) -> f64 {
        let f = |j: usize| phi(j) + self.column(j).iter().enumerate().map(|(i, u)| u * phi(i)).sum::<f64>();
        (0..self.len()).map(|j| self.d[j] * f(j) * f(j)).sum()
    }

    /// Projects the unit vector `e_i`.
    pub fn project_unit(&mut self, i: usize) {
        self.f[..i].fill(0.0);
        self.f[i] = 1.0;
        for j in i + 1..self.len() {
            self.f[j] = self.columns[start(j) + i];
        }
    }

    /// Measurement update with the projected regressor and the noise variance `noise > 0`: `P -= K phi' P`. Returns
    /// the gain `K = P phi / (noise + phi' P phi)`.
    pub fn absorb(&mut self, noise: f64) -> &[f64] {
        self.arch.dispatch(Absorb { factor: self, noise });
        &self.gain
    }
}

struct Project<'a> {
    factor: &'a mut UdFactor,
    phi: &'a [f64],
}

impl WithSimd for Project<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let Self { factor: UdFactor { columns, d, f, .. }, phi } = self;
        let mut variance = 0.0;
        for j in 0..d.len() {
            let sum = phi[j] + dot(&phi[..j], &columns[start(j)..][..j]);
            f[j] = sum;
            variance += d[j] * sum * sum;
        }
        variance
    }
}

struct Absorb<'a> {
    factor: &'a mut UdFactor,
    noise: f64,
}

impl WithSimd for Absorb<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { factor: UdFactor { columns, d, f, gain, .. }, noise } = self;
        let mut alpha = noise;
        for j in 0..d.len() {
            let f = core::mem::take(&mut f[j]);
            let v = d[j] * f;
            let before = alpha;
            if v != 0.0 {
                alpha += v * f;
                d[j] *= before / alpha;
                let slope = -f / before;
                let column = &mut columns[start(j)..][..j];
                for (u, k) in column.iter_mut().zip(&mut gain[..j]) {
                    let old = *u;
                    *u = old + slope * *k;
                    *k += v * old;
                }
            }
            gain[j] = v;
        }
        for k in gain.iter_mut() {
            *k /= alpha;
        }
    }
}

fn start(j: usize) -> usize {
    j * j.saturating_sub(1) / 2
}

/// Scalar product in four partial sums, for vectorization.
#[inline(always)]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in a4.iter().zip(b4) {
        for lane in 0..4 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}
