//! Best subset of terms by an information criterion.
//!
//! Terms of a noisy orbit are nearly collinear, so that elimination of one term after another loses true ones. For each
//! number `k` of terms, the best subsets are found by a beam search over additions and exchanges of a term. The subset
//! with the smallest extended Bayesian criterion (Chen and Chen, Biometrika 95 (2008) 759) is selected:
//!
//! ```text
//! n ln(RSS/n) + n k ln n/(n - k - 2) + 2 ln binomial(p, k)
//! ```
//!
//! for `n` independent rows, with the correction for few rows of [`super::criterion`], and `p` terms. The last part
//! accounts for the number of subsets among which the best one is found.

use std::collections::BTreeMap;

use super::qr::QrFactor;
use super::stepwise::{independent_columns, solution_on};
use super::stlsq::SparseSolution;

/// Subsets of one size that the search continues from.
const BEAM: usize = 50;

/// Terms whose part that is orthogonal to a subset is a smaller share of their square depend on it.
const DEPENDENT: f64 = 1e-12;

/// Solves one equation on the best subset of its terms. Columns `0..terms` are the library, column `target` the
/// right-hand side, with `rows` independent rows.
pub fn best_subset(plain: &QrFactor, terms: usize, target: usize, rows: f64) -> SparseSolution {
    let columns = independent_columns(plain, terms, target);
    let moments = Moments::new(plain, &columns, target);
    let support: Vec<usize> = moments.best(rows).into_iter().map(|j| columns[j]).collect();
    solution_on(plain, &support, terms, target)
}

/// Second moments of columns of unit norm and of the right-hand side.
struct Moments {
    count: usize,
    /// Of the columns, `count x count`.
    columns: Vec<f64>,
    /// Of the columns with the right-hand side.
    target: Vec<f64>,
    /// Sum of squares of the right-hand side.
    total: f64,
    /// Residual sum of squares of all columns.
    least: f64,
}

impl Moments {
    fn new(qr: &QrFactor, columns: &[usize], target: usize) -> Self {
        let order: Vec<usize> = columns.iter().copied().chain([target]).collect();
        let own = qr.select(&order);
        let count = columns.len();
        let mut scale: Vec<f64> = (0..count).map(|j| 1.0 / own.column_norm(j)).collect();
        scale.push(1.0);
        let own = own.scaled(&scale);
        let dot = |a: usize, b: usize| (0..=a.min(b)).map(|i| own.get(i, a) * own.get(i, b)).sum::<f64>();
        Self {
            count,
            columns: (0..count)
                .flat_map(|i| (0..count).map(move |j| (i, j)))
                .map(|(i, j)| dot(i, j))
                .collect(),
            target: (0..count).map(|j| dot(j, count)).collect(),
            total: dot(count, count),
            least: own.get(count, count).powi(2),
        }
    }

    /// The best subset by the criterion.
    fn best(&self, rows: f64) -> Vec<usize> {
        let mut choose = 0.0; // ln binomial(p, k)
        let mut best = (self.criterion(rows, self.total, 0, choose), Vec::new());
        let mut beam: Vec<Vec<usize>> = vec![Vec::new()];
        for k in 1..=self.count {
            choose += ((self.count - k + 1) as f64 / k as f64).ln();
            // No subset of this size or larger is better than all columns.
            if rows <= (k + 2) as f64 || self.criterion(rows, self.least, k, 0.0) >= best.0 {
                break;
            }
            let added = narrowed(beam.iter().flat_map(|subset| self.additions(subset, &[])).collect());
            let exchanged = added.iter().flat_map(|(subset, _)| {
                (0..subset.len()).flat_map(|at| {
                    let kept: Vec<usize> =
                        subset.iter().enumerate().filter(|(i, _)| *i != at).map(|(_, &j)| j).collect();
                    self.additions(&kept, &[subset[at]])
                })
            });
            let found = narrowed(added.iter().cloned().chain(exchanged).collect());
            let Some((subset, residual)) = found.first() else { break };
            let value = self.criterion(rows, *residual, k, choose);
            if value < best.0 {
                best = (value, subset.clone());
            }
            beam = found.into_iter().map(|(subset, _)| subset).collect();
        }
        best.1
    }

    fn criterion(&self, rows: f64, residual: f64, terms: usize, choose: f64) -> f64 {
        // Rounding errors of the sum of squares.
        let least = f64::EPSILON * self.total + f64::MIN_POSITIVE;
        let k = terms as f64;
        rows * (residual.max(least) / rows).ln() + rows * k * rows.ln() / (rows - k - 2.0) + 2.0 * choose
    }

    /// The subsets with one more column, in ascending order, and their residual sums of squares.
    fn additions(&self, subset: &[usize], without: &[usize]) -> Vec<(Vec<usize>, f64)> {
        let n = subset.len();
        // Rows of the Cholesky factor, and the right-hand side.
        let mut factor: Vec<Vec<f64>> = Vec::with_capacity(n);
        let mut solved: Vec<f64> = Vec::with_capacity(n);
        for &i in subset {
            let mut own = self.forward(&factor, subset, i);
            let pivot = (1.0 - own.iter().map(|x| x * x).sum::<f64>()).max(f64::MIN_POSITIVE).sqrt();
            let known: f64 = own.iter().zip(&solved).map(|(a, b)| a * b).sum();
            solved.push((self.target[i] - known) / pivot);
            own.push(pivot);
            factor.push(own);
        }
        let residual = self.total - solved.iter().map(|x| x * x).sum::<f64>();
        (0..self.count)
            .filter(|j| !subset.contains(j) && !without.contains(j))
            .filter_map(|j| {
                let own = self.forward(&factor, subset, j);
                let orthogonal = 1.0 - own.iter().map(|x| x * x).sum::<f64>();
                let known: f64 = own.iter().zip(&solved).map(|(a, b)| a * b).sum();
                let gain = (self.target[j] - known).powi(2) / orthogonal;
                (orthogonal > DEPENDENT).then(|| {
                    let mut larger = subset.to_vec();
                    larger.insert(larger.partition_point(|&i| i < j), j);
                    (larger, residual - gain)
                })
            })
            .collect()
    }

    /// The moments of column `j` with the subset, solved with the rows of the factor so far.
    fn forward(&self, factor: &[Vec<f64>], subset: &[usize], j: usize) -> Vec<f64> {
        let mut own: Vec<f64> = Vec::with_capacity(factor.len() + 1);
        for (row, &i) in factor.iter().zip(subset) {
            let known: f64 = row.iter().zip(&own).map(|(a, b)| a * b).sum();
            own.push((self.columns[i * self.count + j] - known) / row[own.len()]);
        }
        own
    }
}

/// The subsets with the smallest residuals, the best first.
fn narrowed(subsets: BTreeMap<Vec<usize>, f64>) -> Vec<(Vec<usize>, f64)> {
    let mut order: Vec<(Vec<usize>, f64)> = subsets.into_iter().collect();
    order.sort_by(|a, b| a.1.total_cmp(&b.1));
    order.truncate(BEAM);
    order
}
