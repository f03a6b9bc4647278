//! Slices aligned to cache lines.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::{Deref, DerefMut};

use crate::math::Scalar;

/// Bytes of a cache line and of the widest vector. A load within a cache line is twice as fast as one across two.
const LINE: usize = 64;

#[derive(Debug)]
pub(crate) struct Aligned<T> {
    numbers: Vec<T>,
    begin: usize,
    len: usize,
}

impl<T: Scalar> Aligned<T> {
    pub(crate) fn zeros(len: usize) -> Self {
        let numbers = vec![T::zero(); len + LINE / size_of::<T>()];
        Self { begin: begin(&numbers), numbers, len }
    }

    /// Changes the length, up to the initial length; the content is arbitrary.
    pub(crate) fn set_len(&mut self, len: usize) {
        assert!(self.begin + len <= self.numbers.len(), "longer than at construction");
        self.len = len;
    }
}

fn begin<T>(numbers: &[T]) -> usize {
    // An unknown offset only costs speed.
    numbers.as_ptr().align_offset(LINE).min(LINE / size_of::<T>())
}

impl<T: Clone> Clone for Aligned<T> {
    fn clone(&self) -> Self {
        // The clone has another address, hence another offset.
        let mut numbers = self.numbers.clone();
        let begin = begin(&numbers);
        numbers[begin..begin + self.len].clone_from_slice(self);
        Self { numbers, begin, len: self.len }
    }
}

impl<T> Deref for Aligned<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.numbers[self.begin..self.begin + self.len]
    }
}

impl<T> DerefMut for Aligned<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.numbers[self.begin..self.begin + self.len]
    }
}
