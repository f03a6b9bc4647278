//! State of an adapter as a flat slice, read in the order of writing.

/// Upper limit of stored counters; an increment does not overflow.
pub(crate) const MOST_COUNTED: usize = usize::MAX / 4;

pub(crate) struct Writer<'a>(&'a mut [f64]);

impl<'a> Writer<'a> {
    pub(crate) fn new(into: &'a mut [f64]) -> Self {
        Self(into)
    }

    pub(crate) fn part(&mut self, len: usize) -> &'a mut [f64] {
        let (part, rest) = core::mem::take(&mut self.0).split_at_mut(len);
        self.0 = rest;
        part
    }

    pub(crate) fn numbers(&mut self, numbers: &[f64]) {
        self.part(numbers.len()).copy_from_slice(numbers);
    }

    /// Writes a counter; exact up to 2^53.
    pub(crate) fn count(&mut self, count: usize) {
        self.part(1)[0] = count as f64;
    }

    pub(crate) fn flag(&mut self, flag: bool) {
        self.count(usize::from(flag));
    }
}

pub(crate) struct Reader<'a>(&'a [f64]);

impl<'a> Reader<'a> {
    pub(crate) fn new(from: &'a [f64]) -> Self {
        Self(from)
    }

    pub(crate) fn part(&mut self, len: usize) -> &'a [f64] {
        let (part, rest) = self.0.split_at(len);
        self.0 = rest;
        part
    }

    pub(crate) fn numbers(&mut self, into: &mut [f64]) {
        into.copy_from_slice(self.part(into.len()));
    }

    /// Reads a counter and limits it to `most`, so that a damaged state cannot cause a panic.
    pub(crate) fn count(&mut self, most: usize) -> usize {
        // Casts saturate, and NaN is 0.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = self.part(1)[0] as usize;
        count.min(most)
    }

    pub(crate) fn flag(&mut self) -> bool {
        self.count(1) == 1
    }
}
