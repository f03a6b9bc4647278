//! The size of a term, from the ranges of its variables.

use alloc::vec;

use crate::model::sparse::Term;

/// Points at which a term is evaluated.
const POINTS: usize = 512;

/// Root mean square of a term where its variables, independently, take all values of their ranges
/// `(low, high)` alike: what the term's column in a regression is scaled by. It needs the design ranges in a
/// model file and nothing else, so that a covariance means the same on every log.
///
/// The mean is over an additive recurrence (a Kronecker sequence with the square roots of primes), good to
/// some percent, which is more than a scale needs. A term that is zero or undefined all over has the scale 1.
pub fn rms_over_range(term: &Term, ranges: &[(f64, f64)]) -> f64 {
    let mut variables = vec![0.0; ranges.len()];
    let mut sum = 0.0;
    for point in 0..POINTS {
        for (i, (variable, (low, high))) in variables.iter_mut().zip(ranges).enumerate() {
            let fraction = fract((point as f64 + 0.5) * num_traits::Float::sqrt(prime(i)));
            *variable = low + fraction * (high - low);
        }
        let value = term.value(&variables);
        // Where a term is undefined (the logarithm of a negative) it has no size.
        if value.is_finite() {
            sum += value * value;
        }
    }
    let rms = num_traits::Float::sqrt(sum / POINTS as f64);
    if rms > 0.0 && rms.is_finite() { rms } else { 1.0 }
}

fn fract(x: f64) -> f64 {
    num_traits::Float::fract(x)
}

/// The prime number at a position, counted from 0.
fn prime(position: usize) -> f64 {
    let is_prime = |n: &u32| (2..*n).take_while(|d| d * d <= *n).all(|d| !n.is_multiple_of(d));
    (2..).filter(is_prime).nth(position).map_or(2.0, f64::from)
}
