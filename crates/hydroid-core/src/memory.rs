//! The numbers of a state in a fixed order, to save and restore it.

use alloc::vec;
use alloc::vec::Vec;

use crate::predict::Predictor;

/// Upper limit of stored counters; an increment does not overflow.
pub(crate) const MOST_COUNTED: usize = usize::MAX / 4;

const TOO_FEW: &str = "as many numbers as the state has";

/// Counts, saves or loads the numbers of a state. The state calls the methods with its parts, always as many numbers and
/// in the same order.
///
/// Other numbers than saved ones do not cause a panic, too few do.
#[derive(Debug)]
pub enum Memory<'a> {
    /// Number of numbers so far.
    Counting(usize),
    /// Room for the further numbers.
    Saving(&'a mut [f64]),
    /// Further saved numbers.
    Loading(&'a [f64]),
}

impl Memory<'_> {
    /// Number of numbers of a state.
    pub fn len_of(visit: impl FnOnce(&mut Memory<'_>)) -> usize {
        let mut memory = Memory::Counting(0);
        visit(&mut memory);
        if let Memory::Counting(len) = memory { len } else { 0 }
    }

    /// The numbers of a state. Allocates.
    pub fn saved(mut visit: impl FnMut(&mut Memory<'_>)) -> Vec<f64> {
        let mut numbers = vec![0.0; Self::len_of(&mut visit)];
        visit(&mut Memory::Saving(&mut numbers));
        numbers
    }

    /// Whether the state is being restored.
    pub const fn is_loading(&self) -> bool {
        matches!(self, Self::Loading(_))
    }

    /// Numbers.
    pub fn numbers(&mut self, numbers: &mut [f64]) {
        let len = numbers.len();
        match self {
            Self::Counting(count) => *count += len,
            Self::Saving(rest) => rest.split_off_mut(..len).expect(TOO_FEW).copy_from_slice(numbers),
            Self::Loading(rest) => numbers.copy_from_slice(rest.split_off(..len).expect(TOO_FEW)),
        }
    }

    /// The snapshot of a session.
    pub fn session(&mut self, session: &mut (impl Predictor + ?Sized)) {
        let len = session.snapshot_len();
        match self {
            Self::Counting(count) => *count += len,
            Self::Saving(rest) => session.snapshot(rest.split_off_mut(..len).expect(TOO_FEW)),
            Self::Loading(rest) => session.restore(rest.split_off(..len).expect(TOO_FEW)),
        }
    }

    /// A number.
    pub fn number(&mut self, number: &mut f64) {
        self.numbers(core::slice::from_mut(number));
    }

    /// A counter; exact up to 2^53. A loaded one is limited to `most`, so that a damaged state cannot cause a panic.
    pub fn count(&mut self, count: &mut usize, most: usize) {
        let mut number = *count as f64;
        self.number(&mut number);
        if self.is_loading() {
            // Casts saturate, and NaN is 0.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let whole = number as usize;
            *count = whole.min(most);
        }
    }

    /// A flag, as 0 or 1.
    pub fn flag(&mut self, flag: &mut bool) {
        let mut count = usize::from(*flag);
        self.count(&mut count, 1);
        *flag = count == 1;
    }
}
