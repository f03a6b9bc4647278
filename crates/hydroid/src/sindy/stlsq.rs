//! Sequentially thresholded least squares (Brunton, Proctor, Kutz, PNAS 113 (2016) 3932).

use super::qr::QrFactor;

/// Maximum number of rounds of solving and thresholding.
const MAX_ROUNDS: usize = 20;

/// Coefficients of one equation and what became of the terms.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseSolution {
    /// One coefficient for each term.
    pub coefficients: Vec<f64>,
    /// Terms that the data cannot tell from the others, to rounding; they were left out.
    pub dependent: Vec<usize>,
    /// 2-norm of the residual; with the penalty, where the coefficients are those of a ridge.
    pub residual: f64,
}

/// Solves one equation: columns `0..terms` of the factors are the library, column `target` is the
/// right-hand side. `ridged` is `plain` with the ridge of the options folded in
/// ([`QrFactor::with_ridge`]), made once for all equations and thresholds.
pub fn stlsq(
    plain: &QrFactor,
    ridged: &QrFactor,
    terms: usize,
    target: usize,
    threshold: f64,
) -> SparseSolution {
    let mut support: Vec<usize> = (0..terms).filter(|&j| plain.column_norm(j) > 0.0).collect();
    let mut dependent = Vec::new();
    for _ in 0..MAX_ROUNDS {
        let solution = ridged.solve(&support, target);
        dependent.extend(solution.dependent.iter().map(|&position| support[position]));
        let kept: Vec<usize> = support
            .iter()
            .zip(&solution.coefficients)
            .filter(|(_, c)| c.abs() >= threshold && **c != 0.0)
            .map(|(&j, _)| j)
            .collect();
        let settled = kept.len() == support.len();
        support = kept;
        if settled {
            break;
        }
    }
    let solution = plain.solve(&support, target);
    let mut coefficients = vec![0.0; terms];
    for (&j, &c) in support.iter().zip(&solution.coefficients) {
        coefficients[j] = c;
    }
    dependent.extend(solution.dependent.iter().map(|&position| support[position]));
    dependent.sort_unstable();
    dependent.dedup();
    SparseSolution { coefficients, dependent, residual: solution.residual }
}
