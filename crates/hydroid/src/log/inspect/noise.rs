//! Estimate of the noise of the outputs, and detection of smoothing.
//!
//! White noise of standard deviation `sigma` on a smooth signal is estimated from the second differences
//! `y_{k+1} - 2 y_k + y_{k-1}`: their autocovariance at lag 1 is `-4 sigma^2` (at lag 0: `6 sigma^2`),
//! so that `sigma^2 = -gamma_1 / 4` where the ratio is near -2/3. Increments `y_{k+1} - y_k` with a
//! lag-1 autocorrelation near -1/2 are nearly all noise. A moving average over `W` samples, or a
//! Savitzky-Golay derivative with that window, causes an isolated peak of the autocorrelation of the differences at
//! lag `W`. Third differences are used, because they remove the smooth signal.

use rayon::prelude::*;

use super::super::note::Note;
use super::super::trajectory::Trajectory;
use crate::key::key;

/// Largest smoothing window in the search \[samples\].
const LONGEST_WINDOW: usize = 100;

/// Noise of one output over all runs of the log.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct NoiseReport {
    /// Name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Lag-1 autocorrelation of the increments: near -0.5 for noise, near 1 for a smooth signal.
    pub increment_correlation: Option<f64>,
    /// Whether the change from sample to sample is mostly noise.
    pub mostly_noise: bool,
    /// Standard deviation of the white noise, if detected.
    pub noise_std: Option<f64>,
    /// Window \[samples\] over which the output seems to have been smoothed.
    pub smoothing_window: Option<usize>,
}

pub(super) fn reports(runs: &[Trajectory], repeated: f64, notes: &mut Vec<Note>) -> Vec<NoiseReport> {
    let Some(first) = runs.first() else { return Vec::new() };
    let dt = first.dt;
    let mut reports = Vec::new();
    let outputs: Vec<[Vec<(f64, usize)>; 3]> = (0..first.outputs.width())
        .into_par_iter()
        .map(|i| {
            [(1, 1), (2, 1), (3, LONGEST_WINDOW)].map(|(order, last)| {
                autocovariances(|| runs.iter().map(|run| differences(run.outputs.column(i), order)), last)
            })
        })
        .collect();
    for (channel, [first, second, third]) in first.outputs.channels().iter().zip(outputs) {
        let increment_correlation = correlation(&first, 1);
        let ratio = correlation(&second, 1);
        let noise_std = ratio
            .filter(|r| *r < -0.5)
            .map(|_| (-second[1].0 / 4.0).max(0.0).sqrt())
            .filter(|s| *s > 0.0 && repeated < super::MANY_REPEATS);
        let mostly_noise = increment_correlation.is_some_and(|r| r < -0.25);
        let smoothing_window = smoothing_window(&third).filter(|window| !is_clock(runs, *window));
        if mostly_noise && let Some(std) = noise_std {
            notes.push(
                Note::info(format!(
                    "the change of `{}` from sample to sample is mostly noise (standard deviation about {std:.2e} {})",
                    channel.name, channel.unit
                ))
                .with_remedy(format!(
                    "identify compares regressions over several windows; {} fixes one",
                    key("window")
                )),
            );
        }
        if let Some(window) = smoothing_window {
            notes.push(
                Note::warning(format!(
                    "`{}` seems to have been smoothed over about {window} samples ({:.2} s)",
                    channel.name,
                    window as f64 * dt
                ))
                .with_remedy(format!(
                    "evaluate only horizons longer than {:.1} s: errors at shorter horizons are underestimated",
                    window as f64 * dt
                )),
            );
        }
        reports.push(NoiseReport {
            name: channel.name.clone(),
            unit: channel.unit.clone(),
            increment_correlation,
            mostly_noise,
            noise_std,
            smoothing_window,
        });
    }
    reports
}

/// White-noise standard deviation of each output: an upper bound if the noise is not white, zero for a constant output.
pub fn noise_level(runs: &[&Trajectory]) -> Vec<f64> {
    let outputs = runs.first().map_or(0, |run| run.outputs.channels().len());
    let level = |i: usize| {
        let second = autocovariances(|| runs.iter().map(|run| second_differences(run.outputs.column(i))), 1);
        let white = correlation(&second, 1).is_some_and(|ratio| ratio < -0.5);
        let variance = if white { -second[1].0 / 4.0 } else { second[0].0 / 6.0 };
        variance.max(0.0).sqrt()
    };
    (0..outputs).map(level).collect()
}

/// Rows whose products are summed together, so that the differences stay in the cache.
const ROWS: usize = 1024;
/// Lags whose sums are formed side by side, and sets of them that share a pass over the series.
const LANES: usize = 8;
const SETS: usize = 4;

/// Autocovariances of the series of all runs at the lags from 0 to `last`, without removal of the mean, with the numbers
/// of products.
fn autocovariances<S: Iterator<Item: Iterator<Item = f64>>>(
    series: impl Fn() -> S + Sync,
    last: usize,
) -> Vec<(f64, usize)> {
    let sets = (last + 1).div_ceil(LANES);
    let covariances = (0..sets.div_ceil(SETS)).into_par_iter().flat_map_iter(|pass| {
        let sets = SETS.min(sets - pass * SETS);
        let LagSums { sums, counts, .. } = LagSums::new(series(), pass * SETS * LANES, sets);
        sums.into_iter().flatten().zip(counts.into_iter().flatten())
    });
    let mut all: Vec<(f64, usize)> = covariances.map(|(sum, n)| (sum / n.max(1) as f64, n)).collect();
    all.truncate(last + 1);
    all
}

/// Sums of the products of values at lags from `from` on.
struct LagSums {
    from: usize,
    sums: Vec<[f64; LANES]>,
    counts: Vec<[usize; LANES]>,
}

impl LagSums {
    fn new(series: impl Iterator<Item: Iterator<Item = f64>>, from: usize, sets: usize) -> Self {
        let mut all = Self { from, sums: vec![[0.0; LANES]; sets], counts: vec![[0; LANES]; sets] };
        let past = from + sets * LANES - 1;
        let mut block: Vec<f64> = Vec::with_capacity(past + ROWS);
        for run in series {
            // No product reaches before the run.
            block.clear();
            block.resize(past, f64::NAN);
            for x in run {
                block.push(x);
                if block.len() == past + ROWS {
                    all.add(&block, past);
                    block.copy_within(ROWS.., 0);
                    block.truncate(past);
                }
            }
            all.add(&block, past);
        }
        all
    }

    /// Adds the products of the values from `past` on with those before them.
    fn add(&mut self, block: &[f64], past: usize) {
        let known = block.iter().all(|x| x.is_finite());
        for (set, (own, counts)) in self.sums.iter_mut().zip(&mut self.counts).enumerate() {
            // Lane `LANES - 1 - i` holds the lag `from + LANES set + i`.
            let latest = past - (self.from + set * LANES + LANES - 1);
            let mut sums = *own;
            sums.reverse();
            for (k, x) in block[past..].iter().enumerate() {
                let earlier = &block[latest + k..latest + k + LANES];
                if known {
                    for (sum, y) in sums.iter_mut().zip(earlier) {
                        *sum += x * y;
                    }
                } else {
                    for (i, (sum, y)) in sums.iter_mut().zip(earlier).enumerate() {
                        let product = x * y;
                        if !product.is_nan() {
                            *sum += product;
                            counts[LANES - 1 - i] += 1;
                        }
                    }
                }
            }
            if known {
                for n in counts.iter_mut() {
                    *n += block.len() - past;
                }
            }
            sums.reverse();
            *own = sums;
        }
    }
}

/// Differences of a series, of order 1 to 3.
fn differences(values: impl Iterator<Item = f64>, order: usize) -> impl Iterator<Item = f64> {
    let mut before = [f64::NAN; 3];
    let difference = move |mut x: f64| {
        for last in before.iter_mut().take(order) {
            let now = x;
            x -= *last;
            *last = now;
        }
        x
    };
    values.map(difference).skip(order)
}

fn second_differences(values: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    let mut before = [f64::NAN; 2];
    let difference = move |y: f64| {
        let [first, middle] = before;
        before = [middle, y];
        y - 2.0 * middle + first
    };
    values.map(difference).skip(2)
}

fn correlation(covariances: &[(f64, usize)], lag: usize) -> Option<f64> {
    let (at, n) = covariances[lag];
    let r = at / covariances[0].0;
    (n >= 20 && r.is_finite()).then_some(r)
}

/// Whether an input is a command that changes at such intervals \[samples\]: the responses to its steps repeat with them.
fn is_clock(runs: &[Trajectory], interval: usize) -> bool {
    let inputs = runs.first().map_or(0, |run| run.inputs.width());
    (0..inputs).any(|i| {
        let (mut steps, mut apart, mut samples) = (0, 0, 0);
        for run in runs {
            let values: Vec<f64> = run.inputs.column(i).collect();
            let has_step = |k: usize| k > 0 && values.get(k).is_some_and(|x| *x != values[k - 1]);
            let own: Vec<usize> = (1..values.len()).filter(|k| has_step(*k)).collect();
            steps += own.len();
            apart +=
                own.iter().filter(|k| (interval - 1..=interval + 1).any(|lag| has_step(*k + lag))).count();
            samples += values.len();
        }
        steps > 0 && 2 * apart >= steps && interval * steps <= 2 * samples
    })
}

/// The lag of an isolated peak of the autocorrelation.
fn smoothing_window(differences: &[(f64, usize)]) -> Option<usize> {
    let r: Vec<f64> =
        (0..=LONGEST_WINDOW).map_while(|lag| correlation(differences, lag)).map(f64::abs).collect();
    if r.len() < 20 {
        return None;
    }
    let (peak, height) = r.iter().copied().enumerate().skip(5).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let others = || r.iter().enumerate().skip(5).filter(|(lag, _)| lag.abs_diff(peak) > 2).map(|(_, x)| *x);
    let highest = others().fold(0.0, f64::max);
    (height > 0.15 && height > 2.0 * highest && peak < LONGEST_WINDOW).then_some(peak)
}

#[cfg(test)]
mod tests {
    use super::super::super::trajectory::{Channel, Table};
    use super::*;

    /// A command on a clock made "smoothed over about 50 samples" of a gyro without any filter.
    #[test]
    fn responses_to_commands_on_a_clock_are_not_smoothed() {
        let mut state = 1u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let (mut r, mut command) = (0.0, 0.0);
        let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
        for k in 0..3000 {
            if k % 50 == 0 {
                command = random();
            }
            r += 0.2 * (command - r);
            outputs.push(r + 0.003 * random());
            inputs.push(command);
        }
        let window = |inputs: Vec<f64>| {
            let table = |name: &str, values: Vec<f64>| Table::new(vec![Channel::new(name, "")], values);
            let run = Trajectory {
                name: String::new(),
                t0: 0.0,
                dt: 0.2,
                outputs: table("r", outputs.clone()),
                inputs: table("n", inputs),
                truth: None,
                heading: None,
                position: None,
            };
            reports(&[run], 0.0, &mut Vec::new()).remove(0).smoothing_window
        };
        assert_eq!(window(inputs), None);
        assert!(window(vec![0.0; 3000]).is_some(), "the test does not show the peak");
    }

    #[test]
    fn sums_side_by_side_are_the_sums_of_the_definition_to_the_last_bit() {
        let value = |k: usize| (0.37 * k as f64).sin() + 0.1 * (1.7 * k as f64).cos();
        let mut runs = [(0..2_500).map(value).collect::<Vec<f64>>(), (0..40).map(value).collect()];
        runs[0][1_700] = f64::NAN;
        let found = autocovariances(|| runs.iter().map(|run| run.iter().copied()), LONGEST_WINDOW);
        assert_eq!(found.len(), LONGEST_WINDOW + 1);
        for (lag, (covariance, n)) in found.into_iter().enumerate() {
            let pairs = runs.iter().flat_map(|run| run.iter().zip(run.iter().skip(lag)));
            let products: Vec<f64> = pairs.map(|(a, b)| a * b).filter(|product| !product.is_nan()).collect();
            let mut sum = 0.0;
            for product in &products {
                sum += product;
            }
            assert_eq!((covariance, n), (sum / products.len() as f64, products.len()), "{lag}");
        }
    }
}
