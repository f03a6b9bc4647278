//! Errors of trials that were left out of the identification.

use serde::{Deserialize, Serialize};

/// Errors of predicted figures of one kind of trial, in one unit.
///
/// For each fold of the cross-validation, the model without it predicts the trials in its runs from their first samples. The
/// half-width holds the errors of nine in ten of new trials, if these differ from the trials that were left out as those differ
/// from each other: each trial has the weight `1 / (trials + 1)`, shared by its figures, and the rest lies beyond all errors
/// (Y. Lee, R. Barber and R. Willett, *Distribution-free inference with hierarchical data*, arXiv 2306.06342). Nine trials are the
/// fewest with such a half-width. With fewer, it is that of normal errors without a mean: their root mean square over trials, times
/// the quantile of Student's distribution with the number of trials as degrees of freedom.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialErrors {
    /// Kind of the trials: `turning-circle` or `zigzag`.
    pub trial: String,
    /// Unit of the figures. Angles and percentages have absolute errors, other figures relative ones.
    pub unit: String,
    /// Number of trials.
    pub trials: usize,
    /// Half-width of the interval; none if predictions did not reach too many of the measured figures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_width: Option<f64>,
}

impl TrialErrors {
    /// Level of an interval.
    pub const LEVEL: f64 = 0.9;

    /// Fewest trials with an interval of this level.
    pub const FEWEST: usize = 9;

    /// The 95 % quantiles of Student's distribution with 1 to 8 degrees of freedom.
    const STUDENT: [f64; Self::FEWEST - 1] = [6.314, 2.920, 2.353, 2.132, 2.015, 1.943, 1.895, 1.860];

    /// From the errors of each trial, infinite where the prediction did not reach a measured figure. None without a trial.
    pub(crate) fn new(trial: &str, unit: &str, errors: &[Vec<f64>]) -> Option<Self> {
        let trials = errors.len();
        let weight = 1.0 / (trials + 1) as f64;
        let share = |errors: &Vec<f64>| {
            let each = weight / errors.len() as f64;
            errors.iter().map(move |error| (*error, each)).collect::<Vec<_>>()
        };
        let mut all: Vec<(f64, f64)> = errors.iter().flat_map(share).collect();
        all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut sum = 0.0;
        // Sums of weights are exact but for rounding.
        let within = all.iter().find(|(_, weight)| {
            sum += weight;
            sum >= Self::LEVEL - 1e-9
        });
        let student = || {
            let quantile = Self::STUDENT.get(trials.checked_sub(1)?)?;
            let mean_square = all.iter().map(|(error, weight)| error * error * weight).sum::<f64>()
                / (trials as f64 * weight);
            Some(quantile * mean_square.sqrt())
        };
        let half_width = within.map(|(error, _)| *error).or_else(student)?;
        let half_width = Some(half_width).filter(|width| width.is_finite());
        Some(Self { trial: trial.to_owned(), unit: unit.to_owned(), trials, half_width })
    }

    /// Half-width about a value.
    pub fn about(&self, value: f64) -> Option<f64> {
        Some(self.half_width? * if Self::is_relative(&self.unit) { value.abs() } else { 1.0 })
    }

    /// Whether the errors of figures with a unit are relative.
    pub(crate) fn is_relative(unit: &str) -> bool {
        !matches!(unit, "deg" | "%")
    }

    pub(crate) fn is_valid(&self) -> bool {
        self.trials > 0 && self.half_width.is_none_or(|width| width.is_finite() && width >= 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_half_width_is_the_quantile_over_trials_that_differ_in_their_number_of_figures() {
        let width = |errors: &[Vec<f64>]| TrialErrors::new("zigzag", "deg", errors).unwrap().half_width;
        let trials = |n: u32| (1..=n).map(|k| vec![f64::from(k)]).collect::<Vec<_>>();
        // The ceil((n + 1) 0.9)-th of n errors.
        assert_eq!([9, 18, 19, 99].map(|n| width(&trials(n))), [9.0, 18.0, 18.0, 90.0].map(Some));
        // Of fewer than nine, 2.353 times the root mean square of 1, 2 and 3.
        assert!(
            width(&trials(3)).is_some_and(|width| (width - 2.353 * (14.0_f64 / 3.0).sqrt()).abs() < 1e-9)
        );
        // A hundred figures of one trial count as much as a single one of another.
        let mut unequal = trials(19);
        unequal[18] = vec![0.5; 100];
        assert_eq!(width(&unequal), Some(17.0));
        let mut one_not_reached = trials(19);
        one_not_reached[0] = vec![f64::INFINITY];
        assert_eq!(width(&one_not_reached), Some(19.0));
        one_not_reached.truncate(5);
        assert_eq!(width(&one_not_reached), None);
        assert_eq!(TrialErrors::new("zigzag", "deg", &[]), None);
    }

    #[test]
    fn distances_and_times_have_relative_errors_and_angles_absolute_ones() {
        let nine = vec![vec![0.1]; 9];
        let about = |unit: &str| TrialErrors::new("zigzag", unit, &nine).unwrap().about(-20.0);
        assert_eq!([about("m"), about("deg/s"), about("deg"), about("%")], [2.0, 2.0, 0.1, 0.1].map(Some));
    }
}
