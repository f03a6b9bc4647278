//! Choice between fits by their rollouts: the simplest one within one standard error of the best, output by output.

use hydroid_core::model::sparse::{Equations, EquationsError, Term};

use super::fit::Fit;

/// Losses of one model by block ([`Evaluation::blocks`](crate::evaluate::Evaluation::blocks)).
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct BlockLosses {
    /// Losses on the validation runs.
    pub validation: Vec<f64>,
    /// Losses on excerpts of the training runs; may be empty.
    pub training: Vec<f64>,
}

/// Mean paired difference and its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Difference {
    /// Mean of the differences.
    pub mean: f64,
    /// Its standard error.
    pub error: f64,
}

impl BlockLosses {
    /// Mean of the losses on the validation runs.
    pub(crate) fn mean(&self) -> f64 {
        self.validation.iter().sum::<f64>() / self.validation.len().max(1) as f64
    }

    /// Mean difference between these losses and others on the same blocks. The comparison is paired: the
    /// difficulty that a block has for both models cancels.
    pub(super) fn paired_difference(&self, other: &Self) -> Difference {
        let parts = [(&self.validation, &other.validation), (&self.training, &other.training)];
        let (mut mean, mut variance) = (0.0, 0.0);
        for (a, b) in parts.into_iter().filter(|(a, _)| !a.is_empty()) {
            let n = a.len() as f64;
            let of = a.iter().zip(b).map(|(a, b)| a - b);
            let average = of.clone().sum::<f64>() / n;
            mean += average;
            // A single block has no variance: every difference is significant then.
            variance += of.map(|d| (d - average).powi(2)).sum::<f64>() / (n * (n - 1.0).max(1.0));
        }
        Difference { mean, error: variance.sqrt() }
    }

    /// Whether these losses are at most one standard error larger than others (one-standard-error rule:
    /// Breiman et al., Classification and Regression Trees, 1984, section 3.4.3).
    pub(super) fn is_within_one_standard_error(&self, other: &Self) -> bool {
        let difference = self.paired_difference(other);
        difference.mean <= difference.error
    }

    /// Whether these losses are smaller than others by more than one standard error.
    pub(crate) fn is_significantly_better(&self, other: &Self) -> bool {
        let difference = self.paired_difference(other);
        difference.mean < -difference.error
    }
}

/// Equations whose row `i` is row `i` of the `i`-th fit, over the union of the terms. Outputs, inputs and signals must
/// agree.
///
/// # Errors
/// If the joint library is too large to compile.
pub(super) fn combine_equations(rows: &[&Fit]) -> Result<Fit, EquationsError> {
    let Some(first) = rows.first() else { return Err(EquationsError::Step) };
    let mut terms: Vec<Term> = Vec::new();
    for fit in rows {
        for term in fit.equations.terms() {
            if !terms.contains(term) {
                terms.push(term.clone());
            }
        }
    }
    let mut coefficients = vec![0.0; rows.len() * terms.len()];
    let mut scaled = coefficients.clone();
    let mut residual_rms = Vec::with_capacity(rows.len());
    for (i, fit) in rows.iter().enumerate() {
        let own = fit.equations.terms();
        for (j, term) in own.iter().enumerate() {
            if let Some(at) = terms.iter().position(|known| known == term) {
                coefficients[i * terms.len() + at] = fit.equations.coefficient(i, j);
                scaled[i * terms.len() + at] = fit.scaled[i * own.len() + j];
            }
        }
        residual_rms.push(fit.residual_rms[i]);
    }
    let e = &first.equations;
    let signals = e.signals().to_vec();
    let equations =
        Equations::with_signals(terms, coefficients, e.outputs(), e.inputs(), signals, e.dt(), e.substeps())?;
    Ok(Fit { equations, residual_rms, scaled })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn losses(validation: &[f64]) -> BlockLosses {
        BlockLosses { validation: validation.to_vec(), training: Vec::new() }
    }

    #[test]
    fn what_both_find_hard_is_not_noise() {
        let best = losses(&[0.1, 5.0, 0.2, 9.0]);
        let always_worse = losses(&[0.2, 5.1, 0.3, 9.1]);
        assert!(
            !always_worse.is_within_one_standard_error(&best) && best.is_significantly_better(&always_worse)
        );
        let now_and_then = losses(&[0.2, 4.9, 0.4, 8.9]);
        assert!(
            now_and_then.is_within_one_standard_error(&best) && !best.is_significantly_better(&now_and_then)
        );
        assert!(!losses(&[0.1, f64::INFINITY, 0.2, 9.0]).is_within_one_standard_error(&best));
    }

    #[test]
    fn rows_come_from_their_own_fits() {
        let fit = |terms: Vec<Term>, coefficients: Vec<f64>| Fit {
            scaled: coefficients.iter().map(|c| 10.0 * c).collect(),
            equations: Equations::new(terms, coefficients, 2, 1, 0.1, 1).unwrap(),
            residual_rms: vec![1.0, 2.0],
        };
        let a = fit(vec![Term::monomial(&[0]), Term::monomial(&[1])], vec![1.0, 2.0, 3.0, 4.0]);
        let b = fit(vec![Term::monomial(&[2]), Term::monomial(&[1])], vec![5.0, 6.0, 7.0, 8.0]);
        let both = combine_equations(&[&a, &b]).unwrap();
        let names: Vec<String> = both.equations.terms().iter().map(|t| t.name(&["x", "y", "c"])).collect();
        assert_eq!(names, ["x", "y", "c"]);
        assert_eq!(both.equations.coefficients(), [1.0, 2.0, 0.0, 0.0, 8.0, 7.0]);
        assert_eq!(both.scaled, [10.0, 20.0, 0.0, 0.0, 80.0, 70.0]);
    }
}
