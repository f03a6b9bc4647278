//! Products of rows with rows, of which as many as a cache line has numbers are added up side by side.
#![expect(
    clippy::inline_always,
    reason = "what a step is made of must become a part of the function that was compiled for the processor"
)]

use pulp::Simd;

use crate::math::Scalar;
use crate::math::vectors::Pack;

/// Room for two lots of as many lines as a line has numbers.
#[repr(align(64))]
pub(super) struct Lines<T>(pub(super) [[T; 16 * 16]; 2]);

impl<T: Scalar> Lines<T> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self([[T::zero(); 16 * 16]; 2])
    }

    /// The sums of the first lines of a lot, as many as `into` wants and no more than a line has numbers.
    #[inline(always)]
    pub(super) fn sums<S: Simd>(&self, simd: S, lot: usize, into: &mut [T]) {
        T::line_sums(simd, &self.0[lot], into);
    }

    /// `out = matrix row`, with rows of whole lines. The same on every width of vectors: lines are added up number by number.
    #[inline(always)]
    pub(super) fn product<S: Simd>(&mut self, simd: S, row: &[T], matrix: &[T], out: &mut [T]) {
        // Vectors in a line.
        let parts = T::LINE * size_of::<T>() / size_of::<T::V<S>>();
        let row_vectors = T::whole::<S>(row).0;
        let groups = matrix.chunks(T::LINE * row.len());
        for (matrix, out) in groups.zip(out.chunks_mut(T::LINE)) {
            let lines = T::whole_mut::<S>(&mut self.0[0]).0.chunks_exact_mut(parts);
            for (of, line) in matrix.chunks_exact(row.len()).zip(lines) {
                let of = &T::whole::<S>(of).0[..row_vectors.len()];
                for part in 0..parts {
                    let mut sum = Pack::<S, T>::splat(simd, T::zero());
                    for v in (part..row_vectors.len()).step_by(parts) {
                        sum = Pack::new(simd, row_vectors[v]).mul_add(Pack::new(simd, of[v]), sum);
                    }
                    line[part] = sum.v;
                }
            }
            self.sums(simd, 0, out);
        }
    }
}
