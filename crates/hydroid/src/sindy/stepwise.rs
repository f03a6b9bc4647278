//! Backward elimination of terms.
//!
//! Removing term `k` raises the (ridge-penalised) residual sum of squares by `x_k^2 / W_kk`, where `x` are the
//! coefficients and `W` is the inverse of the normal matrix (F-to-remove statistic: Draper and Smith, Applied
//! Regression Analysis, 3rd ed. 1998, section 15.2).

use super::qr::QrFactor;
use super::stlsq::SparseSolution;

/// Terms that explain less of the right-hand side are removed: discretisation error of the derivative without noise.
pub(super) const NEGLIGIBLE: f64 = 1e-5;

/// The inverse is recomputed if cancellation reduces an element below this share of its initial value.
const CANCELLED: f64 = 1e-6;

/// Removes terms until each removal would raise the residual sum of squares by more than the fraction `tolerance`.
/// Columns `0..terms` are the library, column `target` the right-hand side.
pub fn stepwise(ridged: &QrFactor, terms: usize, target: usize, tolerance: f64) -> SparseSolution {
    let mut support = independent_columns(ridged, terms, target);
    eliminate(ridged, &mut support, target, |_| tolerance);
    solution_on(ridged, &support, terms, target)
}

/// Removes terms from a support without dependent columns. The tolerance may depend on the number of terms.
pub(super) fn eliminate(
    ridged: &QrFactor,
    support: &mut Vec<usize>,
    target: usize,
    tolerance: impl Fn(usize) -> f64,
) {
    let total = ridged.column_norm(target).powi(2);
    let mut residual = ridged.solve(support, target).residual.powi(2);
    let (mut inverse, mut x) = inverse_and_solution(ridged, support, target);
    // Diagonal of the inverse when it was last computed from the factor.
    let mut fresh: Vec<f64> = diagonal(&inverse, support.len()).collect();
    loop {
        let n = support.len();
        let rise = |k: usize| x[k] * x[k] / inverse[k * n + k];
        let Some(weakest) = (0..n).min_by(|&a, &b| rise(a).total_cmp(&rise(b))) else { break };
        let cost = rise(weakest);
        if cost > tolerance(n) * residual + NEGLIGIBLE * total {
            break;
        }
        // Schur complements remove the weakest term; cancellation is large if it is nearly collinear with another one.
        let pivot = inverse[weakest * n + weakest];
        let others: Vec<usize> = (0..n).filter(|&k| k != weakest).collect();
        x = others.iter().map(|&k| x[k] - inverse[k * n + weakest] * x[weakest] / pivot).collect();
        inverse = others
            .iter()
            .flat_map(|&i| others.iter().map(move |&j| (i, j)))
            .map(|(i, j)| inverse[i * n + j] - inverse[i * n + weakest] * inverse[weakest * n + j] / pivot)
            .collect();
        residual += cost;
        support.remove(weakest);
        fresh.remove(weakest);
        if fresh.iter().zip(diagonal(&inverse, n - 1)).any(|(fresh, now)| now <= CANCELLED * fresh) {
            (inverse, x) = inverse_and_solution(ridged, support, target);
            fresh = diagonal(&inverse, n - 1).collect();
            residual = ridged.solve(support, target).residual.powi(2);
        }
    }
}

pub(super) fn solution_on(qr: &QrFactor, support: &[usize], terms: usize, target: usize) -> SparseSolution {
    let solution = qr.solve(support, target);
    let mut coefficients = vec![0.0; terms];
    for (&j, &c) in support.iter().zip(&solution.coefficients) {
        coefficients[j] = c;
    }
    SparseSolution { coefficients, residual: solution.residual }
}

/// The columns among `0..terms` that are neither zero nor dependent on earlier ones.
pub(super) fn independent_columns(qr: &QrFactor, terms: usize, target: usize) -> Vec<usize> {
    let present: Vec<usize> = (0..terms).filter(|&j| qr.column_norm(j) > 0.0).collect();
    let dependent = qr.solve(&present, target).dependent;
    present.iter().enumerate().filter(|(i, _)| !dependent.contains(i)).map(|(_, &j)| j).collect()
}

fn diagonal(matrix: &[f64], n: usize) -> impl Iterator<Item = f64> + '_ {
    matrix.iter().step_by(n + 1).copied()
}

/// Inverse of the normal matrix of some columns, row by row, and the least-squares coefficients.
fn inverse_and_solution(qr: &QrFactor, columns: &[usize], target: usize) -> (Vec<f64>, Vec<f64>) {
    let n = columns.len();
    let selected: Vec<usize> = columns.iter().copied().chain([target]).collect();
    let own = qr.select(&selected);
    let mut r_inverse = vec![0.0; n * n];
    for j in 0..n {
        r_inverse[j * n + j] = 1.0 / own.get(j, j);
        for i in (0..j).rev() {
            let sum: f64 = (i + 1..=j).map(|k| own.get(i, k) * r_inverse[k * n + j]).sum();
            r_inverse[i * n + j] = -sum / own.get(i, i);
        }
    }
    let row = |i: usize| &r_inverse[i * n..(i + 1) * n];
    let mut inverse = vec![0.0; n * n];
    for i in 0..n {
        for j in i..n {
            let value = row(i)[j..].iter().zip(&row(j)[j..]).map(|(a, b)| a * b).sum();
            inverse[i * n + j] = value;
            inverse[j * n + i] = value;
        }
    }
    let x = (0..n).map(|i| (i..n).map(|k| row(i)[k] * own.get(k, n)).sum()).collect();
    (inverse, x)
}
