//! Prediction bands from the errors on runs that were left out.
//!
//! The half-width of a band at a horizon is the `ceil((n + 1) p)`-th smallest of the `n` absolute errors at this horizon
//! (split conformal prediction: Lei, G'Sell, Rinaldo, Tibshirani and Wasserman, *Journal of the American Statistical
//! Association* 113 (2018) 1094). Windows of a run are alike and runs differ, so that `p` is not the level `q` of the band
//! itself: it is chosen such that bands from all runs but one hold the share `q` of the measurements of this run, in the
//! mean over runs, outputs and horizons. If a new run differs from the runs that were left out as they differ from each
//! other, the band holds about the share `q` of its measurements.

use serde::{Deserialize, Serialize};

use super::Evaluation;

/// Half-width of the 80 % band of a normal distribution \[standard deviations\].
pub const BAND_80: f64 = 1.281_55;

/// Levels of the bands.
const LEVELS: [f64; 3] = [0.5, 0.8, 0.9];

/// Largest number of horizons with a band.
const HORIZONS: usize = 24;

/// Longest horizon \[samples\].
const LONGEST: usize = 1_000_000;

/// Half-widths of prediction bands about a prediction, by level, horizon and output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PredictionBands {
    /// Levels, in ascending order.
    pub levels: Vec<f64>,
    /// Horizons \[samples\], in ascending order.
    pub horizons: Vec<usize>,
    /// Half-widths in the unit of the output: `half_widths[level][horizon][output]`.
    pub half_widths: Vec<Vec<Vec<f64>>>,
}

/// Share of the measurements inside prediction bands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PredictionCoverage {
    /// Levels of the bands.
    pub levels: Vec<f64>,
    /// Horizons \[samples\].
    pub horizons: Vec<usize>,
    /// `share[level][horizon][output]`; NaN without a measurement, `null` in JSON.
    pub share: Vec<Vec<Vec<f64>>>,
}

impl PredictionBands {
    /// Horizons with a band: 1, and evenly spaced ones up to the longest, among them its quarters.
    pub fn horizons(longest: usize) -> Vec<usize> {
        let mut horizons = vec![1];
        horizons.extend((1..=HORIZONS).map(|i| (longest * i / HORIZONS).max(1)));
        horizons.dedup();
        horizons
    }

    /// Bands from the errors of an evaluation at its [`errors_at`](super::Options::errors_at). `None` if there are no
    /// horizons, one is longer than a million samples, or an output has no errors at one of them.
    pub fn new(evaluation: &Evaluation) -> Option<Self> {
        let outputs = evaluation.channels.len();
        let quantiles = quantiles(evaluation);
        let mut half_widths = vec![Vec::new(); LEVELS.len()];
        for errors in evaluation.errors.chunks_exact(outputs) {
            let mut rows = vec![Vec::with_capacity(outputs); LEVELS.len()];
            for errors in errors {
                let mut sizes: Vec<f32> = errors.iter().copied().filter(|error| error.is_finite()).collect();
                if sizes.is_empty() {
                    return None;
                }
                sizes.sort_unstable_by(f32::total_cmp);
                for (row, level) in rows.iter_mut().zip(quantiles) {
                    row.push(f64::from(sizes[rank(level, sizes.len())]));
                }
            }
            half_widths.iter_mut().zip(rows).for_each(|(all, row)| all.push(row));
        }
        let horizons = evaluation.errors_at.clone();
        let bounded = horizons.last().is_some_and(|last| *last <= LONGEST);
        bounded.then(|| Self { levels: LEVELS.to_vec(), horizons, half_widths })
    }

    /// Half-width at a level (by index), horizon and output: linear between horizons with a band, NaN beyond the last.
    pub fn half_width(&self, level: usize, horizon: usize, output: usize) -> f64 {
        let at = |i: usize| self.half_widths[level][i][output];
        match self.horizons.iter().position(|&known| known >= horizon) {
            None => f64::NAN,
            Some(0) => at(0) * horizon as f64 / self.horizons[0] as f64,
            Some(next) => {
                let (before, after) = (self.horizons[next - 1], self.horizons[next]);
                let share = (horizon - before) as f64 / (after - before) as f64;
                at(next - 1) + share * (at(next) - at(next - 1))
            }
        }
    }

    /// Share of the errors of an evaluation inside the bands, at its [`errors_at`](super::Options::errors_at).
    ///
    /// # Panics
    /// If the evaluation has another number of outputs.
    pub fn coverage(&self, evaluation: &Evaluation) -> PredictionCoverage {
        let outputs = evaluation.channels.len();
        let share = |level: usize, horizon: usize, output: usize, errors: &[f32]| {
            let half = self.half_width(level, horizon, output);
            let known = errors.iter().filter(|error| error.is_finite());
            let (inside, all) = known.fold((0usize, 0usize), |(inside, all), error| {
                (inside + usize::from(f64::from(*error) <= half), all + 1)
            });
            if half.is_nan() { f64::NAN } else { inside as f64 / all as f64 }
        };
        let of = |level: usize| -> Vec<Vec<f64>> {
            let rows = evaluation.errors_at.iter().zip(evaluation.errors.chunks_exact(outputs));
            rows.map(|(&horizon, errors)| {
                errors.iter().enumerate().map(|(c, errors)| share(level, horizon, c, errors)).collect()
            })
            .collect()
        };
        PredictionCoverage {
            levels: self.levels.clone(),
            horizons: evaluation.errors_at.clone(),
            share: (0..self.levels.len()).map(of).collect(),
        }
    }

    /// Whether the numbers form bands of `outputs` outputs.
    pub(crate) fn is_valid(&self, outputs: usize) -> bool {
        let ascending = self.horizons.windows(2).all(|pair| pair[0] < pair[1]);
        let levels = self.levels.iter().all(|level| *level > 0.0 && *level < 1.0);
        let row = |row: &Vec<f64>| row.len() == outputs && row.iter().all(|x| x.is_finite() && *x >= 0.0);
        let table = |table: &Vec<Vec<f64>>| table.len() == self.horizons.len() && table.iter().all(row);
        self.horizons.first().is_some_and(|first| *first > 0)
            && self.horizons.last().is_some_and(|last| *last <= LONGEST)
            && ascending
            && levels
            && self.half_widths.len() == self.levels.len()
            && self.half_widths.iter().all(table)
    }
}

/// The quantile of the errors for each level.
///
/// The share of the errors of all other runs that an error exceeds is its level among them. A band of the quantile `p` of
/// the other runs holds the errors whose level is at most `p`.
fn quantiles(evaluation: &Evaluation) -> [f64; 3] {
    let runs = &evaluation.windows_of_runs;
    let run_of: Vec<usize> = runs.iter().enumerate().flat_map(|(run, &n)| (0..n).map(move |_| run)).collect();
    let mut levels: Vec<(f32, f64)> = Vec::new();
    for errors in &evaluation.errors {
        let mut sorted: Vec<(f32, usize)> = errors
            .iter()
            .copied()
            .zip(run_of.iter().copied())
            .filter(|(error, _)| error.is_finite())
            .collect();
        sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut totals = vec![0_usize; runs.len()];
        for (_, run) in &sorted {
            totals[*run] += 1;
        }
        let mut seen = vec![0_usize; runs.len()];
        for (rank, (_, run)) in sorted.iter().enumerate() {
            let others = sorted.len() - totals[*run];
            if others > 0 {
                #[expect(clippy::cast_possible_truncation, reason = "a share")]
                let level = ((rank - seen[*run]) as f64 / others as f64) as f32;
                levels.push((level, 1.0 / totals[*run] as f64));
            }
            seen[*run] += 1;
        }
    }
    levels.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = levels.iter().map(|(_, weight)| weight).sum();
    LEVELS.map(|level| {
        let mut sum = 0.0;
        let held = |(_, weight): &&(f32, f64)| {
            sum += weight;
            sum >= level * total
        };
        // A single run gives no information on others.
        levels.iter().find(held).map_or(level, |(quantile, _)| f64::from(*quantile))
    })
}

/// Index of the conformal quantile among `count` sorted errors.
fn rank(level: f64, count: usize) -> usize {
    // A positive number of at most `count + 1`.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "see above")]
    let rank = (level * (count + 1) as f64).ceil() as usize;
    rank.clamp(1, count) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rank_is_the_conformal_quantile() {
        // ceil((n + 1) q), counted from 1, and the largest error where that exceeds n.
        assert_eq!(
            [(0.5, 9), (0.9, 9), (0.9, 8), (0.9, 19), (0.5, 1)].map(|(q, n)| rank(q, n) + 1),
            [5, 9, 8, 18, 1]
        );
    }

    #[test]
    fn horizons_contain_the_quarters_and_widths_are_interpolated() {
        let horizons = PredictionBands::horizons(300);
        assert!([1, 75, 150, 225, 300].iter().all(|quarter| horizons.contains(quarter)));
        assert_eq!(PredictionBands::horizons(1), [1]);
        assert_eq!(PredictionBands::horizons(3), [1, 2, 3]);
        let bands = PredictionBands {
            levels: vec![0.5],
            horizons: vec![2, 10],
            half_widths: vec![vec![vec![1.0], vec![3.0]]],
        };
        assert!(bands.is_valid(1) && !bands.is_valid(2));
        let widths = [1, 2, 6, 10].map(|horizon| bands.half_width(0, horizon, 0));
        assert_eq!(widths, [0.5, 1.0, 2.0, 3.0]);
        assert!(bands.half_width(0, 11, 0).is_nan());
    }
}
