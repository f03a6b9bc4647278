//! Eigenvectors of small symmetric matrices.
#![expect(
    clippy::inline_always,
    reason = "what a correction is made of must become a part of the function that was compiled for the processor"
)]

use crate::math::Scalar;

/// Sweeps at most; a handful is enough for matrices of a few dozen rows.
const SWEEPS: usize = 12;

/// `A = E' diag(a) E` by cyclic rotations (Jacobi; Golub and Van Loan, *Matrix Computations*, 4th ed., section 8.5): the
/// eigenvalues are left on the diagonal of `A`, the rows of `E` are the eigenvectors. `A` is `count x count`, both halves.
///
/// `E` is orthogonal whatever happens; what is below rounding of the trace is not rotated away.
#[inline(always)]
pub(super) fn eigenvectors<T: Scalar>(a: &mut [T], e: &mut [T], count: usize) {
    e.fill(T::zero());
    (0..count).for_each(|i| e[i * (count + 1)] = T::one());
    let trace: T = (0..count).map(|i| a[i * (count + 1)]).sum();
    let least = T::epsilon() * trace;
    for _ in 0..SWEEPS {
        let mut turned = false;
        for p in 0..count {
            for q in p + 1..count {
                if a[p * count + q].abs() > least {
                    turn(a, e, count, (p, q));
                    turned = true;
                }
            }
        }
        if !turned {
            return;
        }
    }
}

/// Rotates two rows, and columns, so that what they share is zero.
#[inline(always)]
fn turn<T: Scalar>(a: &mut [T], e: &mut [T], count: usize, (p, q): (usize, usize)) {
    let shared = a[p * count + q];
    let theta = (a[q * (count + 1)] - a[p * (count + 1)]) / (shared + shared);
    let t = theta.signum() / (theta.abs() + (theta * theta + T::one()).sqrt());
    let c = T::one() / (t * t + T::one()).sqrt();
    let s = t * c;
    let (low, high) = (a[p * (count + 1)] - t * shared, a[q * (count + 1)] + t * shared);
    for matrix in [&mut *a, e] {
        let (above, below) = matrix.split_at_mut(q * count);
        for (x, y) in above[p * count..(p + 1) * count].iter_mut().zip(&mut below[..count]) {
            (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
        }
    }
    // The columns are the rows, but for the four where they meet.
    for k in 0..count {
        a[k * count + p] = a[p * count + k];
        a[k * count + q] = a[q * count + k];
    }
    (a[p * (count + 1)], a[q * (count + 1)]) = (low, high);
    (a[p * count + q], a[q * count + p]) = (T::zero(), T::zero());
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::eigenvectors;

    /// `E` is orthogonal, and `E A E'` what is left: of a matrix with a full, a small, a double and no eigenvalue.
    #[test]
    fn what_is_left_is_the_matrix_in_its_eigenvectors() {
        let n = 7;
        let root: Vec<f64> =
            (0..4 * n).map(|k| (k as f64 * 12.9898).sin() * [1.0, 1e-3, 5.0, 5.0][k / n]).collect();
        let gram = |i: usize, j: usize| (0..4).map(|k| root[k * n + i] * root[k * n + j]).sum::<f64>();
        let given: Vec<f64> = (0..n * n).map(|k| gram(k / n, k % n)).collect();
        let (mut a, mut e) = (given.clone(), vec![0.0; n * n]);
        eigenvectors(&mut a, &mut e, n);
        for i in 0..n {
            for j in 0..n {
                let product: f64 = (0..n).map(|k| e[i * n + k] * e[j * n + k]).sum();
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-14);
                let turned: f64 = (0..n * n).map(|k| e[i * n + k / n] * given[k] * e[j * n + k % n]).sum();
                let left = if i == j { a[i * n + i] } else { 0.0 };
                assert!((turned - left).abs() < 1e-12, "{i} {j}: {turned} {left}");
            }
        }
    }
}
