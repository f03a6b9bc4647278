//! Scale of a library term over the design ranges of its variables.

use alloc::vec;

use crate::model::sparse::Term;

const POINTS: usize = 512;

/// Root mean square of a term for independent variables, uniformly distributed over their design ranges `(low,
/// high)`. With columns divided by it, a prior covariance has the same meaning for every term and log.
///
/// The mean is taken over an additive recurrence (a Kronecker sequence with the square roots of primes); its error is
/// some percent. A term that is zero or undefined everywhere has the scale 1.
pub fn rms_over_range(term: &Term, ranges: &[(f64, f64)]) -> f64 {
    let mut variables = vec![0.0; ranges.len()];
    let mut sum = 0.0;
    for point in 0..POINTS {
        for (i, (variable, (low, high))) in variables.iter_mut().zip(ranges).enumerate() {
            let fraction = fract((point as f64 + 0.5) * num_traits::Float::sqrt(prime(i)));
            *variable = low + fraction * (high - low);
        }
        let value = term.value(&variables);
        // Undefined values, such as the logarithm of a negative number, do not count.
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

fn prime(position: usize) -> f64 {
    let is_prime = |n: &u32| (2..*n).take_while(|d| d * d <= *n).all(|d| !n.is_multiple_of(d));
    (2..).filter(is_prime).nth(position).map_or(2.0, f64::from)
}
