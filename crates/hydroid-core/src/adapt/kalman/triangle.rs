//! The covariance of the weights, read and written once a sample.
#![expect(
    clippy::inline_always,
    reason = "what a pass is made of must become a part of the function that was compiled for the processor"
)]

use alloc::vec::Vec;
use core::array::from_fn;
use core::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use crate::math::Scalar;
use crate::math::aligned::Aligned;
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
#[derive(Clone, Copy, Debug)]
struct Span {
    /// Where it begins, among the padded weights.
    start: usize,
    /// Number of weights.
    len: usize,
    /// With padding.
    padded: usize,
    /// Its first row among the products.
    row: usize,
}

impl Span {
    fn columns(&self) -> Range<usize> {
        self.start..self.start + self.padded
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
    /// `rank x width`; nothing, or as many rows as [`Triangle::rank`] says, of which some may be zero.
    pub(super) downdate: &'a [T],
    pub(super) scale: T,
    /// `width`.
    pub(super) noise: &'a [T],
    /// `rows x width`: row `r` has the local row `r` of each block, at the block's columns.
    pub(super) local: &'a [T],
    /// Local rows of each block.
    pub(super) rows: usize,
    /// `blocks rows x width`, overwritten for the blocks that are here.
    pub(super) products: &'a mut [T],
}

/// Vectors that are downdated by, and local rows, in one go; for more the pass is made again.
const MOST_RANK: usize = 4;
const MOST_ROWS: usize = 2;

impl<T: Scalar> Triangle<T> {
    /// Numbers in a cache line.
    pub(super) const LANES: usize = 64 / size_of::<T>();

    /// All zero. Of each block, its number of weights and the first of its rows among the products.
    pub(super) fn new(blocks: impl Iterator<Item = (usize, usize)>) -> Self {
        let (mut width, mut spans) = (0, Vec::new());
        for (len, row) in blocks {
            let padded = len.next_multiple_of(Self::LANES);
            spans.push(Span { start: width, len, padded, row });
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

    /// Columns of each block, without padding.
    pub(super) fn columns(&self) -> impl Iterator<Item = Range<usize>> {
        self.spans.iter().map(|span| span.start..span.start + span.len)
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
        let mut begin = 0;
        for span in &self.spans {
            for k in 0..span.len {
                with(span.start + k, &mut self.tiles[begin + k * span.padded + k]);
            }
            begin += span.len * (self.width - span.start);
        }
    }

    /// One pass.
    pub(super) fn pass(&mut self, pass: &mut Pass<'_, T>) {
        let width = self.width;
        let (first, rest) = pass.downdate.split_at(pass.downdate.len().min(MOST_RANK * width));
        let mut more = rest.chunks(MOST_RANK * width);
        let mut from = 0;
        let mut now = Some(first);
        loop {
            let rows = (pass.rows - from).min(MOST_ROWS);
            let downdate = now.unwrap_or(&[]);
            // Products are of what is left when all has been taken off.
            now = more.next();
            let last = now.is_none();
            let scale = if last && from + rows == pass.rows { pass.scale } else { T::one() };
            Arch::new().dispatch(Dispatch { triangle: self, pass, downdate, scale, rows: from..from + rows });
            if last {
                from += rows;
                if from == pass.rows {
                    break;
                }
            }
        }
        let noise = pass.noise;
        self.each_diagonal(|at, p| *p += noise[at]);
    }
}

/// A pass as what [`Arch`] compiles for the processor.
struct Dispatch<'a, 'b, T> {
    triangle: &'a mut Triangle<T>,
    pass: &'a mut Pass<'b, T>,
    downdate: &'a [T],
    scale: T,
    rows: Range<usize>,
}

impl<T: Scalar> WithSimd for Dispatch<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match (self.downdate.len() / self.triangle.width.max(1), self.rows.len()) {
            (0, 1) => self.tiles::<S, 0, 1>(simd),
            (0, _) => self.tiles::<S, 0, 2>(simd),
            (3, 1) => self.tiles::<S, 3, 1>(simd),
            (3, _) => self.tiles::<S, 3, 2>(simd),
            (_, 1) => self.tiles::<S, 4, 1>(simd),
            _ => self.tiles::<S, 4, 2>(simd),
        }
    }
}

impl<T: Scalar> Dispatch<'_, '_, T> {
    #[inline(always)]
    fn tiles<S: Simd, const RANK: usize, const ROWS: usize>(self, simd: S) {
        let Self { triangle, pass, downdate, scale, rows } = self;
        let width = triangle.width;
        let w = |q: usize, at: Range<usize>| &downdate[q * width..(q + 1) * width][at];
        let local = |r: usize, at: Range<usize>| &pass.local[(rows.start + r) * width..][at];
        let mut begin = 0;
        for (i, above) in triangle.spans.iter().enumerate() {
            let at = above.start..above.start + above.len;
            for (j, span) in triangle.spans.iter().enumerate().skip(i) {
                let len = above.len * span.padded;
                let mut tile = Tile::<T, RANK, ROWS> {
                    numbers: &mut triangle.tiles[begin..begin + len],
                    w_rows: from_fn(|q| w(q, at.clone())),
                    w_columns: from_fn(|q| w(q, span.columns())),
                    l_rows: from_fn(|r| local(r, at.clone())),
                    l_columns: from_fn(|r| local(r, span.columns())),
                    scale,
                };
                begin += len;
                let row = |span: &Span, r: usize| (span.row + rows.start + r) * width;
                let sums: [_; ROWS] = from_fn(|r| row(above, r) + span.start);
                if i == j {
                    tile.all::<S, false>(simd, pass.products, sums, [0; ROWS], span.padded);
                } else {
                    let mirrored = from_fn(|r| row(span, r) + above.start);
                    tile.all::<S, true>(simd, pass.products, sums, mirrored, span.padded);
                }
            }
        }
    }
}

/// A tile's part of a pass; vectors at the tile's rows and at its columns.
struct Tile<'a, T, const RANK: usize, const ROWS: usize> {
    numbers: &'a mut [T],
    w_rows: [&'a [T]; RANK],
    w_columns: [&'a [T]; RANK],
    l_rows: [&'a [T]; ROWS],
    l_columns: [&'a [T]; ROWS],
    scale: T,
}

impl<T: Scalar, const RANK: usize, const ROWS: usize> Tile<'_, T, RANK, ROWS> {
    /// All rows. `L_rows tile` goes to the products at `sums`, a tile's width each; where the tile has a mirror image,
    /// `L_columns tile'` goes to those at `mirrored`.
    #[inline(always)]
    fn all<S: Simd, const MIRROR: bool>(
        &mut self,
        simd: S,
        products: &mut [T],
        sums: [usize; ROWS],
        mirrored: [usize; ROWS],
        padded: usize,
    ) {
        for at in sums {
            products[at..at + padded].fill(T::zero());
        }
        let rows = self.numbers.len() / padded;
        let fours = rows / 4 * 4;
        for k in (0..fours).step_by(4) {
            self.some::<S, 4, MIRROR>(simd, k, products, sums, mirrored, padded);
        }
        for k in fours..rows {
            self.some::<S, 1, MIRROR>(simd, k, products, sums, mirrored, padded);
        }
    }

    /// Rows `k..k + N`. Side by side, they share the loads of the vectors at the columns.
    #[inline(always)]
    fn some<S: Simd, const N: usize, const MIRROR: bool>(
        &mut self,
        simd: S,
        k: usize,
        products: &mut [T],
        sums: [usize; ROWS],
        mirrored: [usize; ROWS],
        padded: usize,
    ) {
        let splat = |x: T| Pack::<S, T>::splat(simd, x);
        let minus_w: [[_; RANK]; N] = from_fn(|n| from_fn(|q| splat(-self.w_rows[q][k + n])));
        let l: [[_; ROWS]; N] = from_fn(|n| from_fn(|r| splat(self.l_rows[r][k + n])));
        let w_columns: [_; RANK] = self.w_columns.map(|w| T::whole::<S>(w).0);
        let l_columns: [_; ROWS] = self.l_columns.map(|l| T::whole::<S>(l).0);
        let scale = splat(self.scale);
        let mut dots = [[splat(T::zero()); ROWS]; N];
        let numbers = T::whole_mut::<S>(&mut self.numbers[k * padded..(k + N) * padded]).0;
        let vectors = numbers.len() / N;
        for c in 0..vectors {
            let w: [_; RANK] = from_fn(|q| Pack::new(simd, w_columns[q][c]));
            let l_column: [_; ROWS] = from_fn(|r| Pack::new(simd, l_columns[r][c]));
            let mut sum: [_; ROWS] =
                from_fn(|r| Pack::new(simd, T::whole::<S>(&products[sums[r]..sums[r] + padded]).0[c]));
            for n in 0..N {
                let mut p = Pack::new(simd, numbers[n * vectors + c]);
                for q in 0..RANK {
                    p = minus_w[n][q].mul_add(w[q], p);
                }
                for r in 0..ROWS {
                    sum[r] = l[n][r].mul_add(p, sum[r]);
                    if MIRROR {
                        dots[n][r] = l_column[r].mul_add(p, dots[n][r]);
                    }
                }
                numbers[n * vectors + c] = (p * scale).v;
            }
            for r in 0..ROWS {
                T::whole_mut::<S>(&mut products[sums[r]..sums[r] + padded]).0[c] = sum[r].v;
            }
        }
        if MIRROR {
            for n in 0..N {
                for r in 0..ROWS {
                    products[mirrored[r] + k + n] = dots[n][r].sum();
                }
            }
        }
    }
}
