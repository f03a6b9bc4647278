//! Positions that repeat to the last digit.

use hydroid_core::memory::Memory;

/// Shortest time without a change after which a position is stuck \[s\].
const STUCK_S: f64 = 3.0;
const CHANGES: f64 = 4.0;

/// Longest time between changes that counts as usual \[s\], and the share of the newest one in the mean.
const LONGEST_S: f64 = 5.0;
const NEWEST: f64 = 0.2;

/// Times between the changes of a position. A receiver that freezes repeats its last fix to the last digit, which noise does not
/// let a working one do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeats {
    values: [f64; 2],
    /// Time since the last change, and usual time between changes \[s\].
    same_s: f64,
    usual_s: f64,
}

impl Default for Repeats {
    fn default() -> Self {
        Self { values: [f64::NAN; 2], same_s: 0.0, usual_s: 1.0 }
    }
}

impl Repeats {
    /// Time passes \[s\] to a measured position. True if it has changed.
    pub fn take(&mut self, elapsed_s: f64, values: [f64; 2]) -> bool {
        let lasted = self.same_s + elapsed_s.max(0.0);
        if values == self.values {
            self.same_s = lasted;
            return false;
        }
        if self.values.iter().all(|x| x.is_finite()) {
            self.usual_s += NEWEST * (lasted.min(LONGEST_S) - self.usual_s);
        }
        (self.values, self.same_s) = (values, 0.0);
        true
    }

    /// Time without a change \[s\], if the position is stuck under commands that have pushed the vessel for a time \[s\].
    pub fn stuck_s(&self, pushing_s: f64) -> Option<f64> {
        let same_s = self.same_s.min(pushing_s);
        (same_s > STUCK_S.max(CHANGES * self.usual_s)).then_some(same_s)
    }

    /// Visits all numbers of the state.
    pub fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.numbers(&mut self.values);
        memory.number(&mut self.same_s);
        memory.number(&mut self.usual_s);
    }
}
