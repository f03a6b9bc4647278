//! The covariance of the weights, read and written once a sample.
#![expect(
    clippy::inline_always,
    reason = "what a pass is made of must become a part of the function that was compiled for the processor"
)]

use alloc::vec::Vec;
use core::array::from_fn;
use core::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use super::lines::Lines;
use super::narrow::Pair;
use crate::math::Scalar;
use crate::math::aligned::Aligned;
use crate::math::rows::dot;
use crate::math::vectors::Pack;

/// A symmetric matrix in tiles, one for each pair of blocks of weights; of every two that mirror each other, one.
///
/// Columns are padded, block by block, to whole cache lines, so that every row of a tile is whole vectors; what stands in
/// the padding is zero. A tile is `len x padded`: rows are not padded. Tiles on the diagonal are kept whole.
#[derive(Clone, Debug)]
pub(super) struct Triangle<T> {
    spans: Vec<Span>,
    /// Padded number of weights.
    width: usize,
    tiles: Aligned<T>,
}

/// A block of weights.
///
/// Matrices with a column for each weight are kept in panels, one for each block, each row by row: what works on a block's
/// columns finds them side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// Where it begins, among the padded weights.
    start: usize,
    /// Number of weights.
    pub(super) len: usize,
    /// With padding.
    pub(super) padded: usize,
    /// Its first row among the products.
    pub(super) row: usize,
    /// How many of its weights work through its first local row alone, where the others do through the second alone.
    pub(super) split: Option<usize>,
}

/// What a triangle must know of a block: its number of weights, the first of its rows among the products, and how many of its
/// weights work through its first local row alone, the others through the second alone, if that is so.
pub(super) type Block = (usize, usize, Option<usize>);

impl Span {
    /// Its panel of a matrix of so many rows.
    pub(super) fn panel(&self, rows: usize) -> Range<usize> {
        rows * self.start..rows * (self.start + self.padded)
    }

    /// One of the rows of that.
    #[inline(always)]
    pub(super) fn row_of<'a, T>(&self, matrix: &'a [T], rows: usize, row: usize) -> &'a [T] {
        &matrix[self.panel(rows)][row * self.padded..][..self.padded]
    }

    /// How many of its local rows are not zero, of so many.
    pub(super) fn rows(&self, rows: usize) -> usize {
        if self.split == Some(self.len) { 1 } else { rows }
    }

    /// Its weights among the padded ones.
    pub(super) fn weights(&self) -> Range<usize> {
        self.start..self.start + self.len
    }
}

/// One pass over the covariance `P` of the weights:
///
/// ```text
/// P <- P - sum_q w_q w_q'           downdate, of the last measurement
/// M  = L P                          products, of the next step
/// P <- scale P + diag(noise)        time update
/// ```
#[derive(Debug)]
pub(super) struct Pass<'a, T> {
    /// `rank x width`, in panels; as many rows as [`Triangle::rank`] says, of which some may be zero. `None` takes nothing.
    pub(super) downdate: Option<&'a [T]>,
    pub(super) rank: usize,
    pub(super) scale: T,
    /// `width`.
    pub(super) noise: &'a [T],
    /// `rows x width`, in panels: of each block its local rows.
    pub(super) local: &'a [T],
    /// Local rows of each block.
    pub(super) rows: usize,
    /// `all_rows x width`, in panels; overwritten in the rows of the blocks that are here.
    pub(super) products: &'a mut [T],
    pub(super) all_rows: usize,
}

/// Vectors that are downdated by, and local rows, in one go; for more the pass is made again.
const MOST_RANK: usize = 4;
const MOST_ROWS: usize = 2;

/// Where the diagonal stands: columns, and their places among the tiles.
fn diagonal(spans: &[Span], width: usize) -> impl Iterator<Item = (usize, usize)> {
    let begins = spans.iter().scan(0, move |next, span| {
        let begin = *next;
        *next += span.len * (width - span.start);
        Some((begin, span))
    });
    begins.flat_map(|(begin, span)| (0..span.len).map(move |k| (span.start + k, begin + k * span.padded + k)))
}

/// The smallest of some numbers, NaN if one is; infinite if there are none.
pub(super) fn least<T: Scalar>(numbers: impl Iterator<Item = T>) -> T {
    numbers.fold(T::of(f64::INFINITY), |least, x| if x < least || x.is_nan() { x } else { least })
}

impl<T: Scalar> Triangle<T> {
    /// Numbers in a cache line.
    const LANES: usize = T::LINE;

    /// All zero.
    pub(super) fn new(blocks: impl Iterator<Item = Block>) -> Self {
        let (mut width, mut spans) = (0, Vec::new());
        for (len, row, split) in blocks {
            let padded = len.next_multiple_of(Self::LANES);
            spans.push(Span { start: width, len, padded, row, split });
            width += padded;
        }
        let len = spans.iter().map(|span| span.len * (width - span.start)).sum();
        Self { spans, width, tiles: Aligned::zeros(len) }
    }

    /// Rows that a downdate by so many vectors is given in.
    pub(super) fn rank(vectors: usize) -> usize {
        // As many as vessels have outputs, or several passes.
        if vectors <= 3 { 3 } else { vectors.next_multiple_of(MOST_RANK) }
    }

    /// Number of columns, with padding.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Its blocks.
    pub(super) fn spans(&self) -> &[Span] {
        &self.spans
    }

    /// All numbers, for those who keep them.
    pub(super) fn numbers(&self) -> &[T] {
        &self.tiles
    }

    /// The same, to put them back.
    pub(super) fn numbers_mut(&mut self) -> &mut [T] {
        &mut self.tiles
    }

    /// Zero but for the diagonal (`width`).
    pub(super) fn set_diagonal(&mut self, diagonal: &[T]) {
        self.tiles.fill(T::zero());
        self.each_diagonal(|at, p| *p = diagonal[at]);
    }

    /// The diagonal, into `width` numbers.
    pub(super) fn diagonal(&mut self, into: &mut [T]) {
        self.each_diagonal(|at, p| into[at] = *p);
    }

    fn each_diagonal(&mut self, mut with: impl FnMut(usize, &mut T)) {
        for (at, place) in diagonal(&self.spans, self.width) {
            with(at, &mut self.tiles[place]);
        }
    }

    /// The smallest number on the diagonal.
    pub(super) fn least(&self) -> T {
        least(diagonal(&self.spans, self.width).map(|(_, place)| self.tiles[place]))
    }

    /// `v' P v` of a vector (`width`).
    pub(super) fn quadratic(&self, v: &[T]) -> T {
        T::triangle_quadratic(Arch::new(), Quadratic { triangle: self, v })
    }

    /// One pass.
    pub(super) fn pass(&mut self, pass: &mut Pass<'_, T>) {
        let rank = if pass.downdate.is_some() { pass.rank } else { 0 };
        // Products are of what is left when all has been taken off, so these passes come first.
        let first = if rank <= 3 { 0 } else { rank - MOST_RANK };
        for vectors in (0..first).step_by(MOST_RANK) {
            let (vectors, rows) = (vectors..vectors + MOST_RANK, 0..pass.rows.min(MOST_ROWS));
            T::triangle_pass(Arch::new(), Part { triangle: self, pass, vectors, scale: T::one(), rows });
        }
        for row in (0..pass.rows).step_by(MOST_ROWS) {
            let vectors = if row == 0 { first..rank } else { 0..0 };
            let rows = row..(row + MOST_ROWS).min(pass.rows);
            let scale = if rows.end == pass.rows { pass.scale } else { T::one() };
            T::triangle_pass(Arch::new(), Part { triangle: self, pass, vectors, scale, rows });
        }
        let noise = pass.noise;
        self.each_diagonal(|at, p| *p += noise[at]);
    }
}

/// A pass with some of the vectors and of the local rows, as what [`Arch`] compiles for the processor.
pub struct Part<'a, 'b, T> {
    triangle: &'a mut Triangle<T>,
    pass: &'a mut Pass<'b, T>,
    vectors: Range<usize>,
    scale: T,
    rows: Range<usize>,
}

impl<T: Scalar> WithSimd for Part<'_, '_, T> {
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

impl<T: Scalar> Part<'_, '_, T> {
    #[inline(always)]
    fn tiles<S: Simd, const RANK: usize, const ROWS: usize>(self, simd: S) {
        let Self { triangle, pass, vectors, scale, rows } = self;
        let downdate = pass.downdate.unwrap_or(&[]);
        let (mut begin, mut lines) = (0, Lines::new());
        for (i, above) in triangle.spans.iter().enumerate() {
            let w_rows =
                from_fn::<_, RANK, _>(|q| &above.row_of(downdate, pass.rank, vectors.start + q)[..above.len]);
            let l_rows =
                from_fn::<_, ROWS, _>(|r| &above.row_of(pass.local, pass.rows, rows.start + r)[..above.len]);
            for (j, span) in triangle.spans.iter().enumerate().skip(i) {
                let len = above.len * span.padded;
                if rows.len() == pass.rows
                    && let (Some(_), Some(_)) = (above.split, span.split)
                    && RANK == 3
                    && size_of::<T::V<S>>() == 64
                {
                    let numbers = &mut triangle.tiles[begin..begin + len];
                    let pair =
                        Pair::<T, RANK, ROWS> { above, span, mirror: i != j, scale, numbers, downdate };
                    if pair.pass::<S>(simd, pass, &mut lines) {
                        begin += len;
                        continue;
                    }
                }
                let w = if RANK == 0 { &[] } else { &downdate[span.panel(pass.rank)] };
                let l = &pass.local[span.panel(pass.rows)];
                let mut tile = Tile::<T, RANK, ROWS> {
                    numbers: &mut triangle.tiles[begin..begin + len],
                    padded: span.padded,
                    w_rows,
                    w_columns: from_fn(|q| &w[(vectors.start + q) * span.padded..][..span.padded]),
                    l_rows,
                    l_columns: from_fn(|r| &l[(rows.start + r) * span.padded..][..span.padded]),
                    scale,
                };
                begin += len;
                let sums = span.panel(pass.all_rows).start + (above.row + rows.start) * span.padded;
                let sums = sums..sums + ROWS * span.padded;
                if i == j {
                    tile.all::<S, false>(simd, pass.products, sums, 0, 0);
                } else {
                    let mirrored = above.panel(pass.all_rows).start + (span.row + rows.start) * above.padded;
                    tile.all::<S, true>(simd, pass.products, sums, mirrored, above.padded);
                }
            }
        }
    }
}

/// A quadratic form as what [`Arch`] compiles for the processor.
pub struct Quadratic<'a, T> {
    triangle: &'a Triangle<T>,
    v: &'a [T],
}

impl<T: Scalar> WithSimd for Quadratic<'_, T> {
    type Output = T;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> T {
        let Self { triangle, v } = self;
        let (mut begin, mut sum) = (0, T::zero());
        for (i, above) in triangle.spans.iter().enumerate() {
            for (j, span) in triangle.spans.iter().enumerate().skip(i) {
                let tile = &triangle.tiles[begin..begin + above.len * span.padded];
                begin += tile.len();
                let mut own = T::zero();
                for (row, &v_k) in tile.chunks_exact(span.padded).zip(&v[above.weights()]) {
                    own += v_k * dot(row, &v[span.panel(1)]);
                }
                // Its mirror image counts as well.
                sum += if i == j { own } else { own + own };
            }
        }
        sum
    }
}

/// A tile's part of a pass; vectors at the tile's rows and at its columns.
struct Tile<'a, T, const RANK: usize, const ROWS: usize> {
    numbers: &'a mut [T],
    padded: usize,
    w_rows: [&'a [T]; RANK],
    w_columns: [&'a [T]; RANK],
    l_rows: [&'a [T]; ROWS],
    l_columns: [&'a [T]; ROWS],
    scale: T,
}

impl<T: Scalar, const RANK: usize, const ROWS: usize> Tile<'_, T, RANK, ROWS> {
    /// All rows. `L_rows tile` goes to the products at `sums`; where the tile has a mirror image, `L_columns tile'` goes
    /// to those from `mirrored` on, whose rows are `stride` apart.
    #[inline(always)]
    fn all<S: Simd, const MIRROR: bool>(
        &mut self,
        simd: S,
        products: &mut [T],
        sums: Range<usize>,
        mirrored: usize,
        stride: usize,
    ) {
        products[sums.clone()].fill(T::zero());
        let rows = self.numbers.len() / self.padded;
        let fours = rows / 4 * 4;
        let mut k = 0;
        while k < rows {
            let (mut dots, count) = ([[T::zero(); ROWS]; 4], if k < fours { 4 } else { 1 });
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

    /// Rows `k..k + N`. Side by side, they share the loads of the vectors at the columns.
    #[inline(always)]
    fn some<S: Simd, const N: usize, const MIRROR: bool>(
        &mut self,
        simd: S,
        k: usize,
        sums: &mut [T],
        dots: &mut [[T; ROWS]; 4],
    ) {
        let splat = |x: T| Pack::<S, T>::splat(simd, x);
        let minus_w: [[_; RANK]; N] = from_fn(|n| from_fn(|q| splat(-self.w_rows[q][k + n])));
        let l: [[_; ROWS]; N] = from_fn(|n| from_fn(|r| splat(self.l_rows[r][k + n])));
        let scale = splat(self.scale);
        let numbers = T::whole_mut::<S>(&mut self.numbers[k * self.padded..(k + N) * self.padded]).0;
        let vectors = numbers.len() / N;
        let w_columns: [_; RANK] = self.w_columns.map(|w| &T::whole::<S>(w).0[..vectors]);
        let l_columns: [_; ROWS] = self.l_columns.map(|l| &T::whole::<S>(l).0[..vectors]);
        let sums = &mut T::whole_mut::<S>(sums).0[..ROWS * vectors];
        let mut dot = [[splat(T::zero()); ROWS]; N];
        for c in 0..vectors {
            let w: [_; RANK] = from_fn(|q| Pack::new(simd, w_columns[q][c]));
            let l_column: [_; ROWS] = from_fn(|r| Pack::new(simd, l_columns[r][c]));
            let mut sum: [_; ROWS] = from_fn(|r| Pack::new(simd, sums[r * vectors + c]));
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
                dots[n] = from_fn(|r| dot[n][r].sum());
            }
        }
    }
}

#[cfg(test)]
mod tests;
