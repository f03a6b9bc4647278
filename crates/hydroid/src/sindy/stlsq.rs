//! Sequentially thresholded least squares (STLSQ; Brunton, Proctor, Kutz, PNAS 113 (2016) 3932).

use super::qr::QrFactor;
use super::stepwise::solution_on;

const MAX_ROUNDS: usize = 20;

/// Sparse coefficients of one equation.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseSolution {
    /// One coefficient for each term.
    pub coefficients: Vec<f64>,
    /// 2-norm of the residual, including the ridge penalty if there is one.
    pub residual: f64,
}

/// Alternates least squares and thresholding until the support is stable. Columns `0..terms` are the scaled library,
/// column `target` the right-hand side; the ridge of `ridged` acts on the selection only.
pub fn stlsq(
    plain: &QrFactor,
    ridged: &QrFactor,
    terms: usize,
    target: usize,
    threshold: f64,
) -> SparseSolution {
    let mut support: Vec<usize> = (0..terms).filter(|&j| plain.column_norm(j) > 0.0).collect();
    for _ in 0..MAX_ROUNDS {
        let solution = ridged.solve(&support, target);
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
    solution_on(plain, &support, terms, target)
}
