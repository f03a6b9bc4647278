//! Stepwise selection by an information criterion: Akaike (AIC) or Bayesian information criterion (BIC).
//!
//! A model with `k` terms and the residual sum of squares `RSS` on `n` independent rows has the criterion
//!
//! ```text
//! n ln RSS + p k n/(n - k - s)
//! ```
//!
//! and the smallest value is the best: `p = 2`, `s = 1` is Akaike's criterion with the correction of Hurvich and Tsai
//! (Biometrika 76 (1989) 297); `p = ln n`, `s = 2` is Schwarz's criterion with the correction of `McQuarrie` (Statist.
//! Probab. Lett. 44 (1999) 79), without which libraries that are not small compared with `n` are overfitted. The
//! criterion gives the tolerance of [`super::stepwise`] as a function of `n` and `k`.

use serde::{Deserialize, Serialize};

use super::qr::QrFactor;
use super::stepwise::{NEGLIGIBLE, eliminate, independent_columns, solution_on};
use super::stlsq::SparseSolution;

/// The information criterion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// Akaike's criterion (AIC): asymptotically the best prediction; it keeps about one irrelevant term in six.
    Aic,
    /// Schwarz's criterion (BIC): consistent selection, if the true terms are in the library.
    Bic,
}

impl Criterion {
    /// Relative decrease of the residual sum of squares that the last of `terms` terms must achieve on `rows`
    /// independent rows ([`super::RegressionForm::effective_rows`]).
    pub fn tolerance(self, rows: f64, terms: usize) -> f64 {
        let (each, slack) = match self {
            Self::Aic => (2.0, 1.0),
            Self::Bic => (rows.ln(), 2.0),
        };
        let penalty = |k: f64| each * k / (rows - k - slack);
        let k = terms as f64;
        if rows - k - slack <= 0.0 { f64::INFINITY } else { (penalty(k) - penalty(k - 1.0)).exp_m1() }
    }
}

/// Solves one equation as `stepwise` on `rows` independent rows; removed terms may return.
pub fn stepwise_bidirectional(
    ridged: &QrFactor,
    terms: usize,
    target: usize,
    criterion: Criterion,
    rows: f64,
) -> SparseSolution {
    let tolerance = |k| criterion.tolerance(rows, k);
    let all = independent_columns(ridged, terms, target);
    let total = ridged.column_norm(target).powi(2);
    let mut support = all.clone();
    // Bounded: rounding could repeat a removal and an addition for ever.
    for _ in 0..2 * all.len() {
        eliminate(ridged, &mut support, target, tolerance);
        let outside: Vec<usize> = all.iter().copied().filter(|j| !support.contains(j)).collect();
        let Some((best, gain, residual)) = best_addition(ridged, &support, &outside, target) else { break };
        let worth = tolerance(support.len() + 1) * (residual - gain) + NEGLIGIBLE * total;
        // The tolerance is NaN if there are too few rows.
        if gain <= worth || worth.is_nan() {
            break;
        }
        support.push(best);
        support.sort_unstable();
    }
    solution_on(ridged, &support, terms, target)
}

/// The term with the largest decrease of the residual sum of squares, the decrease, and the current sum.
fn best_addition(
    qr: &QrFactor,
    support: &[usize],
    outside: &[usize],
    target: usize,
) -> Option<(usize, f64, f64)> {
    // The rows below the support contain the part that is orthogonal to it.
    let order: Vec<usize> = support.iter().chain(outside).copied().chain([target]).collect();
    let own = qr.select(&order);
    let below = support.len()..order.len();
    let dot = |a: usize, b: usize| below.clone().map(|row| own.get(row, a) * own.get(row, b)).sum::<f64>();
    let last = order.len() - 1;
    let residual = dot(last, last);
    (support.len()..last)
        .map(|j| (order[j], dot(j, last).powi(2) / dot(j, j).max(f64::MIN_POSITIVE), residual))
        .max_by(|a, b| a.1.total_cmp(&b.1))
}
