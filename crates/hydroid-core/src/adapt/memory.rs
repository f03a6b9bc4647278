//! The memory of an adapter as a flat slice: what is written in one order is read in the same.

/// Far more samples than there ever are; what is added to it still is a count.
pub(super) const MOST_COUNTED: usize = usize::MAX / 4;

/// Writes numbers one after the other.
pub(super) struct Writer<'a>(&'a mut [f64]);

impl<'a> Writer<'a> {
    /// Fills a slice from its start.
    pub(super) fn new(into: &'a mut [f64]) -> Self {
        Self(into)
    }

    /// The next `len` numbers, to be written by the caller.
    pub(super) fn part(&mut self, len: usize) -> &'a mut [f64] {
        let (part, rest) = core::mem::take(&mut self.0).split_at_mut(len);
        self.0 = rest;
        part
    }

    pub(super) fn numbers(&mut self, numbers: &[f64]) {
        self.part(numbers.len()).copy_from_slice(numbers);
    }

    /// A count: exact up to 2^53, which no counter of samples reaches.
    pub(super) fn count(&mut self, count: usize) {
        self.part(1)[0] = count as f64;
    }

    pub(super) fn flag(&mut self, flag: bool) {
        self.count(usize::from(flag));
    }
}

/// Reads them back.
pub(super) struct Reader<'a>(&'a [f64]);

impl<'a> Reader<'a> {
    /// Reads a slice from its start.
    pub(super) fn new(from: &'a [f64]) -> Self {
        Self(from)
    }

    pub(super) fn part(&mut self, len: usize) -> &'a [f64] {
        let (part, rest) = self.0.split_at(len);
        self.0 = rest;
        part
    }

    pub(super) fn numbers(&mut self, into: &mut [f64]) {
        into.copy_from_slice(self.part(into.len()));
    }

    /// A count, of which the largest that makes sense is known: what was stored outside of the program may
    /// predict nonsense afterwards, and must not panic.
    pub(super) fn count(&mut self, most: usize) -> usize {
        // Casts saturate, and NaN is 0.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = self.part(1)[0] as usize;
        count.min(most)
    }

    pub(super) fn flag(&mut self) -> bool {
        self.count(1) == 1
    }
}
