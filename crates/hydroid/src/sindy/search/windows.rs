//! Windows that all trials of a search are scored on, over all runs together.

use std::sync::Arc;

use hydroid_core::model::sparse::{Equations, EquationsSession};
use hydroid_core::predict::{Predictor, Workspace};
use rayon::prelude::*;

use crate::evaluate::{DesignRange, EvaluateError, Options, WINDOWS, loss_blocks, mean_finite};
use crate::log::Trajectory;

/// Origins in runs, with the targets' statistics for the score.
pub(super) struct Windows<'a> {
    runs: &'a [&'a Trajectory],
    /// Design ranges of the outputs, widened to each run.
    ranges: Vec<Vec<DesignRange>>,
    /// Run and sample of each origin.
    origins: Vec<(usize, usize)>,
    horizon: usize,
    /// Number of measurements, and their standard deviation over all origins, for each horizon and output.
    targets: Vec<(f64, f64)>,
    /// Variance of each output over all runs.
    variance: Vec<f64>,
    /// Whether no output is missing anywhere.
    complete: bool,
}

/// Errors of one set of equations.
pub(super) struct WindowScore {
    /// Mean NRMSE over outputs and horizons; infinite if a rollout diverged.
    pub(super) score: f64,
    /// Mean losses of blocks of windows.
    pub(super) blocks: Vec<f64>,
    /// Windows that diverged.
    pub(super) diverged: usize,
}

impl<'a> Windows<'a> {
    /// Origins as in [`evaluate`](crate::evaluate::evaluate()), `stride` samples apart, one in `thinning` of all.
    ///
    /// # Errors
    /// If there are none.
    pub(super) fn new(
        runs: &'a [&'a Trajectory],
        ranges: &[DesignRange],
        options: &Options,
        (stride, thinning): (usize, usize),
    ) -> Result<Self, EvaluateError> {
        let (horizon, warm_up) = (options.horizon, options.warm_up.max(1));
        let mut origins = Vec::new();
        for (index, run) in runs.iter().enumerate() {
            let first = first_origin(run, warm_up).unwrap_or(run.len());
            let samples = (first..run.len().saturating_sub(horizon)).step_by(stride);
            origins.extend(samples.map(|sample| (index, sample)));
        }
        if origins.is_empty() {
            let longest = runs.iter().map(|run| run.len()).max().unwrap_or(0);
            let needed = warm_up.saturating_add(horizon);
            return Err(if longest < needed {
                EvaluateError::TooShort { needed, warm_up, horizon, longest }
            } else {
                EvaluateError::NoOrigin { channel: crate::evaluate::latest(runs, options) }
            });
        }
        let widened = |run: &&Trajectory| {
            let of = |(c, range): (usize, &DesignRange)| range.including(run.outputs.column(c));
            ranges.iter().enumerate().map(of).collect()
        };
        let mut windows = Self {
            runs,
            ranges: runs.iter().map(widened).collect(),
            horizon,
            targets: Vec::new(),
            variance: Vec::new(),
            complete: runs.iter().all(|run| run.outputs.rows(0, run.len()).iter().all(|y| !y.is_nan())),
            origins,
        };
        let outputs = ranges.len();
        let cells = || (0..horizon * outputs).map(|cell| (cell / outputs + 1, cell % outputs));
        // Few origins have hardly a standard deviation: all origins give it.
        let deviations: Vec<f64> =
            cells().map(|(step, output)| deviation(windows.targets_of(step, output))).collect();
        let thinned = windows.origins.iter().copied().step_by(thinning).collect();
        windows.origins = thinned;
        let count = |(step, output)| windows.targets_of(step, output).filter(|y| !y.is_nan()).count() as f64;
        windows.targets = cells().map(count).zip(deviations).collect();
        windows.variance = (0..outputs)
            .map(|c| {
                let deviation = deviation(runs.iter().flat_map(|run| run.outputs.column(c)));
                if deviation > 0.0 { deviation * deviation } else { f64::INFINITY }
            })
            .collect();
        Ok(windows)
    }

    /// Targets of all windows at one horizon.
    fn targets_of(&self, step: usize, output: usize) -> impl Iterator<Item = f64> + Clone {
        self.origins.iter().map(move |&(run, origin)| self.runs[run].outputs.row(origin + step)[output])
    }

    /// Whether the snapshots depend on lags and past values alone, and not on the coefficients.
    pub(super) fn is_complete(&self) -> bool {
        self.complete
    }

    /// Snapshots of a session of the equations at all origins.
    pub(super) fn snapshots(&self, equations: &Arc<Equations>) -> Vec<f64> {
        let mut session = EquationsSession::new(Arc::clone(equations));
        let size = session.snapshot_len();
        let mut snapshots = vec![0.0; self.origins.len() * size];
        let mut due = self.origins.iter().zip(snapshots.chunks_exact_mut(size.max(1))).peekable();
        for (index, run) in self.runs.iter().enumerate() {
            session.reset();
            for k in 0..run.len() {
                // Samples after the last origin do not matter.
                if due.peek().is_none_or(|((of, _), _)| *of != index) {
                    break;
                }
                if k == 0 {
                    session.observe(run.outputs.row(k));
                } else {
                    session.advance_observe(run.inputs.row(k - 1), run.outputs.row(k));
                }
                if let Some((_, into)) = due.next_if(|((of, sample), _)| (*of, *sample) == (index, k)) {
                    session.snapshot(into);
                }
            }
        }
        snapshots
    }

    /// Scores rollouts from `snapshots`.
    pub(super) fn score(&self, equations: &Arc<Equations>, snapshots: &[f64]) -> WindowScore {
        let (outputs, horizon) = (self.variance.len(), self.horizon);
        let size = snapshots.len() / self.origins.len();
        let tasks: Vec<(Vec<f64>, f64, usize)> = self
            .origins
            .par_chunks(WINDOWS)
            .enumerate()
            .map_init(
                || (EquationsSession::new(Arc::clone(equations)), Workspace::new(), Vec::new(), Vec::new()),
                |(session, work, commands, predicted), (task, origins)| {
                    commands.clear();
                    for &(run, origin) in origins {
                        commands.extend_from_slice(self.runs[run].inputs.rows(origin, origin + horizon));
                    }
                    predicted.resize(origins.len() * horizon * outputs, 0.0);
                    let snapshots = &snapshots[task * WINDOWS * size..][..origins.len() * size];
                    session.rollout_snapshots(origins.len(), snapshots, commands, work, predicted);
                    self.task(origins, predicted)
                },
            )
            .collect();
        let diverged: usize = tasks.iter().map(|(_, _, diverged)| diverged).sum();
        let mut squares = vec![0.0; horizon * outputs];
        for (task, _, _) in &tasks {
            squares.iter_mut().zip(task).for_each(|(sum, square)| *sum += square);
        }
        let nrmse = squares
            .iter()
            .zip(&self.targets)
            .map(|(square, (count, deviation))| (square / count).sqrt() / deviation);
        let score = mean_finite(nrmse).filter(|_| diverged == 0).unwrap_or(f64::INFINITY);
        let losses = tasks.iter().zip(self.origins.chunks(WINDOWS));
        let losses: Vec<(f64, usize)> =
            losses.map(|((_, loss, _), origins)| (*loss, origins.len())).collect();
        WindowScore { score, blocks: loss_blocks(&losses), diverged }
    }

    /// Sums of squares for each horizon and output, loss, and number of diverged windows.
    fn task(&self, origins: &[(usize, usize)], predicted: &[f64]) -> (Vec<f64>, f64, usize) {
        let outputs = self.variance.len();
        let mut squares = vec![0.0; self.horizon * outputs];
        let (mut count, mut diverged) = (0_usize, 0);
        for (&(run, origin), y) in origins.iter().zip(predicted.chunks_exact(squares.len())) {
            let ranges = &self.ranges[run];
            let targets = self.runs[run].outputs.rows(origin + 1, origin + 1 + self.horizon);
            let left = |row: &[f64]| row.iter().zip(ranges).any(|(y, range)| range.diverged(*y));
            diverged += usize::from(y.chunks_exact(outputs).any(left));
            for ((square, y), target) in squares.iter_mut().zip(y).zip(targets) {
                if !target.is_nan() {
                    *square += (y - target) * (y - target);
                    count += 1;
                }
            }
        }
        let relative = squares.iter().zip(self.variance.iter().cycle()).map(|(square, v)| square / v);
        let loss = if diverged > 0 { f64::INFINITY } else { relative.sum::<f64>() / count.max(1) as f64 };
        (squares, loss, diverged)
    }
}

/// The first sample after the warm-up with each output measured at least once.
fn first_origin(run: &Trajectory, warm_up: usize) -> Option<usize> {
    let measured = |c: usize| run.outputs.column(c).position(|y| !y.is_nan());
    let first = (0..run.outputs.width()).map(measured).try_fold(0, |latest, k| Some(k?.max(latest)))?;
    Some(first.max(warm_up - 1))
}

/// Standard deviation of the values that are not missing; NaN if they are constant.
fn deviation(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let measured = values.filter(|y| !y.is_nan());
    let count = measured.clone().count() as f64;
    let mean = measured.clone().sum::<f64>() / count;
    let variance = measured.clone().map(|y| (y - mean) * (y - mean)).sum::<f64>() / count;
    // Rounding leaves a variance to a constant.
    if variance > 1e-12 * mean * mean { variance.sqrt() } else { f64::NAN }
}
