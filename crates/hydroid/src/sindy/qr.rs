//! QR factor of a regression, updated block by block.
//!
//! A regression `A x = b` with many rows is reduced block by block to the upper triangular factor of `[A b]`
//! (sequential TSQR: Demmel, Grigori, Hoemmen and Langou, SIAM J. Sci. Comput. 34 (2012) A206). The memory is
//! independent of the number of rows, and the condition number is not squared as in the normal equations. Least-squares
//! problems over subsets of the columns, with or without ridge, are solved from the factor.

// The vector kernels must be inlined into the function that enables the CPU features.
#![allow(clippy::inline_always)]

use pulp::{Arch, Simd, WithSimd};

/// Rows of a block: 64 rows of 60 columns fit into a first-level cache.
pub const BLOCK_ROWS: usize = 64;

/// Upper triangular factor `R`, `width x width`, of a tall matrix `A = Q R`.
#[derive(Clone, Debug, PartialEq)]
pub struct QrFactor {
    width: usize,
    /// Row-major; zero below the diagonal.
    r: Vec<f64>,
    rows: u64,
}

/// Least-squares solution over some of the columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// One coefficient for each requested column; zero for a dependent one.
    pub coefficients: Vec<f64>,
    /// Columns (positions in the list of requested ones) that are linearly dependent on earlier ones to rounding.
    pub dependent: Vec<usize>,
    /// 2-norm of the residual.
    pub residual: f64,
}

impl QrFactor {
    /// The factor of a matrix without rows.
    pub fn new(width: usize) -> Self {
        Self { width, r: vec![0.0; width * width], rows: 0 }
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows appended so far.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Element of the factor.
    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.r[row * self.width + column]
    }

    /// Whether all elements are finite. Values whose squares overflow make them infinite.
    pub fn is_finite(&self) -> bool {
        self.r.iter().all(|x| x.is_finite())
    }

    /// 2-norm of a column of the matrix.
    pub fn column_norm(&self, column: usize) -> f64 {
        (0..=column).map(|row| self.get(row, column).powi(2)).sum::<f64>().sqrt()
    }

    /// Appends [`BLOCK_ROWS`] rows, column by column, of which `rows` are counted and the others zero. Overwrites the
    /// block.
    ///
    /// # Panics
    /// If the block has not `width * BLOCK_ROWS` numbers.
    pub fn append_rows(&mut self, block: &mut [f64], rows: usize) {
        assert_eq!(block.len(), self.width * BLOCK_ROWS, "a block is width x BLOCK_ROWS numbers");
        Arch::new().dispatch(AppendRows { r: &mut self.r, block, width: self.width });
        self.rows += rows as u64;
    }

    /// Appends all rows of another factor.
    ///
    /// # Panics
    /// If the widths differ.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!(self.width, other.width, "factors of the same columns");
        let mut block = vec![0.0; self.width * BLOCK_ROWS];
        for start in (0..self.width).step_by(BLOCK_ROWS) {
            block.fill(0.0);
            for i in 0..BLOCK_ROWS.min(self.width - start) {
                for j in start + i..self.width {
                    block[j * BLOCK_ROWS + i] = other.get(start + i, j);
                }
            }
            self.append_rows(&mut block, 0);
        }
        self.rows += other.rows;
    }

    /// The factor of the matrix whose column `j` is multiplied by `scale[j]`.
    #[must_use]
    pub fn scaled(&self, scale: &[f64]) -> Self {
        let mut scaled = self.clone();
        for row in scaled.r.chunks_exact_mut(self.width) {
            for (value, s) in row.iter_mut().zip(scale) {
                *value *= s;
            }
        }
        scaled
    }

    /// The factor with one more row `weight[j]` for each column: ridge regression with the penalty `weight[j]^2 x_j^2`.
    #[must_use]
    pub fn with_ridge(&self, weight: &[f64]) -> Self {
        let mut diagonal = Self::new(self.width);
        for (j, &w) in weight.iter().enumerate() {
            diagonal.r[j * self.width + j] = w;
        }
        let mut ridged = self.clone();
        ridged.merge(&diagonal);
        ridged
    }

    /// The factor of the matrix to whose last column `x[j]` times column `j` is added, for all other columns.
    #[must_use]
    pub fn shift_target(&self, x: &[f64]) -> Self {
        let mut shifted = self.clone();
        let last = self.width - 1;
        for row in shifted.r.chunks_exact_mut(self.width) {
            row[last] += row[..last].iter().zip(x).map(|(a, x)| a * x).sum::<f64>();
        }
        shifted
    }

    /// The factor of some of the columns, in the given order.
    ///
    /// # Panics
    /// If a column does not exist.
    #[must_use]
    pub fn select(&self, columns: &[usize]) -> Self {
        let mut own = Self::new(columns.len());
        let mut block = vec![0.0; columns.len() * BLOCK_ROWS];
        for start in (0..self.width).step_by(BLOCK_ROWS) {
            block.fill(0.0);
            for (column, &j) in block.chunks_exact_mut(BLOCK_ROWS).zip(columns) {
                for i in start..self.width.min(start + BLOCK_ROWS).min(j + 1) {
                    column[i - start] = self.get(i, j);
                }
            }
            own.append_rows(&mut block, 0);
        }
        own.rows = self.rows;
        own
    }

    /// Solves `min |A_S x - b|` by Householder reflections, for the columns `S` (ascending) and the right-hand side
    /// `target`. A column with an orthogonal part below `1e-10` of its norm is omitted as dependent.
    ///
    /// # Panics
    /// If a column does not exist.
    pub fn solve(&self, columns: &[usize], target: usize) -> Solution {
        const DEPENDENT: f64 = 1e-10;
        let n = self.width;
        // Column by column; the right-hand side comes last. Column S_j is zero below row S_j.
        let mut work: Vec<Vec<f64>> = columns
            .iter()
            .chain([&target])
            .map(|&j| (0..n).map(|i| if i <= j { self.get(i, j) } else { 0.0 }).collect())
            .collect();
        let norms: Vec<f64> = columns.iter().map(|&j| self.column_norm(j)).collect();
        let mut dependent = Vec::new();
        let mut kept: Vec<usize> = Vec::with_capacity(columns.len());
        for (position, &column) in columns.iter().enumerate() {
            let pivot = kept.len();
            let (head, tail) = work.split_at_mut(position + 1);
            let v = &mut head[position];
            let end = column + 1;
            let norm = v[pivot..end].iter().map(|x| x * x).sum::<f64>().sqrt();
            if norm <= DEPENDENT * norms[position] {
                dependent.push(position);
                continue;
            }
            kept.push(position);
            let alpha = -norm.copysign(v[pivot]);
            let v0 = v[pivot] - alpha;
            let beta = 1.0 / (-alpha * v0);
            if end > pivot + 1 {
                for other in tail.iter_mut() {
                    let dot = v0 * other[pivot]
                        + v[pivot + 1..end]
                            .iter()
                            .zip(&other[pivot + 1..end])
                            .map(|(a, b)| a * b)
                            .sum::<f64>();
                    let w = beta * dot;
                    other[pivot] -= w * v0;
                    for (o, a) in other[pivot + 1..end].iter_mut().zip(&v[pivot + 1..end]) {
                        *o -= w * a;
                    }
                }
                v[pivot] = alpha;
            }
        }
        let mut coefficients = vec![0.0; columns.len()];
        for row in (0..kept.len()).rev() {
            let known: f64 =
                kept[row + 1..].iter().map(|&position| work[position][row] * coefficients[position]).sum();
            coefficients[kept[row]] = (work[columns.len()][row] - known) / work[kept[row]][row];
        }
        let residual = work[columns.len()][kept.len()..].iter().map(|x| x * x).sum::<f64>().sqrt();
        Solution { coefficients, dependent, residual }
    }

    /// 2-norm of `A_S x - b` for given coefficients of the columns `S` and the right-hand side in column `target`.
    ///
    /// # Panics
    /// If a column does not exist.
    pub fn residual(&self, columns: &[usize], coefficients: &[f64], target: usize) -> f64 {
        (0..self.width)
            .map(|i| {
                let fitted: f64 = columns.iter().zip(coefficients).map(|(&j, x)| self.get(i, j) * x).sum();
                (fitted - self.get(i, target)).powi(2)
            })
            .sum::<f64>()
            .sqrt()
    }

    /// Condition number (2-norm) of the given columns with unit norm, from 30 steps of power and inverse iteration,
    /// which give a lower bound; infinite if a column depends on the others.
    pub fn condition(&self, columns: &[usize]) -> f64 {
        let n = columns.len();
        if n == 0 {
            return 1.0;
        }
        let own = self.select(columns);
        let inverse_norms: Vec<f64> = (0..n).map(|j| 1.0 / own.column_norm(j)).collect();
        let own = own.scaled(&inverse_norms);
        if (0..n).any(|j| own.get(j, j).abs() < f64::EPSILON || !own.get(j, j).is_finite()) {
            return f64::INFINITY;
        }
        let normalise = |x: &mut Vec<f64>| {
            let norm = x.iter().map(|x| x * x).sum::<f64>().sqrt();
            for x in x.iter_mut() {
                *x /= norm;
            }
            norm
        };
        // A start vector that is orthogonal to no singular vector in practice.
        let start: Vec<f64> = (0..n).map(|j| 1.0 + 0.5 * (1.0 + j as f64).sin()).collect();
        let (mut high, mut low) = (start.clone(), start);
        let (mut largest, mut inverse_smallest) = (0.0, 0.0);
        for _ in 0..30 {
            normalise(&mut high);
            let rx: Vec<f64> = (0..n).map(|i| (i..n).map(|j| own.get(i, j) * high[j]).sum()).collect();
            high = (0..n).map(|j| (0..=j).map(|i| own.get(i, j) * rx[i]).sum()).collect();
            largest = rx.iter().map(|x| x * x).sum::<f64>().sqrt();
            normalise(&mut low);
            // R' z = low, R low = z.
            let mut z = low.clone();
            for i in 0..n {
                let known: f64 = (0..i).map(|k| own.get(k, i) * z[k]).sum();
                z[i] = (z[i] - known) / own.get(i, i);
            }
            inverse_smallest = z.iter().map(|x| x * x).sum::<f64>().sqrt();
            for i in (0..n).rev() {
                let known: f64 = (i + 1..n).map(|k| own.get(i, k) * z[k]).sum();
                z[i] = (z[i] - known) / own.get(i, i);
            }
            low = z;
        }
        largest * inverse_smallest
    }
}

/// Householder reflections of a block with the factor above it: that of column `j` acts on row `j` and on the block.
struct AppendRows<'a> {
    r: &'a mut [f64],
    block: &'a mut [f64],
    width: usize,
}

impl WithSimd for AppendRows<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { r, block, width } = self;
        for j in 0..width {
            let (head, tail) = block.split_at_mut((j + 1) * BLOCK_ROWS);
            let v = S::as_simd_f64s(&head[j * BLOCK_ROWS..]).0;
            let norm2 = dot(simd, v, v);
            // Below this value the scale of the reflector leaves the range of doubles; the column counts as zero.
            if norm2 < 1e-280 {
                continue;
            }
            let row = &mut r[j * width..(j + 1) * width];
            let alpha = -(row[j] * row[j] + norm2).sqrt().copysign(row[j]);
            let v0 = row[j] - alpha;
            let beta = 1.0 / (-alpha * v0);
            row[j] = alpha;
            let row = &mut row[j + 1..];
            let mut fours = tail.chunks_exact_mut(4 * BLOCK_ROWS);
            let mut k = 0;
            for four in &mut fours {
                let (a, b) = four.split_at_mut(2 * BLOCK_ROWS);
                let (a0, a1) = a.split_at_mut(BLOCK_ROWS);
                let (b0, b1) = b.split_at_mut(BLOCK_ROWS);
                let columns = [
                    S::as_mut_simd_f64s(a0).0,
                    S::as_mut_simd_f64s(a1).0,
                    S::as_mut_simd_f64s(b0).0,
                    S::as_mut_simd_f64s(b1).0,
                ];
                reflect(simd, v, (v0, beta), columns, &mut row[k..k + 4]);
                k += 4;
            }
            for one in fours.into_remainder().chunks_exact_mut(BLOCK_ROWS) {
                reflect(simd, v, (v0, beta), [S::as_mut_simd_f64s(one).0], &mut row[k..=k]);
                k += 1;
            }
        }
    }
}

/// `a b + c`, fused where the processor has an instruction for it.
#[inline(always)]
fn mul_add<S: Simd>(simd: S, a: S::f64s, b: S::f64s, c: S::f64s) -> S::f64s {
    if cfg!(any(target_arch = "arm", target_arch = "wasm32")) {
        simd.add_f64s(simd.mul_f64s(a, b), c)
    } else {
        simd.mul_add_f64s(a, b, c)
    }
}

#[inline(always)]
fn dot<S: Simd>(simd: S, a: &[S::f64s], b: &[S::f64s]) -> f64 {
    let mut sum = [simd.splat_f64s(0.0); 2];
    for (i, (&a, &b)) in a.iter().zip(b).enumerate() {
        sum[i & 1] = mul_add(simd, a, b, sum[i & 1]);
    }
    simd.reduce_sum_f64s(simd.add_f64s(sum[0], sum[1]))
}

/// Applies one reflector to `N` columns at once, so that it is read once for all of them.
#[inline(always)]
fn reflect<S: Simd, const N: usize>(
    simd: S,
    v: &[S::f64s],
    (v0, beta): (f64, f64),
    mut columns: [&mut [S::f64s]; N],
    row: &mut [f64],
) {
    let len = v.len();
    for column in &mut columns {
        *column = &mut std::mem::take(column)[..len];
    }
    let mut sums = [simd.splat_f64s(0.0); N];
    for i in 0..len {
        for n in 0..N {
            sums[n] = mul_add(simd, v[i], columns[n][i], sums[n]);
        }
    }
    let mut weights = [simd.splat_f64s(0.0); N];
    for n in 0..N {
        let w = beta * (v0 * row[n] + simd.reduce_sum_f64s(sums[n]));
        row[n] -= w * v0;
        weights[n] = simd.splat_f64s(-w);
    }
    for i in 0..len {
        for n in 0..N {
            columns[n][i] = mul_add(simd, weights[n], v[i], columns[n][i]);
        }
    }
}
