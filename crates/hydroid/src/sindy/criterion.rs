//! Stepwise selection by an information criterion.
//!
//! Of `n` independent rows, a model with `k` terms and residual sum of squares `RSS` scores
//!
//! ```text
//! n ln RSS + p k n/(n - k - s)
//! ```
//!
//! and less is better: `p = 2`, `s = 1` is Akaike's criterion as Hurvich and Tsai corrected it (Biometrika 76
//! (1989) 297), `p = ln n`, `s = 2` Schwarz's as corrected by `McQuarrie` (Statist. Probab. Lett. 44 (1999) 79). Without the
//! correction a library that is not small beside `n` fits the noise so well that every junk term seems to
//! matter. Leaving `k - 1` terms for `k` must pay in `RSS`: the criterion is a tolerance of
//! [`super::stepwise`] that knows how much the data can say.

use serde::{Deserialize, Serialize};

use super::qr::QrFactor;
use super::stepwise::{NEGLIGIBLE, eliminate, independent_columns, solution_on};
use super::stlsq::SparseSolution;

/// What a term must be worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// Akaike's: the model that predicts best among many nearly right ones; keeps a junk term in six.
    Aic,
    /// Schwarz's: the right model, where it is in the library and the data are many.
    Bic,
}

impl Criterion {
    /// Fraction of what remains that the last of `terms` terms must explain among `rows` independent rows
    /// ([`super::RegressionForm::effective_rows`]); infinite where there are too few rows for so many terms.
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

/// Solves one equation from so many independent rows as [`super::stepwise`] does, and lets terms that left come back where the departure
/// of others has made them worth it, until neither happens.
pub fn stepwise_bidirectional(
    ridged: &QrFactor,
    terms: usize,
    target: usize,
    criterion: Criterion,
    rows: f64,
) -> SparseSolution {
    let tolerance = |k| criterion.tolerance(rows, k);
    let (all, dependent) = independent_columns(ridged, terms, target);
    let total = ridged.column_norm(target).powi(2);
    let mut support = all.clone();
    // Rounding may make a term go and come for ever; each has its turn twice.
    for _ in 0..2 * all.len() {
        eliminate(ridged, &mut support, target, tolerance);
        let outside: Vec<usize> = all.iter().copied().filter(|j| !support.contains(j)).collect();
        let Some((best, gain, residual)) = best_addition(ridged, &support, &outside, target) else { break };
        let worth = tolerance(support.len() + 1) * (residual - gain) + NEGLIGIBLE * total;
        // Nor where there are too few rows to say.
        if gain <= worth || worth.is_nan() {
            break;
        }
        support.push(best);
        support.sort_unstable();
    }
    solution_on(ridged, &support, dependent, terms, target)
}

/// The term that lowers the residual sum of squares most, by how much, and the present sum.
fn best_addition(
    qr: &QrFactor,
    support: &[usize],
    outside: &[usize],
    target: usize,
) -> Option<(usize, f64, f64)> {
    // Below the rows of the support stands what is orthogonal to it.
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
