//! Scales of library terms: over the design ranges of their variables, and over training rows.

use alloc::vec;
use alloc::vec::Vec;

use crate::model::sparse::Term;

const POINTS: usize = 512;

/// Root mean square of a term for independent variables, uniformly distributed over their design ranges `(low,
/// high)`. With columns divided by it, a prior covariance has the same meaning for every term and log.
///
/// The mean is taken over an additive recurrence (a Kronecker sequence with the square roots of primes); its error is
/// some percent. A term that is zero or undefined everywhere has the scale 1.
pub fn rms_over_range(term: &Term, ranges: &[(f64, f64)]) -> f64 {
    let mut variables = vec![0.0; ranges.len()];
    let steps: Vec<f64> = primes().map(num_traits::Float::sqrt).take(ranges.len()).collect();
    let mut sum = 0.0;
    for point in 0..POINTS {
        for ((variable, (low, high)), step) in variables.iter_mut().zip(ranges).zip(&steps) {
            let fraction = fract((point as f64 + 0.5) * step);
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

fn primes() -> impl Iterator<Item = f64> {
    let is_prime = |n: &u32| (2..*n).take_while(|d| d * d <= *n).all(|d| !n.is_multiple_of(d));
    (2_u32..).filter(is_prime).map(f64::from)
}

/// Norms of the columns of an upper triangle, and the triangle with unit columns. `None` if it is singular.
pub(super) fn unit_columns(r_factor: &[f64], terms: usize) -> Option<(Vec<f64>, Vec<f64>)> {
    if r_factor.len() != terms * terms
        || !(0..terms).all(|j| r_factor[j * terms + j] != 0.0)
        || !r_factor.iter().all(|x| x.is_finite())
    {
        return None;
    }
    if (0..terms).any(|i| r_factor[i * terms..][..i].iter().any(|x| *x != 0.0)) {
        return None;
    }
    let norm = |j: usize| {
        num_traits::Float::sqrt(
            (0..=j).map(|i| r_factor[i * terms + j] * r_factor[i * terms + j]).sum::<f64>(),
        )
    };
    let norms: Vec<f64> = (0..terms).map(norm).collect();
    // Squares can overflow and underflow.
    if !norms.iter().all(|norm| norm.is_finite() && (1.0 / norm).is_finite()) {
        return None;
    }
    let unit = r_factor.iter().enumerate().map(|(at, x)| x / norms[at % terms]).collect();
    Some((norms, unit))
}
