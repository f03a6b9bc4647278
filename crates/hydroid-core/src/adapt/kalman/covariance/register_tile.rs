//! Tiles of at most five vectors a row, whose vectors and sums stay in registers.
//!
//! The kernels run where a register holds a whole cache line (AVX-512) and the downdate has rank 3.
#![expect(
    clippy::inline_always,
    reason = "the parts of a kernel must be inlined into the function that is compiled for the processor's vectors"
)]

use core::array::from_fn;

use pulp::Simd;

use super::lane_sums::LaneSums;
use super::packed::{Block, FusedUpdate};
use crate::math::vectors::{Pack, Vectors};

/// A tile, and the blocks of its rows (`above`) and of its columns (`block`).
pub(super) struct RegisterTile<'a, const RANK: usize, const ROWS: usize> {
    pub(super) above: &'a Block,
    pub(super) block: &'a Block,
    pub(super) mirror: bool,
    pub(super) scale: f64,
    pub(super) numbers: &'a mut [f64],
    pub(super) downdate: &'a [f64],
}

impl<const RANK: usize, const ROWS: usize> RegisterTile<'_, RANK, ROWS> {
    /// Updates the tile, if there is a kernel for tiles of this width.
    #[inline(always)]
    pub(super) fn update<S: Simd>(
        self,
        simd: S,
        update: &mut FusedUpdate<'_>,
        lane_sums: &mut LaneSums,
    ) -> bool {
        let (lanes, block) = (f64::LINE, self.block);
        let split = block.split.unwrap_or(block.len);
        let (head, tail) = (split.div_ceil(lanes), block.len.div_ceil(lanes) - split / lanes);
        let tail = if ROWS == 1 || split == block.len { 0 } else { tail };
        match (block.padded / lanes, head, tail) {
            (1, _, 0) => self.rows::<S, 1, 1, 0>(simd, update, lane_sums),
            (2, _, 0) => self.rows::<S, 2, 2, 0>(simd, update, lane_sums),
            (3, _, 0) => self.rows::<S, 3, 3, 0>(simd, update, lane_sums),
            (4, _, 0) => self.rows::<S, 4, 4, 0>(simd, update, lane_sums),
            (5, _, 0) => self.rows::<S, 5, 5, 0>(simd, update, lane_sums),
            (2, ..=2, 1) if ROWS == 2 => self.rows::<S, 2, 2, 1>(simd, update, lane_sums),
            (3, ..=3, ..=2) if ROWS == 2 => self.rows::<S, 3, 3, 2>(simd, update, lane_sums),
            (4, ..=3, ..=2) if ROWS == 2 => self.rows::<S, 4, 3, 2>(simd, update, lane_sums),
            (5, ..=4, ..=2) if ROWS == 2 => self.rows::<S, 5, 4, 2>(simd, update, lane_sums),
            _ => return false,
        }
        true
    }

    /// The rows of the weights that act through the first local row, then those that act through the second.
    #[inline(always)]
    fn rows<S: Simd, const VECTORS: usize, const HEAD: usize, const TAIL: usize>(
        self,
        simd: S,
        update: &mut FusedUpdate<'_>,
        lane_sums: &mut LaneSums,
    ) {
        let Self { above, block, mirror, scale, numbers, downdate } = self;
        let split = above.split.unwrap_or(above.len);
        let (first, second) = numbers.split_at_mut(split * block.padded);
        let (last, all_rows) = (update.rows - 1, update.all_rows);
        for (r, numbers, weights) in [(0, first, 0..split), (1, second, split..above.len)] {
            if weights.is_empty() {
                continue;
            }
            let rows = RegisterRows::<RANK> {
                numbers,
                w_rows: from_fn(|q| &above.row_of(downdate, update.rank, q)[weights.clone()]),
                w_columns: from_fn(|q| block.row_of(downdate, update.rank, q)),
                l_rows: &above.row_of(update.local, update.rows, r)[weights.clone()],
                l_columns: [0, last].map(|r| block.row_of(update.local, update.rows, r)),
                scale,
                mirror,
            };
            let sums = block.panel(all_rows).start + (above.row + r) * block.padded;
            let dots =
                [0, 1].map(|r| above.panel(all_rows).start + (block.row + r) * above.padded + weights.start);
            rows.update::<S, VECTORS, HEAD, TAIL>(simd, update.products, sums, dots, lane_sums);
        }
    }
}

/// Rows of a tile whose weights all act through one local row.
struct RegisterRows<'a, const RANK: usize> {
    numbers: &'a mut [f64],
    /// The downdate vectors at these rows, and at the columns of the tile.
    w_rows: [&'a [f64]; RANK],
    w_columns: [&'a [f64]; RANK],
    /// The local row of these rows, and the local rows of the columns, of which the second may be zero.
    l_rows: &'a [f64],
    l_columns: [&'a [f64]; 2],
    scale: f64,
    /// Whether the tile has a mirror image.
    mirror: bool,
}

impl<const RANK: usize> RegisterRows<'_, RANK> {
    /// A row has `VECTORS` vectors: the first `HEAD` are multiplied by the first local row of the columns, the last `TAIL` by
    /// the second. `l_rows tile` is written to the products at `sums`; if the tile has a mirror image, `l_columns tile'` to
    /// those at `dots`.
    #[inline(always)]
    fn update<S: Simd, const VECTORS: usize, const HEAD: usize, const TAIL: usize>(
        self,
        simd: S,
        products: &mut [f64],
        sums: usize,
        dots: [usize; 2],
        lane_sums: &mut LaneSums,
    ) {
        let lanes = f64::LINE;
        let width = VECTORS * lanes;
        let rows = self.numbers.len() / width;
        let zero = Pack::<S, f64>::splat(simd, 0.0);
        // Loops instead of closures: a closure is compiled without the vectors of the processor.
        let mut w = [[zero; VECTORS]; RANK];
        for q in 0..RANK {
            let columns = &f64::whole::<S>(self.w_columns[q]).0[..VECTORS];
            for v in 0..VECTORS {
                w[q][v] = -Pack::new(simd, columns[v]);
            }
        }
        let mut l = [[zero; VECTORS]; 2];
        for r in 0..2 {
            let columns = &f64::whole::<S>(self.l_columns[r]).0[..VECTORS];
            for v in 0..VECTORS {
                l[r][v] = Pack::new(simd, columns[v]);
            }
        }
        let scale = Pack::<S, f64>::splat(simd, self.scale);
        let mut sum = [zero; VECTORS];
        let w_rows = self.w_rows.map(|w| &w[..rows]);
        let l_rows = &self.l_rows[..rows];
        let mut k = 0;
        for group in self.numbers.chunks_mut(lanes * width) {
            let first = k;
            let [head, tail] = lane_sums.0.each_mut().map(|lines| f64::whole_mut::<S>(lines).0);
            let both = head.iter_mut().zip(tail);
            for (row, (head, tail)) in group.chunks_exact_mut(width).zip(both) {
                let row = &mut f64::whole_mut::<S>(row).0[..VECTORS];
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
                    lane_sums.sums(simd, lot, &mut products[dots[lot] + first..dots[lot] + k]);
                }
            }
        }
        let into = &mut f64::whole_mut::<S>(&mut products[sums..sums + width]).0[..VECTORS];
        for v in 0..VECTORS {
            into[v] = sum[v].v;
        }
    }
}
