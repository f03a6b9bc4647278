//! Slices as sequences of vectors, the last of which may be partial.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use core::ops::Range;

use pulp::Simd;

use super::vectors::{Pack, Vectors};

#[derive(Clone, Copy)]
pub(crate) struct Read<'a, S: Simd, T: Vectors> {
    simd: S,
    whole: &'a [T::V<S>],
    rest: &'a [T],
}

impl<'a, S: Simd, T: Vectors> Read<'a, S, T> {
    #[inline(always)]
    pub(crate) fn new(simd: S, x: &'a [T]) -> Self {
        let (whole, rest) = T::whole::<S>(x);
        Self { simd, whole, rest }
    }

    /// Vector `k`, filled up with zeros beyond the end of the slice.
    #[inline(always)]
    pub(crate) fn get(self, k: usize) -> Pack<S, T> {
        let v = match self.whole.get(k) {
            Some(&v) => v,
            None => T::load_part(self.simd, self.rest),
        };
        Pack::new(self.simd, v)
    }
}

pub(crate) struct Write<'a, S: Simd, T: Vectors> {
    simd: S,
    whole: &'a mut [T::V<S>],
    rest: &'a mut [T],
}

impl<'a, S: Simd, T: Vectors> Write<'a, S, T> {
    #[inline(always)]
    pub(crate) fn new(simd: S, x: &'a mut [T]) -> Self {
        let (whole, rest) = T::whole_mut::<S>(x);
        Self { simd, whole, rest }
    }

    #[inline(always)]
    pub(crate) fn get(&self, k: usize) -> Pack<S, T> {
        Read { simd: self.simd, whole: self.whole, rest: self.rest }.get(k)
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, k: usize, x: Pack<S, T>) {
        match self.whole.get_mut(k) {
            Some(v) => *v = x.v,
            None => T::store_part(self.simd, self.rest, x.v),
        }
    }
}

/// The vectors of a slice of `len` numbers, for a loop: closures would not be compiled for the processor's vectors.
#[inline(always)]
pub(crate) fn vectors<S: Simd, T: Vectors>(len: usize) -> Range<usize> {
    0..len.div_ceil(size_of::<T::V<S>>() / size_of::<T>())
}
