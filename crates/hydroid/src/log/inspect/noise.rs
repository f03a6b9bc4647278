//! Estimate of the noise of the outputs, and detection of smoothing.
//!
//! White noise of standard deviation `sigma` on a smooth signal is estimated from the second differences
//! `y_{k+1} - 2 y_k + y_{k-1}`: their autocovariance at lag 1 is `-4 sigma^2` (at lag 0: `6 sigma^2`),
//! so that `sigma^2 = -gamma_1 / 4` where the ratio is near -2/3. Increments `y_{k+1} - y_k` with a
//! lag-1 autocorrelation near -1/2 are nearly all noise. A moving average over `W` samples, or a
//! Savitzky-Golay derivative with that window, causes an isolated peak of the autocorrelation of the differences at
//! lag `W`. Third differences are used, because they remove the smooth signal.

use super::super::note::Note;
use super::super::trajectory::Trajectory;

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
    for (i, channel) in first.outputs.channels().iter().enumerate() {
        let differences = |order: usize| -> Vec<Vec<f64>> {
            runs.iter()
                .map(|r| {
                    let mut d: Vec<f64> = r.outputs.column(i).collect();
                    for _ in 0..order {
                        d = d.windows(2).map(|p| p[1] - p[0]).collect();
                    }
                    d
                })
                .collect()
        };
        let first_differences = differences(1);
        let increment_correlation = correlation(&first_differences, 1);
        let second = differences(2);
        let ratio = correlation(&second, 1);
        let noise_std = ratio
            .filter(|r| *r < -0.5)
            .map(|_| (-covariance(&second, 1).0 / 4.0).max(0.0).sqrt())
            .filter(|s| *s > 0.0 && repeated < super::MANY_REPEATS);
        let mostly_noise = increment_correlation.is_some_and(|r| r < -0.25);
        let smoothing_window = smoothing_window(&differences(3));
        if mostly_noise && let Some(std) = noise_std {
            notes.push(
                Note::info(format!(
                    "the change of `{}` from sample to sample is mostly noise (standard deviation about {std:.2e} {})",
                    channel.name, channel.unit
                ))
                .with_remedy("identify compares regressions over several windows; --window fixes one"),
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
        let second: Vec<Vec<f64>> = runs
            .iter()
            .map(|run| {
                let y: Vec<f64> = run.outputs.column(i).collect();
                y.windows(3).map(|y| y[2] - 2.0 * y[1] + y[0]).collect()
            })
            .collect();
        let white = correlation(&second, 1).is_some_and(|ratio| ratio < -0.5);
        let variance = if white { -covariance(&second, 1).0 / 4.0 } else { covariance(&second, 0).0 / 6.0 };
        variance.max(0.0).sqrt()
    };
    (0..outputs).map(level).collect()
}

/// Autocovariance at a lag over all runs, without removal of the mean, and the number of products.
fn covariance(series: &[Vec<f64>], lag: usize) -> (f64, usize) {
    let (mut sum, mut n) = (0.0, 0_usize);
    for d in series {
        for (a, b) in d.iter().zip(d.iter().skip(lag)) {
            let product = a * b;
            if !product.is_nan() {
                sum += product;
                n += 1;
            }
        }
    }
    (sum / n.max(1) as f64, n)
}

fn correlation(series: &[Vec<f64>], lag: usize) -> Option<f64> {
    let (at, n) = covariance(series, lag);
    let (variance, _) = covariance(series, 0);
    let r = at / variance;
    (n >= 20 && r.is_finite()).then_some(r)
}

/// The lag of an isolated peak of the autocorrelation.
fn smoothing_window(differences: &[Vec<f64>]) -> Option<usize> {
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
