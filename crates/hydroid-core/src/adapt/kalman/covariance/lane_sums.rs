//! Inner products of rows, with one partial sum for each number of a cache line.
#![expect(
    clippy::inline_always,
    reason = "the parts of a kernel must be inlined into the function that is compiled for the processor's vectors"
)]

use pulp::Simd;

use crate::math::vectors::{Pack, Vectors};

const LINE: usize = f64::LINE;

/// Two sets of partial sums, one cache line for each inner product.
#[repr(align(64))]
pub(super) struct LaneSums([f64; LINE * LINE]);

impl LaneSums {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self([0.0; LINE * LINE])
    }

    /// `out = matrix row`, with rows of whole lines. The result does not depend on the width of the vectors.
    #[inline(always)]
    pub(super) fn product<S: Simd>(&mut self, simd: S, row: &[f64], matrix: &[f64], out: &mut [f64]) {
        let parts = LINE * size_of::<f64>() / size_of::<<f64 as Vectors>::V<S>>();
        let row_vectors = f64::whole::<S>(row).0;
        let groups = matrix.chunks(LINE * row.len());
        for (matrix, out) in groups.zip(out.chunks_mut(LINE)) {
            let lines = f64::whole_mut::<S>(&mut self.0).0.chunks_exact_mut(parts);
            for (of, line) in matrix.chunks_exact(row.len()).zip(lines) {
                let of = &f64::whole::<S>(of).0[..row_vectors.len()];
                for part in 0..parts {
                    let mut sum = Pack::<S, f64>::splat(simd, 0.0);
                    for v in (part..row_vectors.len()).step_by(parts) {
                        sum = Pack::new(simd, row_vectors[v]).mul_add(Pack::new(simd, of[v]), sum);
                    }
                    line[part] = sum.v;
                }
            }
            f64::line_sums(simd, &self.0, out);
        }
    }
}
