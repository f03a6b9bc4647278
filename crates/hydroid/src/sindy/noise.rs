//! Noise of the outputs, and the window of the weak form that follows from it.

use super::regression_form::RegressionForm;
use crate::log::Trajectory;

/// Maximum share of the noise in the left-hand side of a row. Shorter windows leave more noise; longer
/// windows average the motion and leave few independent rows.
pub(super) const NOISE_SHARE: f64 = 0.06;

const GROWTH: f64 = 1.25;

const MIN_WINDOWS: usize = 20;

/// Standard deviation of the white noise of each output, from the median of third differences: these cancel a parabola,
/// and the median ignores steps of the command. Zero if there are too few samples.
pub fn noise_std(runs: &[&Trajectory]) -> Vec<f64> {
    let width = runs.first().map_or(0, |run| run.outputs.width());
    (0..width)
        .map(|channel| {
            let mut sizes: Vec<f64> = Vec::new();
            for run in runs {
                let y: Vec<f64> = run.outputs.column(channel).collect();
                let third = y.windows(4).map(|w| (w[3] - w[0] - 3.0 * (w[2] - w[1])).abs());
                sizes.extend(third.filter(|d| d.is_finite()));
            }
            if sizes.is_empty() {
                return 0.0;
            }
            let middle = sizes.len() / 2;
            let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
            // A Gaussian's median size is 0.6745 deviations; the squares of 1, 3, 3, 1 add up to 20.
            median / (0.6745 * 20f64.sqrt())
        })
        .collect()
}

/// Standard deviation of the white noise of each output beside the motion, if an output has such noise that covers the motion in
/// its third differences. Their lag-one covariance is `-15 sigma^2` for white noise, their variance `20 sigma^2`, and slow motion
/// adds the same to both: the difference is free of it.
pub fn white_noise_std(runs: &[&Trajectory]) -> Option<Vec<f64>> {
    let mut is_white = false;
    let upper = noise_std(runs);
    let deviation = |(channel, upper): (usize, f64)| {
        let (mut products, mut squares) = (0.0, 0.0);
        let mut count: f64 = 0.0;
        for run in runs {
            let y: Vec<f64> = run.outputs.column(channel).collect();
            let third: Vec<f64> = y.windows(4).map(|w| w[3] - w[0] - 3.0 * (w[2] - w[1])).collect();
            for pair in third.windows(2).filter(|pair| pair.iter().all(|d| d.is_finite())) {
                products += pair[0] * pair[1];
                squares += 0.5 * (pair[0] * pair[0] + pair[1] * pair[1]);
                count += 1.0;
            }
        }
        is_white |= products < WHITE * squares;
        ((squares - products).max(0.0) / (35.0 * count.max(1.0))).sqrt().min(upper)
    };
    let deviations = upper.into_iter().enumerate().map(deviation).collect();
    is_white.then_some(deviations)
}

/// Lag-one correlation of third differences in which the motion has a tenth of the variance of the noise.
const WHITE: f64 = (0.1 - 0.75) / 1.1;

/// Third differences above this multiple of their noise indicate a spike.
const SPIKE_LIMIT: f64 = 10.0;

/// Share of the samples of each output that are spikes. A spike appears in four third differences.
pub(crate) fn spike_share(runs: &[&Trajectory]) -> Vec<f64> {
    let deviations = noise_std(runs);
    deviations
        .iter()
        .enumerate()
        .map(|(channel, deviation)| {
            // The squares of 1, 3, 3, 1 add up to 20.
            let limit = SPIKE_LIMIT * 20f64.sqrt() * deviation;
            let (mut far, mut count) = (0usize, 0usize);
            for run in runs {
                let y: Vec<f64> = run.outputs.column(channel).collect();
                let third = y.windows(4).map(|w| (w[3] - w[0] - 3.0 * (w[2] - w[1])).abs());
                for size in third.filter(|d| d.is_finite()) {
                    far += usize::from(size > limit);
                    count += 1;
                }
            }
            if *deviation > 0.0 { 0.25 * far as f64 / count.max(1) as f64 } else { 0.0 }
        })
        .collect()
}

/// The weak form with the shortest window that limits the noise to `NOISE_SHARE` of the left-hand side (RMS) of every
/// output, else the one with the smallest share. `None` if the runs are too short.
pub fn weak_form_from_noise(runs: &[&Trajectory]) -> Option<RegressionForm> {
    let deviations = noise_std(runs);
    let samples: usize = runs.iter().map(|run| run.len()).sum();
    let longest = runs.iter().map(|run| run.len()).max().unwrap_or(0).saturating_sub(1);
    let most = (samples / MIN_WINDOWS).min(longest);
    let mut best: Option<(f64, RegressionForm)> = None;
    let mut length = 4.0;
    loop {
        // Bounded by the number of samples.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let intervals = length as usize;
        if intervals > most {
            return best.map(|(_, regression)| regression);
        }
        let regression = RegressionForm::Weak { intervals };
        let share = max_noise_share(runs, &deviations, regression);
        if share <= NOISE_SHARE {
            return Some(regression);
        }
        if best.is_none_or(|(smallest, _)| share < smallest) {
            best = Some((share, regression));
        }
        length *= GROWTH;
    }
}

const MAX_ROWS: usize = 20_000;

/// Ratio of noise to RMS of the left-hand side, for the worst output that moves.
fn max_noise_share(runs: &[&Trajectory], deviations: &[f64], regression: RegressionForm) -> f64 {
    let width = deviations.len();
    let (mut squares, mut count) = (vec![0.0; width], 0u32);
    let all: usize = runs.iter().map(|run| run.len() / regression.stride()).sum();
    let mut amplification = 0.0;
    for run in runs {
        for rows in regression.rows(run.len(), run.dt) {
            let weights = &rows.kernel.outputs;
            amplification = weights.iter().map(|g| g * g).sum::<f64>().sqrt();
            for row in (0..rows.count).step_by(all.div_ceil(MAX_ROWS).max(1)) {
                let at = rows.first + row * rows.stride;
                let samples = run.outputs.rows(at, at + weights.len());
                let mut left = vec![0.0; width];
                for (g, y) in weights.iter().zip(samples.chunks_exact(width)) {
                    for (left, y) in left.iter_mut().zip(y) {
                        *left += g * y;
                    }
                }
                if left.iter().all(|x| x.is_finite()) {
                    count += 1;
                    squares.iter_mut().zip(&left).for_each(|(s, x)| *s += x * x);
                }
            }
        }
    }
    let rms = squares.iter().map(|s| (s / f64::from(count.max(1))).sqrt());
    let share = |(rms, deviation): (f64, &f64)| {
        if *deviation == 0.0 { 0.0 } else { amplification * deviation / rms.max(f64::MIN_POSITIVE) }
    };
    rms.zip(deviations).map(share).fold(0.0, f64::max)
}
