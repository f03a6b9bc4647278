//! Errors of trials that were left out of the identification.

use serde::{Deserialize, Serialize};

/// Errors of a predicted figure of one kind of trial.
///
/// For each fold of the cross-validation, the model without it predicts the trials in its runs from their first samples. The
/// half-width holds the error of a new trial with a probability of 90 %, if it differs from the trials that were left out as those differ
/// from each other: of `n` errors it is the `ceil(0.9 (n + 1))`-th smallest (split conformal prediction: J. Lei, M. G'Sell, A. Rinaldo,
/// R. J. Tibshirani and L. Wasserman, *Journal of the American Statistical Association* 113 (2018) 1094). Nine trials are the fewest
/// with such a half-width. With fewer, it is that of normal errors without a mean: their root mean square times the quantile of
/// Student's distribution with the number of trials as degrees of freedom.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialErrors {
    /// Kind of the trials: `turning-circle` or `zigzag`.
    pub trial: String,
    /// Name of the figure, with its unit. Angles and percentages have absolute errors; those of other figures are the logarithms
    /// of the ratio of measured and predicted value.
    pub figure: String,
    /// Number of trials.
    pub trials: usize,
    /// Half-width of the interval; none if predictions did not reach too many of the measured figures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_width: Option<f64>,
}

impl TrialErrors {
    /// Level of an interval.
    pub const LEVEL: f64 = 0.9;

    /// The 95 % quantiles of Student's distribution with 1 to 8 degrees of freedom.
    const STUDENT: [f64; 8] = [6.314, 2.920, 2.353, 2.132, 2.015, 1.943, 1.895, 1.860];

    /// From the errors of the trials, infinite where the prediction did not reach a measured figure. None without a trial.
    pub(crate) fn new(trial: &str, figure: &str, mut errors: Vec<f64>) -> Option<Self> {
        let trials = errors.len();
        errors.sort_unstable_by(f64::total_cmp);
        let half_width = if let Some(quantile) = Self::STUDENT.get(trials.checked_sub(1)?) {
            let mean_square = errors.iter().map(|error| error * error).sum::<f64>() / trials as f64;
            quantile * mean_square.sqrt()
        } else {
            // A product such as 0.9 * 10 has a rounding error.
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most `trials`")]
            let rank = (Self::LEVEL * (trials + 1) as f64 - 1e-9).ceil() as usize;
            errors[rank.min(trials) - 1]
        };
        let half_width = Some(half_width).filter(|width| width.is_finite());
        Some(Self { trial: trial.to_owned(), figure: figure.to_owned(), trials, half_width })
    }

    /// The error of a figure with a unit: infinite if the logarithm of the ratio is not known.
    pub(crate) fn error(unit: &str, measured: f64, predicted: f64) -> f64 {
        let error = if is_absolute(unit) { measured - predicted } else { (measured / predicted).ln() };
        if error.is_finite() { error.abs() } else { f64::INFINITY }
    }

    /// The interval about a value with a unit.
    pub(crate) fn about(&self, unit: &str, value: f64) -> Option<[f64; 2]> {
        let width = self.half_width?;
        let ends = [-1.0, 1.0];
        Some(if is_absolute(unit) {
            ends.map(|end| value + end * width)
        } else {
            let [a, b] = ends.map(|end| value * (end * width).exp());
            [a.min(b), a.max(b)]
        })
    }

    pub(crate) fn is_valid(&self) -> bool {
        self.trials > 0 && self.half_width.is_none_or(|width| width.is_finite() && width >= 0.0)
    }
}

fn is_absolute(unit: &str) -> bool {
    matches!(unit, "deg" | "%")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_half_width_is_the_conformal_quantile_or_that_of_few_normal_errors() {
        let width = |errors: Vec<f64>| TrialErrors::new("zigzag", "reach_s", errors).unwrap().half_width;
        let trials = |n: u32| (1..=n).map(f64::from).collect::<Vec<_>>();
        assert_eq!([9, 18, 19, 99].map(|n| width(trials(n))), [9.0, 18.0, 18.0, 90.0].map(Some));
        assert!(width(trials(3)).is_some_and(|width| (width - 2.353 * (14.0_f64 / 3.0).sqrt()).abs() < 1e-9));
        let mut one_not_reached = trials(19);
        one_not_reached[0] = f64::INFINITY;
        assert_eq!(width(one_not_reached.clone()), Some(19.0));
        one_not_reached.truncate(5);
        assert_eq!(width(one_not_reached), None);
        assert_eq!(TrialErrors::new("zigzag", "reach_s", Vec::new()), None);
    }

    #[test]
    fn distances_and_times_keep_their_sign_and_angles_have_absolute_errors() {
        let errors = TrialErrors::new("zigzag", "reach_s", vec![2.0_f64.ln(); 9]).unwrap();
        for (value, [low, high]) in [(20.0, [10.0, 40.0]), (-20.0, [-40.0, -10.0])] {
            let about = errors.about("s", value).unwrap();
            assert!((about[0] - low).abs() + (about[1] - high).abs() < 1e-9, "{about:?}");
        }
        assert_eq!(errors.about("deg", 0.0), Some([-2.0_f64.ln(), 2.0_f64.ln()]));
        assert!((TrialErrors::error("m", 30.0, 15.0) - 2.0_f64.ln()).abs() < 1e-12);
        assert_eq!(
            [("m", 1.0, -1.0), ("s", 0.0, 1.0)].map(|(u, m, p)| TrialErrors::error(u, m, p)),
            [f64::INFINITY; 2]
        );
        assert_eq!(TrialErrors::error("deg", 3.0, 5.0), 2.0);
    }
}
