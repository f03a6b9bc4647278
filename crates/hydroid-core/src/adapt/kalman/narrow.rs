//! Tiles so narrow that all that a row of them meets stays in registers.
#![expect(
    clippy::inline_always,
    reason = "what a pass is made of must become a part of the function that was compiled for the processor"
)]

use core::array::from_fn;

use pulp::Simd;

use super::lines::Lines;
use super::triangle::{Pass, Span};
use crate::math::Scalar;
use crate::math::vectors::Pack;

/// A tile, and the blocks that it stands between.
pub(super) struct Pair<'a, T, const RANK: usize, const ROWS: usize> {
    pub(super) above: &'a Span,
    pub(super) span: &'a Span,
    pub(super) mirror: bool,
    pub(super) scale: T,
    pub(super) numbers: &'a mut [T],
    pub(super) downdate: &'a [T],
}

impl<T: Scalar, const RANK: usize, const ROWS: usize> Pair<'_, T, RANK, ROWS> {
    /// Its part of a pass, if there are loops for tiles of this width.
    #[inline(always)]
    pub(super) fn pass<S: Simd>(self, simd: S, pass: &mut Pass<'_, T>, lines: &mut Lines<T>) -> bool {
        let (lanes, span) = (T::LINE, self.span);
        let split = span.split.unwrap_or(span.len);
        let (head, tail) = (split.div_ceil(lanes), span.len.div_ceil(lanes) - split / lanes);
        let tail = if ROWS == 1 || split == span.len { 0 } else { tail };
        match (span.padded / lanes, head, tail) {
            (1, _, 0) => self.runs::<S, 1, 1, 0>(simd, pass, lines),
            (2, _, 0) => self.runs::<S, 2, 2, 0>(simd, pass, lines),
            (3, _, 0) => self.runs::<S, 3, 3, 0>(simd, pass, lines),
            (4, _, 0) => self.runs::<S, 4, 4, 0>(simd, pass, lines),
            (5, _, 0) => self.runs::<S, 5, 5, 0>(simd, pass, lines),
            (2, ..=2, 1) if ROWS == 2 => self.runs::<S, 2, 2, 1>(simd, pass, lines),
            (3, ..=3, ..=2) if ROWS == 2 => self.runs::<S, 3, 3, 2>(simd, pass, lines),
            (4, ..=3, ..=2) if ROWS == 2 => self.runs::<S, 4, 3, 2>(simd, pass, lines),
            (5, ..=4, ..=2) if ROWS == 2 => self.runs::<S, 5, 4, 2>(simd, pass, lines),
            _ => return false,
        }
        true
    }

    /// The rows that work through the first local row, and those that do through the second.
    #[inline(always)]
    fn runs<S: Simd, const VECTORS: usize, const HEAD: usize, const TAIL: usize>(
        self,
        simd: S,
        pass: &mut Pass<'_, T>,
        lines: &mut Lines<T>,
    ) {
        let Self { above, span, mirror, scale, numbers, downdate } = self;
        let split = above.split.unwrap_or(above.len);
        let (first, second) = numbers.split_at_mut(split * span.padded);
        let (last, all_rows) = (pass.rows - 1, pass.all_rows);
        for (r, numbers, weights) in [(0, first, 0..split), (1, second, split..above.len)] {
            if weights.is_empty() {
                continue;
            }
            let run = Run::<T, RANK> {
                numbers,
                w_rows: from_fn(|q| &above.row_of(downdate, pass.rank, q)[weights.clone()]),
                w_columns: from_fn(|q| span.row_of(downdate, pass.rank, q)),
                l_rows: &above.row_of(pass.local, pass.rows, r)[weights.clone()],
                l_columns: [0, last].map(|r| span.row_of(pass.local, pass.rows, r)),
                scale,
                mirror,
            };
            let sums = span.panel(all_rows).start + (above.row + r) * span.padded;
            let dots =
                [0, 1].map(|r| above.panel(all_rows).start + (span.row + r) * above.padded + weights.start);
            run.pass::<S, VECTORS, HEAD, TAIL>(simd, pass.products, sums, dots, lines);
        }
    }
}

/// Some rows of a tile, all of which work through one local row, and what a [`Pass`](super::triangle::Pass) does with them.
struct Run<'a, T, const RANK: usize> {
    /// Of the tile.
    numbers: &'a mut [T],
    /// What the downdate has at these rows, and at the tile's columns.
    w_rows: [&'a [T]; RANK],
    w_columns: [&'a [T]; RANK],
    /// The local row of these rows, and those of the columns, of which the second may be all zero.
    l_rows: &'a [T],
    l_columns: [&'a [T]; 2],
    scale: T,
    /// Whether the tile has a mirror image.
    mirror: bool,
}

impl<T: Scalar, const RANK: usize> Run<'_, T, RANK> {
    /// `VECTORS` to a row, of which the first `HEAD` meet the columns' first local row, and the last `TAIL` the second.
    /// `l_rows tile` goes to the products at `sums`; if the tile has a mirror image, `l_columns tile'` to those at `dots`.
    #[inline(always)]
    fn pass<S: Simd, const VECTORS: usize, const HEAD: usize, const TAIL: usize>(
        self,
        simd: S,
        products: &mut [T],
        sums: usize,
        dots: [usize; 2],
        lines: &mut Lines<T>,
    ) {
        let lanes = T::LINE;
        let width = VECTORS * lanes;
        let rows = self.numbers.len() / width;
        let zero = Pack::<S, T>::splat(simd, T::zero());
        // Loops, no closures: those would be compiled without the vectors.
        let mut w = [[zero; VECTORS]; RANK];
        for q in 0..RANK {
            let columns = &T::whole::<S>(self.w_columns[q]).0[..VECTORS];
            for v in 0..VECTORS {
                w[q][v] = -Pack::new(simd, columns[v]);
            }
        }
        let mut l = [[zero; VECTORS]; 2];
        for r in 0..2 {
            let columns = &T::whole::<S>(self.l_columns[r]).0[..VECTORS];
            for v in 0..VECTORS {
                l[r][v] = Pack::new(simd, columns[v]);
            }
        }
        let scale = Pack::<S, T>::splat(simd, self.scale);
        let mut sum = [zero; VECTORS];
        let w_rows = self.w_rows.map(|w| &w[..rows]);
        let l_rows = &self.l_rows[..rows];
        let mut k = 0;
        for group in self.numbers.chunks_mut(lanes * width) {
            let first = k;
            let [head, tail] = lines.0.each_mut().map(|lines| T::whole_mut::<S>(lines).0);
            let both = head.iter_mut().zip(tail);
            for (row, (head, tail)) in group.chunks_exact_mut(width).zip(both) {
                let row = &mut T::whole_mut::<S>(row).0[..VECTORS];
                let l_k = Pack::splat(simd, l_rows[k]);
                let mut w_k = [zero; RANK];
                for q in 0..RANK {
                    w_k[q] = Pack::splat(simd, w_rows[q][k]);
                }
                let mut dot = [zero; 2];
                for v in 0..VECTORS {
                    let mut p = Pack::new(simd, row[v]);
                    for q in 0..RANK {
                        p = w_k[q].mul_add(w[q][v], p);
                    }
                    sum[v] = l_k.mul_add(p, sum[v]);
                    if v < HEAD {
                        dot[0] = l[0][v].mul_add(p, dot[0]);
                    }
                    if v + TAIL >= VECTORS {
                        dot[1] = l[1][v].mul_add(p, dot[1]);
                    }
                    row[v] = (p * scale).v;
                }
                *head = dot[0].v;
                if TAIL > 0 {
                    *tail = dot[1].v;
                }
                k += 1;
            }
            if self.mirror {
                for lot in 0..if TAIL > 0 { 2 } else { 1 } {
                    lines.sums(simd, lot, &mut products[dots[lot] + first..dots[lot] + k]);
                }
            }
        }
        let into = &mut T::whole_mut::<S>(&mut products[sums..sums + width]).0[..VECTORS];
        for v in 0..VECTORS {
            into[v] = sum[v].v;
        }
    }
}
