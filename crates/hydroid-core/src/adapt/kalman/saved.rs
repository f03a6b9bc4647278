//! A filter's memory as a flat slice.

use super::filter::Filter;
use super::learnable::Learnable;
use crate::adapt::memory::{Reader, Writer};
use crate::math::Scalar;

fn write<T: Scalar>(writer: &mut Writer<'_>, numbers: &[T]) {
    for (into, &x) in writer.part(numbers.len()).iter_mut().zip(numbers) {
        *into = x.wide();
    }
}

fn read<T: Scalar>(reader: &mut Reader<'_>, into: &mut [T]) {
    let from = reader.part(into.len());
    for (into, &x) in into.iter_mut().zip(from) {
        *into = T::of(x);
    }
}

impl<T: Scalar, M: Learnable<T>> Filter<T, M> {
    /// How many numbers [`save`](Self::save) gives.
    pub fn memory_len(&self) -> usize {
        3 + self.state.len()
            + self.weights.len()
            + self.noise.len()
            + self.joint.parts().iter().map(|part| part.len()).sum::<usize>()
    }

    /// Copies all that it goes on from.
    ///
    /// # Panics
    /// If `into` has not [`memory_len`](Self::memory_len) numbers.
    pub fn save(&self, into: &mut [f64]) {
        assert_eq!(into.len(), self.memory_len(), "a memory of another length");
        let mut writer = Writer::new(into);
        for flag in [self.joint.pending(), self.moved, self.learns] {
            writer.flag(flag);
        }
        for numbers in [&self.state, &self.weights, &self.noise] {
            write(&mut writer, numbers);
        }
        for numbers in self.joint.parts() {
            write(&mut writer, numbers);
        }
    }

    /// Puts back what a filter of the same model and tuning saved; both go on to the same last bit.
    ///
    /// # Panics
    /// If `from` has not [`memory_len`](Self::memory_len) numbers.
    pub fn load(&mut self, from: &[f64]) {
        assert_eq!(from.len(), self.memory_len(), "a memory of another length");
        let mut reader = Reader::new(from);
        self.joint.set_pending(reader.flag());
        for flag in [&mut self.moved, &mut self.learns] {
            *flag = reader.flag();
        }
        for numbers in [&mut self.state, &mut self.weights, &mut self.noise] {
            read(&mut reader, numbers);
        }
        for numbers in self.joint.parts_mut() {
            read(&mut reader, numbers);
        }
        self.model.admit(&mut self.weights);
        self.model.set_weights(&self.weights);
    }
}
