//! The covariance of the weights in packed symmetric storage, updated in one pass over the memory per sample.
#![expect(
    clippy::inline_always,
    reason = "the parts of a kernel must be inlined into the function that is compiled for the processor's vectors"
)]

use alloc::vec::Vec;
use core::array::from_fn;
use core::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use crate::math::aligned::Aligned;
use crate::math::vectors::{Pack, Vectors};

/// A symmetric matrix in tiles, one for each pair of blocks of weights. Of two mirrored tiles one is stored.
///
/// The columns of each block are padded with zeros to whole cache lines, so that a row of a tile is a whole number of
/// vectors. A tile is `len x padded`; tiles on the diagonal are stored whole.
#[derive(Clone, Debug)]
pub(super) struct PackedSymmetric {
    blocks: Vec<Block>,
    width: usize,
    tiles: Aligned<f64>,
}

/// A block of weights. A matrix with one column for each weight is stored in panels, one for each block, row by row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    start: usize,
    pub(super) len: usize,
    pub(super) padded: usize,
    /// First row of the block in the product `L P`.
    pub(super) row: usize,
    /// Number of nonzero local rows.
    pub(super) rows: usize,
}

impl Block {
    pub(super) fn panel(&self, rows: usize) -> Range<usize> {
        rows * self.start..rows * (self.start + self.padded)
    }

    #[inline(always)]
    pub(super) fn row_of<'a>(&self, matrix: &'a [f64], rows: usize, row: usize) -> &'a [f64] {
        &matrix[self.panel(rows)][row * self.padded..][..self.padded]
    }

    /// Range of the weights among the padded weights.
    pub(super) fn weights(&self) -> Range<usize> {
        self.start..self.start + self.len
    }
}

/// One pass over the covariance `P` of the weights:
///
/// ```text
/// P <- P - sum_q w_q w_q'           downdate of the last measurement
/// M  = L P                          products for the next step
/// P <- scale P + diag(noise)        time update
/// ```
#[derive(Debug)]
pub(super) struct FusedUpdate<'a> {
    /// `rank x width`, in panels; `rank` is [`PackedSymmetric::rank`], and unused rows are zero. `None` skips the
    /// downdate.
    pub(super) downdate: Option<&'a [f64]>,
    pub(super) rank: usize,
    pub(super) scale: f64,
    pub(super) noise: &'a [f64],
    /// `L`, the local rows of each block: `rows x width`, in panels.
    pub(super) local: &'a [f64],
    pub(super) rows: usize,
    /// `M`: `all_rows x width`, in panels; the rows of the stored blocks are overwritten.
    pub(super) products: &'a mut [f64],
    pub(super) all_rows: usize,
}

/// Largest number of downdate vectors and of local rows in a pass; more take further passes.
const MOST_RANK: usize = 4;
const MOST_ROWS: usize = 2;

fn diagonal(blocks: &[Block], width: usize) -> impl Iterator<Item = (usize, usize)> {
    let begins = blocks.iter().scan(0, move |next, block| {
        let begin = *next;
        *next += block.len * (width - block.start);
        Some((begin, block))
    });
    begins.flat_map(|(begin, block)| {
        (0..block.len).map(move |k| (block.start + k, begin + k * block.padded + k))
    })
}

/// The minimum; NaN if a number is NaN, infinite for no numbers.
pub(super) fn least(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(f64::INFINITY, |least, x| if x < least || x.is_nan() { x } else { least })
}

impl PackedSymmetric {
    /// A zero matrix. Each block is given by its number of weights, its first row in the product `L P`, and its nonzero
    /// local rows.
    pub(super) fn new(layout: impl Iterator<Item = (usize, usize, usize)>) -> Self {
        let (mut width, mut blocks) = (0, Vec::new());
        for (len, row, rows) in layout {
            let padded = len.next_multiple_of(f64::LINE);
            blocks.push(Block { start: width, len, padded, row, rows });
            width += padded;
        }
        let len = blocks.iter().map(|block| block.len * (width - block.start)).sum();
        Self { blocks, width, tiles: Aligned::zeros(len) }
    }

    /// Number of rows in which a downdate of rank `vectors` is stored.
    pub(super) fn rank(vectors: usize) -> usize {
        // Vessels have three outputs: one pass.
        if vectors <= 3 { 3 } else { vectors.next_multiple_of(MOST_RANK) }
    }

    pub(super) fn width(&self) -> usize {
        self.width
    }

    pub(super) fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    pub(super) fn numbers(&self) -> &[f64] {
        &self.tiles
    }

    pub(super) fn numbers_mut(&mut self) -> &mut [f64] {
        &mut self.tiles
    }

    pub(super) fn set_diagonal(&mut self, diagonal: &[f64]) {
        self.tiles.fill(0.0);
        self.each_diagonal(|at, p| *p = diagonal[at]);
    }

    pub(super) fn diagonal(&mut self, into: &mut [f64]) {
        self.each_diagonal(|at, p| into[at] = *p);
    }

    fn each_diagonal(&mut self, mut with: impl FnMut(usize, &mut f64)) {
        for (at, place) in diagonal(&self.blocks, self.width) {
            with(at, &mut self.tiles[place]);
        }
    }

    pub(super) fn least(&self) -> f64 {
        least(diagonal(&self.blocks, self.width).map(|(_, place)| self.tiles[place]))
    }

    /// Adds `v' P v` of each row of `v` (`count x width`). The matrix is read once for six rows.
    pub(super) fn add_quadratic(&self, v: &[f64], into: &mut [f64]) {
        for (part, into) in into.chunks_mut(6).enumerate() {
            Quadratic { matrix: self, v: &v[6 * part * self.width..], into }.run();
        }
    }

    pub(super) fn update(&mut self, update: &mut FusedUpdate<'_>) {
        let rank = if update.downdate.is_some() { update.rank } else { 0 };
        // The products are those of the matrix after the whole downdate, so that these passes come first.
        let first = if rank <= 3 { 0 } else { rank - MOST_RANK };
        for vectors in (0..first).step_by(MOST_RANK) {
            let (vectors, rows) = (vectors..vectors + MOST_RANK, 0..update.rows.min(MOST_ROWS));
            FusedPass { matrix: self, update, vectors, scale: 1.0, rows }.run();
        }
        for row in (0..update.rows).step_by(MOST_ROWS) {
            let vectors = if row == 0 { first..rank } else { 0..0 };
            let rows = row..(row + MOST_ROWS).min(update.rows);
            let scale = if rows.end == update.rows { update.scale } else { 1.0 };
            FusedPass { matrix: self, update, vectors, scale, rows }.run();
        }
        let noise = update.noise;
        self.each_diagonal(|at, p| *p += noise[at]);
    }
}

struct FusedPass<'a, 'b> {
    matrix: &'a mut PackedSymmetric,
    update: &'a mut FusedUpdate<'b>,
    vectors: Range<usize>,
    scale: f64,
    rows: Range<usize>,
}

impl FusedPass<'_, '_> {
    // Not inlined: a generic caller would compile it again.
    #[inline(never)]
    fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for FusedPass<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match (self.vectors.len(), self.rows.len()) {
            (0, 1) => self.tiles::<S, 0, 1>(simd),
            (0, _) => self.tiles::<S, 0, 2>(simd),
            (3, 1) => self.tiles::<S, 3, 1>(simd),
            (3, _) => self.tiles::<S, 3, 2>(simd),
            (_, 1) => self.tiles::<S, 4, 1>(simd),
            _ => self.tiles::<S, 4, 2>(simd),
        }
    }
}

impl FusedPass<'_, '_> {
    #[inline(always)]
    fn tiles<S: Simd, const RANK: usize, const ROWS: usize>(self, simd: S) {
        let Self { matrix, update, vectors, scale, rows } = self;
        let downdate = update.downdate.unwrap_or(&[]);
        let mut begin = 0;
        for (i, above) in matrix.blocks.iter().enumerate() {
            let w_rows = from_fn::<_, RANK, _>(|q| {
                &above.row_of(downdate, update.rank, vectors.start + q)[..above.len]
            });
            let l_rows = from_fn::<_, ROWS, _>(|r| {
                &above.row_of(update.local, update.rows, rows.start + r)[..above.len]
            });
            for (j, block) in matrix.blocks.iter().enumerate().skip(i) {
                let len = above.len * block.padded;
                let w = if RANK == 0 { &[] } else { &downdate[block.panel(update.rank)] };
                let l = &update.local[block.panel(update.rows)];
                let mut tile = Tile::<RANK, ROWS> {
                    numbers: &mut matrix.tiles[begin..begin + len],
                    padded: block.padded,
                    w_rows,
                    w_columns: from_fn(|q| &w[(vectors.start + q) * block.padded..][..block.padded]),
                    l_rows,
                    l_columns: from_fn(|r| &l[(rows.start + r) * block.padded..][..block.padded]),
                    scale,
                };
                begin += len;
                let sums = block.panel(update.all_rows).start + (above.row + rows.start) * block.padded;
                let sums = sums..sums + ROWS * block.padded;
                if i == j {
                    tile.all::<S, false>(simd, update.products, sums, 0, 0);
                } else {
                    let mirrored =
                        above.panel(update.all_rows).start + (block.row + rows.start) * above.padded;
                    tile.all::<S, true>(simd, update.products, sums, mirrored, above.padded);
                }
            }
        }
    }
}

struct Quadratic<'a> {
    matrix: &'a PackedSymmetric,
    v: &'a [f64],
    into: &'a mut [f64],
}

impl Quadratic<'_> {
    #[inline(never)]
    fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for Quadratic<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match self.into.len() {
            1 => self.tiles::<S, 1>(simd),
            2 => self.tiles::<S, 2>(simd),
            3 => self.tiles::<S, 3>(simd),
            4 => self.tiles::<S, 4>(simd),
            5 => self.tiles::<S, 5>(simd),
            _ => self.tiles::<S, 6>(simd),
        }
    }
}

impl Quadratic<'_> {
    #[inline(always)]
    fn tiles<S: Simd, const COUNT: usize>(self, simd: S) {
        let Self { matrix, v, into } = self;
        let rows: [&[f64]; COUNT] = from_fn(|r| &v[r * matrix.width..][..matrix.width]);
        let mut begin = 0;
        for (i, above) in matrix.blocks.iter().enumerate() {
            for (j, block) in matrix.blocks.iter().enumerate().skip(i) {
                let tile = &matrix.tiles[begin..begin + above.len * block.padded];
                begin += tile.len();
                let (mut left, mut right) = (rows, rows);
                for r in 0..COUNT {
                    left[r] = &rows[r][above.weights()];
                    right[r] = &rows[r][block.panel(1)];
                }
                let pairs = above.len / 2 * 2;
                let (main, rest) = tile.split_at(pairs * block.padded);
                let mut sums = [Pack::<S, f64>::splat(simd, 0.0); COUNT];
                for (k, pair) in main.chunks_exact(2 * block.padded).enumerate() {
                    products::<S, 2, COUNT>(simd, pair, 2 * k, left, right, &mut sums);
                }
                for (k, one) in rest.chunks_exact(block.padded).enumerate() {
                    products::<S, 1, COUNT>(simd, one, pairs + k, left, right, &mut sums);
                }
                let mirrored = if i == j { 1.0 } else { 2.0 };
                into.iter_mut().zip(sums).for_each(|(into, sum)| *into += mirrored * sum.sum());
            }
        }
    }
}

/// Adds `left_k (numbers_k * right)`, not yet summed over the columns, of `N` rows of a tile from row `k` on, which share the
/// loads of `right`.
#[inline(always)]
fn products<S: Simd, const N: usize, const COUNT: usize>(
    simd: S,
    numbers: &[f64],
    k: usize,
    left: [&[f64]; COUNT],
    right: [&[f64]; COUNT],
    sums: &mut [Pack<S, f64>; COUNT],
) {
    let numbers = f64::whole::<S>(numbers).0;
    let vectors = numbers.len() / N;
    let mut columns: [&[_]; COUNT] = [&[]; COUNT];
    for r in 0..COUNT {
        columns[r] = &f64::whole::<S>(right[r]).0[..vectors];
    }
    let zero = Pack::<S, f64>::splat(simd, 0.0);
    let mut dots = [[zero; COUNT]; N];
    for c in 0..vectors {
        let mut right = [zero; COUNT];
        for r in 0..COUNT {
            right[r] = Pack::new(simd, columns[r][c]);
        }
        for n in 0..N {
            let p = Pack::new(simd, numbers[n * vectors + c]);
            for r in 0..COUNT {
                dots[n][r] = right[r].mul_add(p, dots[n][r]);
            }
        }
    }
    for (n, dots) in dots.into_iter().enumerate() {
        for r in 0..COUNT {
            sums[r] = Pack::splat(simd, left[r][k + n]).mul_add(dots[r], sums[r]);
        }
    }
}

/// One tile of a pass, with the downdate vectors and local rows at the rows and at the columns of the tile.
struct Tile<'a, const RANK: usize, const ROWS: usize> {
    numbers: &'a mut [f64],
    padded: usize,
    w_rows: [&'a [f64]; RANK],
    w_columns: [&'a [f64]; RANK],
    l_rows: [&'a [f64]; ROWS],
    l_columns: [&'a [f64]; ROWS],
    scale: f64,
}

impl<const RANK: usize, const ROWS: usize> Tile<'_, RANK, ROWS> {
    /// All rows. Writes `L_rows tile` to the products at `sums` and, for a tile with a mirror image, `L_columns tile'`
    /// to the products from `mirrored` on, in rows of `stride` numbers.
    #[inline(always)]
    fn all<S: Simd, const MIRROR: bool>(
        &mut self,
        simd: S,
        products: &mut [f64],
        sums: Range<usize>,
        mirrored: usize,
        stride: usize,
    ) {
        products[sums.clone()].fill(0.0);
        let rows = self.numbers.len() / self.padded;
        let fours = rows / 4 * 4;
        let mut k = 0;
        while k < rows {
            let (mut dots, count) = ([[0.0; ROWS]; 4], if k < fours { 4 } else { 1 });
            let into = &mut products[sums.clone()];
            if count == 4 {
                self.some::<S, 4, MIRROR>(simd, k, into, &mut dots);
            } else {
                self.some::<S, 1, MIRROR>(simd, k, into, &mut dots);
            }
            if MIRROR {
                for r in 0..ROWS {
                    for n in 0..count {
                        products[mirrored + r * stride + k + n] = dots[n][r];
                    }
                }
            }
            k += count;
        }
    }

    /// Rows `k..k + N`, which share the loads of the vectors at the columns.
    #[inline(always)]
    fn some<S: Simd, const N: usize, const MIRROR: bool>(
        &mut self,
        simd: S,
        k: usize,
        sums: &mut [f64],
        dots: &mut [[f64; ROWS]; 4],
    ) {
        // Loops, where `from_fn` and `map` would compile three functions for each use and each of the 72 kinds of tile.
        let (scale, zero) = (Pack::<S, f64>::splat(simd, self.scale), Pack::splat(simd, 0.0));
        let (mut minus_w, mut l) = ([[zero; RANK]; N], [[zero; ROWS]; N]);
        for n in 0..N {
            for q in 0..RANK {
                minus_w[n][q] = Pack::splat(simd, -self.w_rows[q][k + n]);
            }
            for r in 0..ROWS {
                l[n][r] = Pack::splat(simd, self.l_rows[r][k + n]);
            }
        }
        let numbers = f64::whole_mut::<S>(&mut self.numbers[k * self.padded..(k + N) * self.padded]).0;
        let vectors = numbers.len() / N;
        let (mut w_columns, mut l_columns): ([&[_]; RANK], [&[_]; ROWS]) = ([&[]; RANK], [&[]; ROWS]);
        for q in 0..RANK {
            w_columns[q] = &f64::whole::<S>(self.w_columns[q]).0[..vectors];
        }
        for r in 0..ROWS {
            l_columns[r] = &f64::whole::<S>(self.l_columns[r]).0[..vectors];
        }
        let sums = &mut f64::whole_mut::<S>(sums).0[..ROWS * vectors];
        let mut dot = [[zero; ROWS]; N];
        for c in 0..vectors {
            let (mut w, mut l_column, mut sum) = ([zero; RANK], [zero; ROWS], [zero; ROWS]);
            for q in 0..RANK {
                w[q] = Pack::new(simd, w_columns[q][c]);
            }
            for r in 0..ROWS {
                l_column[r] = Pack::new(simd, l_columns[r][c]);
                sum[r] = Pack::new(simd, sums[r * vectors + c]);
            }
            for n in 0..N {
                let mut p = Pack::new(simd, numbers[n * vectors + c]);
                for q in 0..RANK {
                    p = minus_w[n][q].mul_add(w[q], p);
                }
                for r in 0..ROWS {
                    sum[r] = l[n][r].mul_add(p, sum[r]);
                    if MIRROR {
                        dot[n][r] = l_column[r].mul_add(p, dot[n][r]);
                    }
                }
                numbers[n * vectors + c] = (p * scale).v;
            }
            for r in 0..ROWS {
                sums[r * vectors + c] = sum[r].v;
            }
        }
        if MIRROR {
            for n in 0..N {
                for r in 0..ROWS {
                    dots[n][r] = dot[n][r].sum();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
