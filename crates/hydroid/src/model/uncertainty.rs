//! Standard errors and correlations of the coefficients of equations, from the members of a bootstrap.

use serde::Serialize;

use super::{Model, NamedEquations};

/// Magnitude of a correlation above which two coefficients are only determined together.
const STRONG_CORRELATION: f64 = 0.9;

/// Deviations of the members below this share of the largest value are rounding errors.
const ROUNDING: f64 = 1e-12;

/// Uncertainty of the non-zero coefficients of one equation `dy/dt = sum_j xi_j theta_j`, from `B` bootstrap members
/// `xi_j^b` (block bootstrap: Künsch, Ann. Statist. 17 (1989) 1217; standard error: Efron and Tibshirani, An
/// Introduction to the Bootstrap (1993), chapter 6).
///
/// A member without a term has the coefficient 0, so that the uncertainty of the selection of terms is included. The
/// result is conditional on the settings of the search (library, lags, gate, regression, ridge). It is too small if
/// residuals are correlated over longer times than a block of the bootstrap.
#[derive(Clone, Debug, PartialEq)]
pub struct CoefficientUncertainty {
    /// Indices of the terms with a non-zero coefficient, ascending.
    pub terms: Vec<usize>,
    /// Standard error of the coefficient of each of these terms, in the unit of the coefficient:
    /// `sqrt(sum_b (xi_j^b - mean_j)^2 / (B - 1))`. `None` if all members agree, because a constraint fixes the
    /// coefficient or because no member contains the term.
    pub standard_errors: Vec<Option<f64>>,
    /// Correlation matrix of the coefficients of these terms, with ones on its diagonal; 0 beside a coefficient without
    /// a standard error.
    pub correlation: Vec<Vec<f64>>,
}

/// Correlation of the coefficients of an equation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NamedCorrelation {
    /// Output of the equation.
    pub output: String,
    /// Its terms with a non-zero coefficient.
    pub terms: Vec<String>,
    /// Correlation matrix of their coefficients.
    pub matrix: Vec<Vec<f64>>,
}

impl CoefficientUncertainty {
    /// Pairs of terms whose coefficients have a correlation of magnitude above 0.9, with this correlation. Such
    /// coefficients are only determined together.
    pub fn strongly_correlated(&self) -> Vec<(usize, usize, f64)> {
        let pairs = (0..self.terms.len()).flat_map(|i| (0..i).map(move |j| (j, i)));
        let correlated = pairs.map(|(j, i)| (self.terms[j], self.terms[i], self.correlation[j][i]));
        correlated.filter(|(_, _, correlation)| correlation.abs() > STRONG_CORRELATION).collect()
    }
}

impl NamedEquations<'_> {
    /// Uncertainty of the coefficients of each equation, in the order of the outputs; see
    /// [`Model::coefficient_uncertainty`].
    pub fn coefficient_uncertainty(&self) -> Option<Vec<CoefficientUncertainty>> {
        let equations = self.equations;
        let members = self.members.filter(|members| members.len() > 1)?;
        let count = equations.terms().len();
        let of = |output: usize| {
            let terms: Vec<usize> =
                (0..count).filter(|&term| equations.coefficient(output, term) != 0.0).collect();
            let deviations: Vec<_> =
                terms.iter().map(|term| deviations(&members.values_at(output * count + term))).collect();
            let correlation = |i: usize, j: usize| match (&deviations[i], &deviations[j]) {
                _ if i == j => 1.0,
                (Some((_, a)), Some((_, b))) => {
                    a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>().clamp(-1.0, 1.0)
                }
                _ => 0.0,
            };
            let row = |i: usize| (0..terms.len()).map(|j| correlation(i, j)).collect();
            CoefficientUncertainty {
                standard_errors: deviations.iter().map(|of| of.as_ref().map(|(error, _)| *error)).collect(),
                correlation: (0..terms.len()).map(row).collect(),
                terms,
            }
        };
        Some((0..equations.outputs()).map(of).collect())
    }

    /// Standard error of the sum of all coefficients, `outputs x terms`, times weights: that of the sums of the members, which
    /// contains all correlations. `None` without an ensemble, or if all members agree.
    pub fn standard_error_of_sum(&self, weights: &[f64]) -> Option<f64> {
        let members = self.members.filter(|members| members.len() > 1)?;
        let mut sums = vec![0.0; members.len()];
        for (place, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
            let values = members.values_at(place);
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
        }
        deviations(&sums).map(|(error, _)| error)
    }

    /// Correlation matrix of the coefficients of each equation; see [`Model::coefficient_uncertainty`].
    pub fn correlations(&self) -> Option<Vec<NamedCorrelation>> {
        let names = self.variable_names();
        let term = |&j: &usize| self.equations.terms()[j].name(&names);
        let named = |(output, of): (&String, CoefficientUncertainty)| NamedCorrelation {
            output: output.clone(),
            terms: of.terms.iter().map(term).collect(),
            matrix: of.correlation,
        };
        Some(names.iter().zip(self.coefficient_uncertainty()?).map(named).collect())
    }
}

impl Model {
    /// Standard errors and correlations of the coefficients of each equation, in the order of the outputs.
    ///
    /// `None` if the model is not equations of motion, has fewer than two bootstrap members, or learns along a run.
    pub fn coefficient_uncertainty(&self) -> Option<Vec<CoefficientUncertainty>> {
        self.equations()?.coefficient_uncertainty()
    }
}

/// Sample standard deviation, and the deviations from the mean scaled to unit norm; none for equal values.
fn deviations(values: &[f64]) -> Option<(f64, Vec<f64>)> {
    let largest = values.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let scaled: Vec<f64> = values.iter().map(|x| x / largest).collect();
    let mean = scaled.iter().sum::<f64>() / values.len() as f64;
    let norm = scaled.iter().map(|x| (x - mean).powi(2)).sum::<f64>().sqrt();
    let error = (largest * (norm / (values.len() as f64 - 1.0).sqrt())).min(f64::MAX);
    // The comparison is false for the NaN of zeros only.
    (norm > ROUNDING).then(|| (error, scaled.iter().map(|x| (x - mean) / norm).collect()))
}

/// A value and its standard error, without a common factor `10^power`. The standard error has two significant digits,
/// and the value ends at the same decimal place: `-0.412`, `0.013`, power 0.
pub(super) fn rounded(value: f64, error: f64) -> (String, String, i32) {
    let last_place = exponent(&format!("{error:.1e}")) - 1;
    let first_place = exponent(&format!("{:.1e}", value.abs().max(error)));
    let power = if last_place > 0 || !(-4..5).contains(&first_place) { first_place } else { 0 };
    let decimals = usize::try_from(power - last_place).unwrap_or(0);
    let digits = |x: f64| {
        let text = format!("{x:e}");
        let mantissa = text.split('e').next().unwrap_or_default();
        let scaled = format!("{mantissa}e{}", exponent(&text) - power).parse().unwrap_or(x);
        let text = format!("{scaled:.decimals$}");
        let is_zero = !text.bytes().any(|byte| (b'1'..=b'9').contains(&byte));
        if is_zero { text.trim_start_matches('-').to_owned() } else { text }
    };
    (digits(value), digits(error), power)
}

fn exponent(text: &str) -> i32 {
    text.split_once('e').and_then(|(_, power)| power.parse().ok()).unwrap_or(0)
}
