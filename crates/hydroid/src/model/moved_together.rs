//! Inputs that did not move apart in the logs of a model.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use super::Port;
use super::text::significant;
use crate::evaluate::DesignRange;
use crate::log::Trajectory;

/// Multiple correlation of an input with others from which their effects cannot be separated.
const MAX_CORRELATION: f64 = 0.999;

/// Least width of the range of a sum, relative to that of its last input.
const LEAST_WIDTH: f64 = 0.1;

/// Standard deviation of an input that is constant but for rounding, relative to its mean.
const ROUNDING: f64 = 1e-9;

/// A sum of inputs that hardly moved while they did: the effects of the inputs cannot be separated, and the model knows nothing of
/// commands for which the sum has another value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MovedTogether {
    /// Factor of each input of the model; 1 for the last one that is part of the sum, 0 for an input that is not.
    pub factors: Vec<f64>,
    /// Range of the sum.
    pub range: DesignRange,
}

impl MovedTogether {
    /// Sums of inputs that did not move in some runs: each input that others determine, by the multiple correlation (`R^2` is one less
    /// the square of the pivot of the Cholesky factor of the correlation matrix).
    pub fn of(runs: &[&Trajectory]) -> Vec<Self> {
        let Some(m) = runs.first().map(|run| run.inputs.width()) else { return Vec::new() };
        let rows = || {
            let rows = runs.iter().flat_map(|run| (0..run.len()).map(|k| run.inputs.row(k)));
            rows.filter(|row| row.iter().all(|x| x.is_finite()))
        };
        let count = rows().count().max(1) as f64;
        let mut mean = vec![0.0; m];
        rows().for_each(|row| mean.iter_mut().zip(row).for_each(|(mean, x)| *mean += x / count));
        let mut covariance = vec![0.0; m * m];
        for row in rows() {
            for i in 0..m {
                for j in 0..=i {
                    covariance[i * m + j] += (row[i] - mean[i]) * (row[j] - mean[j]) / count;
                }
            }
        }
        // Factor of the inputs that others do not determine, in rows.
        let mut factor = vec![0.0; m * m];
        let mut basis: Vec<usize> = Vec::new();
        let mut all = Vec::new();
        for b in 0..m {
            let own = covariance[b * m + b];
            if own.sqrt() <= ROUNDING * mean[b].abs() {
                continue;
            }
            for (k, &a) in basis.iter().enumerate() {
                let known: f64 = basis[..k].iter().map(|&c| factor[a * m + c] * factor[b * m + c]).sum();
                factor[b * m + a] = (covariance[b * m + a] - known) / factor[a * m + a];
            }
            let left = own - basis.iter().map(|&a| factor[b * m + a].powi(2)).sum::<f64>();
            if left > (1.0 - MAX_CORRELATION * MAX_CORRELATION) * own {
                factor[b * m + b] = left.sqrt();
                basis.push(b);
                continue;
            }
            let mut factors = vec![0.0; m];
            factors[b] = 1.0;
            for (k, &a) in basis.iter().enumerate().rev() {
                let known: f64 = basis[k + 1..].iter().map(|&c| factor[c * m + a] * factors[c]).sum();
                factors[a] = -(factor[b * m + a] + known) / factor[a * m + a];
            }
            // What adds less than rounding to the sum is not part of it.
            let part = |a: usize| factors[a].abs() * covariance[a * m + a].sqrt();
            let is_part: Vec<bool> = (0..m).map(|a| part(a) > 1e-3 * own.sqrt()).collect();
            factors.iter_mut().zip(is_part).for_each(|(factor, is_part)| *factor *= f64::from(is_part));
            let of = |row: &[f64]| row.iter().zip(&factors).map(|(x, factor)| x * factor).sum::<f64>();
            let range = |values: &mut dyn Iterator<Item = f64>| {
                values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
            };
            let [low, high] = range(&mut rows().map(of));
            let [least, most] = range(&mut rows().map(|row| row[b]));
            let half = 0.5 * (high - low).max(LEAST_WIDTH * (most - least));
            let middle = 0.5 * (low + high);
            all.push(Self { factors, range: DesignRange { low: middle - half, high: middle + half } });
        }
        all
    }

    /// The sum for a command, less the middle of its range: pulse widths make it large where nothing moves apart.
    pub fn deviation(&self, command: &[f64]) -> f64 {
        command.iter().zip(&self.factors).map(|(x, factor)| x * factor).sum::<f64>() - self.middle()
    }

    fn middle(&self) -> f64 {
        0.5 * (self.range.low + self.range.high)
    }

    /// Half of the width of the range.
    pub fn half_width(&self) -> f64 {
        0.5 * (self.range.high - self.range.low)
    }

    /// The [deviation](Self::deviation) in words: `right - 1.10 left - 0.500`. Requires the inputs of the model.
    pub fn deviation_name(&self, inputs: &[Port]) -> String {
        let (name, middle) = (self.name(inputs), self.middle());
        // What is small beside the range is not shown.
        if middle.abs() < 0.1 * self.half_width() {
            return name;
        }
        format!("{name} {} {}", if middle < 0.0 { '+' } else { '-' }, significant(middle.abs(), 3))
    }

    /// Whether it fits a model with a number of inputs.
    pub(crate) fn is_valid(&self, inputs: usize) -> bool {
        let Self { factors, range: DesignRange { low, high } } = self;
        factors.len() == inputs
            && factors.iter().any(|factor| *factor != 0.0)
            && factors.iter().all(|factor| factor.is_finite())
            && low.is_finite()
            && high.is_finite()
            && low <= high
    }

    /// The sum in words, with the names of the inputs: `n_right - 1.1 n_left`. Requires the inputs of the model.
    pub fn name(&self, inputs: &[Port]) -> String {
        let last = self.factors.iter().rposition(|factor| *factor != 0.0).unwrap_or(0);
        let mut text = inputs[last].channel.name.clone();
        for (port, factor) in
            inputs.iter().zip(&self.factors).take(last).filter(|(_, factor)| **factor != 0.0)
        {
            let (sign, size) = (if *factor < 0.0 { '-' } else { '+' }, significant(factor.abs(), 3));
            let size = if size == "1.00" { String::new() } else { format!("{size} ") };
            let _ = write!(text, " {sign} {size}{}", port.channel.name);
        }
        text
    }

    /// Names of the inputs in the sum.
    pub fn inputs<'a>(&self, inputs: &'a [Port]) -> Vec<&'a str> {
        let all = inputs.iter().zip(&self.factors).filter(|(_, factor)| **factor != 0.0);
        all.map(|(port, _)| port.channel.name.as_str()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Channel, Table};

    fn found(rows: impl Iterator<Item = [f64; 3]>) -> Vec<(String, [f64; 2])> {
        let names = ["left", "right", "rudder"];
        let channels = names.map(|name| Channel::new(name, "1"));
        let range = DesignRange { low: -1.0, high: 1.0 };
        let port = |channel: &Channel| Port {
            channel: channel.clone(),
            range,
            training_range: None,
            noise: None,
            rate_limit: None,
        };
        let ports: Vec<Port> = channels.iter().map(port).collect();
        let values: Vec<f64> = rows.flatten().collect();
        let inputs = Table::new(channels.to_vec(), values);
        let run = Trajectory {
            name: String::new(),
            t0: 0.0,
            dt: 1.0,
            outputs: inputs.clone(),
            inputs,
            truth: None,
            heading: None,
            position: None,
        };
        let all = MovedTogether::of(&[&run]);
        all.iter().map(|one| (one.name(&ports), [one.range.low, one.range.high])).collect()
    }

    #[test]
    fn an_input_that_others_determine_is_found() {
        let wave = |k: u32, f: f64| (f * f64::from(k)).sin();
        let rows = |f: &dyn Fn(u32) -> [f64; 3]| (0..500).map(f).collect::<Vec<_>>().into_iter();
        assert_eq!(found(rows(&|k| [wave(k, 0.1), wave(k, 0.13), wave(k, 0.31)])), []);
        let pair = found(rows(&|k| [wave(k, 0.1), 1.1 * wave(k, 0.1) + 0.5, wave(k, 0.31)]));
        assert_eq!(pair.len(), 1, "{pair:?}");
        assert_eq!(pair[0].0, "right - 1.10 left");
        let offset =
            MovedTogether { factors: vec![-1.1, 1.0, 0.0], range: DesignRange { low: 1380.0, high: 1420.0 } };
        assert!(offset.deviation(&[1500.0, 3050.0, 0.0]).abs() < 1e-9);
        assert!(
            (offset.deviation(&[1500.0, 3150.0, 0.0]) - 100.0).abs() < 1e-9 && offset.half_width() == 20.0
        );
        let [low, high] = pair[0].1;
        assert!(
            (low - 0.39).abs() < 0.01 && (high - 0.61).abs() < 0.01,
            "a tenth of the range of right: {pair:?}"
        );
        // A mixer: the rudder is the difference of the two, and nothing is said of pairs.
        let mixer = found(rows(&|k| {
            let (left, right) = (wave(k, 0.1), wave(k, 0.13));
            [left, right, 0.5 * left - 0.5 * right + 1e-4 * wave(k, 0.7)]
        }));
        assert_eq!(mixer.len(), 1, "{mixer:?}");
        assert_eq!(mixer[0].0, "rudder - 0.500 left + 0.500 right");
        // Constant inputs do not move together, whatever their rounding.
        assert_eq!(found(rows(&|k| [0.1 + 0.2, 0.3, wave(k, 0.1)])), []);
    }
}
