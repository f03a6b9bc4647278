//! Loss over several outputs.

use hydroid_core::model::recurrent::Scaling;

use super::TrainOptions;

/// Lower limit of an error relative to the largest one: a vanishing error would dominate the gradient.
const FLOOR: f64 = 1e-3;

/// Sum of squared errors of an output in scaled units, and their number.
pub(super) type Sums = [f64; 2];

/// Loss and its quadratic approximation.
///
/// ```text
/// L      = sum over outputs i:  (N_i / N) w_i e_i,      e_i^2 = 1/N_i sum ((y_i - measured_i) / s_i)^2
/// dL     = sum over outputs i:  w_i / (2 e_i) d(1/N sum ((y_i - measured_i) / s_i)^2)
/// ```
///
/// Over an epoch the training minimizes the sum of squares with `w_i b_i` in place of `w_i / (2 e_i)`. The balance
/// `b_i` is `1 / e_i` of the previous epoch, normalized to a mean of 1 so that gradient clipping keeps its meaning; it
/// is 1 in the first epoch.
#[derive(Clone, Debug)]
pub(super) struct Loss {
    /// `w_i`.
    given: Vec<f64>,
    /// A scaled unit squared, in variances of the output.
    unit: Vec<f64>,
}

impl Loss {
    pub(super) fn new(options: &TrainOptions, scaling: &Scaling, deviations: &[f64]) -> Self {
        let given = |c: usize| options.channel_weights.get(c).copied().unwrap_or(1.0);
        let units = scaling.output_scale.iter().zip(deviations);
        Self {
            given: (0..deviations.len()).map(given).collect(),
            unit: units.map(|(scale, deviation)| (scale / deviation).powi(2)).collect(),
        }
    }

    pub(super) fn even(&self) -> Vec<f64> {
        vec![1.0; self.given.len()]
    }

    /// Weight of each output's squared error in scaled units.
    pub(super) fn weights(&self, balance: &[f64]) -> Vec<f64> {
        self.given.iter().zip(&self.unit).zip(balance).map(|((w, unit), b)| w * unit * b).collect()
    }

    /// `e_i`; NaN for an output that was not measured.
    fn errors(&self, sums: &[Sums]) -> Vec<f64> {
        sums.iter().zip(&self.unit).map(|([square, count], unit)| (unit * square / count).sqrt()).collect()
    }

    /// `L` of an epoch.
    pub(super) fn value(&self, sums: &[Sums]) -> f64 {
        let all: f64 = sums.iter().map(|[_, count]| count).sum();
        let parts = self.errors(sums).into_iter().zip(sums).zip(&self.given);
        let measured = parts.filter(|((_, [_, count]), _)| *count > 0.0);
        measured.map(|((error, [_, count]), w)| count / all * w * error).sum()
    }

    /// Updates the balance after an epoch; unchanged if a sum is not finite or all errors are zero.
    pub(super) fn rebalance(&self, sums: &[Sums], balance: &mut [f64]) {
        let errors = self.errors(sums);
        let counts = |i: usize| sums[i][1] > 0.0 && self.given[i] > 0.0;
        let counted: Vec<usize> = (0..sums.len()).filter(|&i| counts(i)).collect();
        let largest = counted.iter().map(|&i| errors[i]).fold(0.0, f64::max);
        if !counted.iter().all(|&i| errors[i].is_finite()) || largest <= 0.0 {
            return;
        }
        let floored = |i: usize| 1.0 / errors[i].max(FLOOR * largest);
        let mean = counted.iter().map(|&i| floored(i)).sum::<f64>() / counted.len() as f64;
        for &i in &counted {
            balance[i] = floored(i) / mean;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loss(channel_weights: Vec<f64>) -> Loss {
        let scaling = Scaling {
            output_mean: vec![0.0; 3],
            output_scale: vec![2.0, 1.0, 1.0],
            input_mean: Vec::new(),
            input_scale: Vec::new(),
            correction_scale: vec![1.0; 3],
        };
        Loss::new(&TrainOptions { channel_weights, ..TrainOptions::default() }, &scaling, &[1.0, 1.0, 0.5])
    }

    /// Errors of 0.2, 0.1 and 0.4 standard deviations.
    const SUMS: [Sums; 3] = [[0.01 * 50.0, 50.0], [0.01 * 50.0, 50.0], [0.04 * 100.0, 100.0]];

    #[test]
    fn the_loss_is_a_mean_of_root_mean_squares() {
        assert!((loss(vec![]).value(&SUMS) - (0.25 * 0.2 + 0.25 * 0.1 + 0.5 * 0.4)).abs() < 1e-15);
        assert!((loss(vec![4.0, 0.0, 1.0]).value(&SUMS) - (0.2 + 0.2)).abs() < 1e-15);
        let [a, _, c] = SUMS;
        assert!((loss(vec![]).value(&[a, [0.0, 0.0], c]) - (0.2 / 3.0 + 0.8 / 3.0)).abs() < 1e-15);
    }

    #[test]
    fn the_balance_makes_the_gradient_that_of_the_loss() {
        let loss = loss(vec![3.0, 1.0, 0.5]);
        let mut balance = loss.even();
        loss.rebalance(&SUMS, &mut balance);
        assert!((balance.iter().sum::<f64>() - 3.0).abs() < 1e-14);
        let (weights, all) = (loss.weights(&balance), 200.0);
        // Derivatives of the loss and of its approximation by a sum of squares, up to a common factor.
        let ratios: Vec<f64> = (0..3)
            .map(|i| {
                let mut sums = [SUMS, SUMS];
                let step = 1e-6 * SUMS[i][0];
                sums[0][i][0] += step;
                sums[1][i][0] -= step;
                let difference = (loss.value(&sums[0]) - loss.value(&sums[1])) / (2.0 * step);
                difference / (weights[i] / all)
            })
            .collect();
        assert!(ratios.iter().all(|ratio| (ratio / ratios[0] - 1.0).abs() < 1e-8), "{ratios:?}");
    }

    #[test]
    fn what_is_met_exactly_does_not_take_all() {
        let (loss, mut balance) = (loss(vec![]), vec![1.0; 3]);
        let [a, b, c] = SUMS;
        loss.rebalance(&[a, [0.0, 50.0], c], &mut balance);
        assert!((balance[1] / balance[2] - 1e3).abs() < 1e-9, "{balance:?}");
        let before = balance.clone();
        loss.rebalance(&[a, [f64::NAN, 50.0], c], &mut balance);
        loss.rebalance(&[[0.0, 50.0]; 3], &mut balance);
        assert_eq!(balance, before);
        loss.rebalance(&[a, b, [0.0, 0.0]], &mut balance);
        assert!((balance[1] / balance[0] - 2.0).abs() < 1e-14 && balance[2] == before[2]);
    }
}
