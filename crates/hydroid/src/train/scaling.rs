//! Scaling of channels.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::Scaling;
use hydroid_core::model::sparse::Equations;

use super::TrainError;
use super::windows::ScaledRun;
use crate::evaluate::{DesignRange, mean_finite};
use crate::log::{Table, Trajectory};

/// Half of the scaled design range: a range is mapped to -2..2.
pub(super) const HALF_RANGE: f64 = 2.0;

/// Samples over which increments are measured: over one sample noise would dominate.
const INCREMENT: usize = 10;

/// Means and scales from design ranges, so that inputs stay of order one when a vessel leaves the training range.
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

/// RMS increment of each output over one sample.
pub(super) fn increments(runs: &[&Trajectory]) -> Vec<f64> {
    let outputs = runs.first().map_or(0, |run| run.outputs.width());
    root_mean_square(outputs, |c| {
        runs.iter().flat_map(move |run| {
            let later = run.outputs.column(c).skip(INCREMENT);
            run.outputs.column(c).zip(later).map(|(now, later)| (later - now) / INCREMENT as f64)
        })
    })
}

/// RMS one-sample residual of equations, from rollouts over a few samples.
pub(super) fn residuals(runs: &[&Trajectory], equations: &Equations) -> Vec<f64> {
    let n = equations.outputs();
    let mut missed: Vec<Vec<f64>> = vec![Vec::new(); n];
    let mut scratch = vec![0.0; equations.scratch()];
    for run in runs {
        // The signal memory follows the run; rollouts start from the measurements every few samples.
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

/// RMS residual of equations over the horizons from all samples, in the units of the outputs.
pub(super) fn missed<T: Scalar>(runs: &[ScaledRun<T>], scaling: &Scaling) -> Vec<f64> {
    let n = scaling.output_scale.len();
    let of_run = |run: &ScaledRun<T>, c: usize| {
        let mut sums = [0.0; 2];
        for (k, base_rollout) in
            run.base_rollout.iter().flat_map(|base_rollout| (0..run.samples).map(move |k| (k, base_rollout)))
        {
            let measured = run.outputs[(k + 1) * n..].iter().skip(c).step_by(n);
            for (y, e) in measured.zip(base_rollout.ahead(k).iter().skip(c).step_by(n)) {
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
