//! How channels are brought to the size that networks work with.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::Scaling;
use hydroid_core::model::sparse::Equations;

use super::TrainError;
use super::windows::ScaledRun;
use crate::evaluate::{DesignRange, mean_finite};
use crate::log::{Table, Trajectory};

/// Half of what a design range is mapped to: the range becomes -2..2.
pub(super) const HALF_RANGE: f64 = 2.0;

/// Samples over which the size of increments is looked at: over one, noise would decide it.
const INCREMENT: usize = 10;

/// Means and scales from design ranges. What is designed for, not what a log happened to hold, decides, so that a
/// model that learns on board still finds numbers of a sensible size when the vessel leaves what the log showed.
pub(super) fn from_ranges(outputs: &[DesignRange], inputs: &[DesignRange]) -> Result<Scaling, TrainError> {
    let part = |what, ranges: &[DesignRange]| -> Result<(Vec<f64>, Vec<f64>), TrainError> {
        for (index, range) in ranges.iter().enumerate() {
            let (low, high) = (range.low, range.high);
            if !(low.is_finite() && high.is_finite() && low < high) {
                return Err(TrainError::Range { what, index, low, high });
            }
        }
        let map = |range: &DesignRange| {
            (0.5 * (range.low + range.high), 0.5 * (range.high - range.low) / HALF_RANGE)
        };
        Ok(ranges.iter().map(map).unzip())
    };
    let (output_mean, output_scale) = part("output", outputs)?;
    let (input_mean, input_scale) = part("input", inputs)?;
    let correction_scale = output_scale.clone();
    Ok(Scaling { output_mean, output_scale, input_mean, input_scale, correction_scale })
}

/// Standard deviation of each output over all runs.
pub(super) fn deviations(runs: &[&Trajectory]) -> Vec<f64> {
    let outputs = runs.first().map_or(0, |run| run.outputs.width());
    (0..outputs)
        .map(|c| {
            let values = || runs.iter().flat_map(|run| run.outputs.column(c));
            let mean = mean_finite(values()).unwrap_or(0.0);
            mean_finite(values().map(|y| (y - mean).powi(2))).unwrap_or(0.0).sqrt()
        })
        .collect()
}

/// Size of an output's increments over a sample.
pub(super) fn increments(runs: &[&Trajectory]) -> Vec<f64> {
    let outputs = runs.first().map_or(0, |run| run.outputs.width());
    root_mean_square(outputs, |c| {
        runs.iter().flat_map(move |run| {
            let later = run.outputs.column(c).skip(INCREMENT);
            run.outputs.column(c).zip(later).map(|(now, later)| (later - now) / INCREMENT as f64)
        })
    })
}

/// Size of what equations miss of a sample, from rollouts over a few samples.
pub(super) fn residuals(runs: &[&Trajectory], equations: &Equations) -> Vec<f64> {
    let n = equations.outputs();
    let mut missed: Vec<Vec<f64>> = vec![Vec::new(); n];
    let mut scratch = vec![0.0; equations.scratch()];
    for run in runs {
        // Walked along the run for the memory of signals; every few samples a rollout starts from the measurements.
        let mut state = vec![f64::NAN; equations.state_len()];
        for k in 0..run.len() {
            if k % INCREMENT == 0 {
                if k >= equations.warm_up() {
                    for (c, missed) in missed.iter_mut().enumerate() {
                        missed.push((measured(&run.outputs, k, c) - state[c]) / INCREMENT as f64);
                    }
                }
                state[..n].copy_from_slice(run.outputs.row(k));
            }
            equations.step(&mut state, run.inputs.row(k), &mut scratch);
        }
    }
    root_mean_square(n, |c| missed[c].iter().copied())
}

/// Size of what equations miss over the horizons that begin at the samples of runs, in the outputs' units.
pub(super) fn missed<T: Scalar>(runs: &[ScaledRun<T>], scaling: &Scaling) -> Vec<f64> {
    let n = scaling.output_scale.len();
    let of_run = |run: &ScaledRun<T>, c: usize| {
        let mut sums = [0.0; 2];
        for (k, below) in run.below.iter().flat_map(|below| (0..run.samples).map(move |k| (k, below))) {
            let measured = run.outputs[(k + 1) * n..].iter().skip(c).step_by(n);
            for (y, e) in measured.zip(below.ahead(k).iter().skip(c).step_by(n)) {
                let square = (y.wide() - e.wide()).powi(2);
                if square.is_finite() {
                    sums = [sums[0] + square, sums[1] + 1.0];
                }
            }
        }
        sums
    };
    (0..n)
        .map(|c| {
            let sums = runs.iter().map(|run| of_run(run, c));
            let [sum, count] = sums.fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
            scaling.output_scale[c] * (sum / f64::max(count, 1.0)).sqrt()
        })
        .collect()
}

fn measured(table: &Table, row: usize, column: usize) -> f64 {
    table.row(row)[column]
}

fn root_mean_square<I: Iterator<Item = f64>>(channels: usize, values: impl Fn(usize) -> I) -> Vec<f64> {
    (0..channels).map(|c| mean_finite(values(c).map(|v| v * v)).unwrap_or(0.0).sqrt()).collect()
}
