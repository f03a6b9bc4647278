//! Predictions along the runs on which a model is judged: successive rollouts and one-step residuals.

use hydroid_core::predict::Workspace;

use hydroid::evaluate::mean_finite;
use hydroid::identify::{Candidate, IdentifyResult};
use hydroid::log::{Split, Trajectory};
use hydroid::model::Model;

pub(super) struct Rollout {
    pub(super) origin: usize,
    /// Last measured values at the origin.
    pub(super) start: Vec<f64>,
    /// Predictions of the following samples, row by row.
    pub(super) y: Vec<f64>,
    /// Mean over the outputs of the RMSE in standard deviations of the run; infinite if not finite.
    pub(super) error: f64,
}

/// A run with its predictions.
pub(super) struct RunRollouts<'a> {
    pub(super) run: &'a Trajectory,
    pub(super) horizon: usize,
    /// Successive rollouts: each starts at the end of the previous one.
    pub(super) rollouts: Vec<Rollout>,
    /// Measurement minus one-step prediction, for each output and sample; NaN where either is missing.
    pub(super) residuals: Vec<Vec<f64>>,
}

pub(super) fn roll_out<'a>(
    candidate: &Candidate,
    result: &'a IdentifyResult,
    split: &'a Split,
) -> Vec<RunRollouts<'a>> {
    let horizon = candidate.judged().horizons.last().copied().unwrap_or(1).max(1);
    if let (None, Some(folds)) = (&candidate.test, &result.cross_validation) {
        let runs = folds.runs(&split.train).into_iter();
        let model = |fold: usize| candidate.left_out.get(fold).unwrap_or(&candidate.model);
        return runs.map(|(fold, run)| roll_out_run(model(fold), run, horizon)).collect();
    }
    split.test.iter().map(|run| roll_out_run(&candidate.model, run, horizon)).collect()
}

fn roll_out_run<'a>(model: &Model, run: &'a Trajectory, horizon: usize) -> RunRollouts<'a> {
    let mut session = model.session();
    session.reset();
    let n = session.outputs();
    let warm_up = session.warm_up().max(1);
    let mut work = Workspace::new();
    let mut kept = vec![f64::NAN; n];
    let mut next = vec![0.0; n];
    let mut rollouts = Vec::new();
    let mut residuals = vec![vec![f64::NAN; run.len()]; n];
    let mut origin = None;
    let deviations: Vec<f64> = (0..n).map(|c| deviation(run.outputs.column(c))).collect();
    for k in 0..run.len() {
        session.observe_heading(run.heading_at(k));
        session.observe(run.outputs.row(k));
        for (kept, &y) in kept.iter_mut().zip(run.outputs.row(k)) {
            if !y.is_nan() {
                *kept = y;
            }
        }
        let ready = k + 1 >= warm_up && kept.iter().all(|y| !y.is_nan());
        if ready && k + 1 < run.len() {
            session.rollout(run.inputs.rows(k, k + 1), &mut work, &mut next);
            for (c, residuals) in residuals.iter_mut().enumerate() {
                residuals[k + 1] = run.outputs.row(k + 1)[c] - next[c];
            }
        }
        if ready && k + horizon < run.len() && origin.is_none_or(|last| k >= last + horizon) {
            let mut y = vec![0.0; horizon * n];
            session.rollout(run.inputs.rows(k, k + horizon), &mut work, &mut y);
            let error = error(run, k, &y, &deviations);
            rollouts.push(Rollout { origin: k, start: kept.clone(), y, error });
            origin = Some(k);
        }
        session.advance(run.inputs.row(k));
    }
    RunRollouts { run, horizon, rollouts, residuals }
}

fn error(run: &Trajectory, origin: usize, y: &[f64], deviations: &[f64]) -> f64 {
    let n = deviations.len();
    if !y.iter().all(|v| v.is_finite()) {
        return f64::INFINITY;
    }
    let channel = |c: usize| {
        let squares = y
            .chunks_exact(n)
            .enumerate()
            .map(|(i, row)| (row[c] - run.outputs.row(origin + 1 + i)[c]).powi(2));
        mean_finite(squares).map_or(f64::NAN, |mean| mean.sqrt() / deviations[c])
    };
    mean_finite((0..n).map(channel)).unwrap_or(f64::INFINITY)
}

/// Standard deviation of the finite values; 0 if there are none.
pub(super) fn deviation(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let mean = mean_finite(values.clone()).unwrap_or(0.0);
    mean_finite(values.map(|v| (v - mean).powi(2))).unwrap_or(0.0).sqrt()
}

impl RunRollouts<'_> {
    /// The `count` neighbouring rollouts in which the outputs vary most.
    pub(super) fn liveliest(&self, count: usize) -> &[Rollout] {
        let count = count.min(self.rollouts.len());
        let n = self.run.outputs.width();
        let all: Vec<f64> = (0..n).map(|c| deviation(self.run.outputs.column(c))).collect();
        let motion: Vec<f64> = self
            .rollouts
            .iter()
            .map(|rollout| {
                let (from, to) = (rollout.origin, rollout.origin + self.horizon);
                (0..n)
                    .filter(|&c| all[c] > 0.0)
                    .map(|c| deviation((from..=to).map(|k| self.run.outputs.row(k)[c])) / all[c])
                    .sum()
            })
            .collect();
        let mut best = (0, f64::NEG_INFINITY);
        for (start, window) in motion.windows(count.max(1)).enumerate() {
            let sum: f64 = window.iter().sum();
            if sum > best.1 {
                best = (start, sum);
            }
        }
        &self.rollouts[best.0..best.0 + count]
    }

    /// The `count` neighbouring rollouts around the one with the median error.
    pub(super) fn typical(&self, count: usize) -> &[Rollout] {
        let count = count.min(self.rollouts.len());
        let mut order: Vec<usize> = (0..self.rollouts.len()).collect();
        order.sort_by(|&a, &b| self.rollouts[a].error.total_cmp(&self.rollouts[b].error));
        let middle = order.get(order.len() / 2).copied().unwrap_or(0);
        let start = middle.saturating_sub(count / 2).min(self.rollouts.len() - count);
        &self.rollouts[start..start + count]
    }
}
