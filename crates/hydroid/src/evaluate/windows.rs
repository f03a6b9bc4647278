//! Observation of a run and rollouts from its origins.

use hydroid_core::predict::{Predictor, Workspace};
use rayon::prelude::*;

use super::sums::{Figures, Sums};
use super::{
    Against, BLOCKS, Baseline, DesignRange, Divergence, EvaluateError, Evaluation, Options, Origin, RunCount,
    RunErrors, describe, mean_finite,
};
use crate::log::{Table, Trajectory};
use crate::progress::{self, Progress};

/// Origins of a task. Tasks depend on origins only, so that sums do not depend on the number of threads.
pub(crate) const TASK: usize = 32;

/// Memory of pending snapshots \[numbers\].
const SNAPSHOTS: usize = 4 << 20;

/// Largest number of windows whose single errors are kept.
const MOST_KEPT: usize = 100_000;

/// Largest number of listed divergences.
const MOST_LISTED: usize = 10;

/// Evaluates a session on runs; `ranges` are the design ranges of the outputs, which the range of a run widens.
///
/// The session is reset and observes each run once to its end in the caller's thread, so that an adapter learns along
/// the run. Rollouts start from snapshots in forks of the session, in parallel on the current rayon pool. The result
/// does not depend on the number of threads. A run that is too short for an origin is observed and counted.
///
/// # Errors
/// If the runs do not fit the model or are too short, an output or the truth is missing, or `progress` cancels.
///
/// # Panics
/// If the number of design ranges differs from the number of outputs.
pub fn evaluate(
    name: &str,
    session: &mut dyn Predictor,
    ranges: &[DesignRange],
    runs: &[&Trajectory],
    options: &Options,
    progress: Progress<'_>,
) -> Result<Evaluation, EvaluateError> {
    evaluate_with(name, Sessions::One(session), ranges, runs, options, progress)
}

/// Evaluates on each run a session of its own, for example of the model that was fitted without this run. Otherwise as
/// [`evaluate`].
///
/// # Errors
/// As [`evaluate`].
///
/// # Panics
/// If the number of sessions differs from the number of runs, or that of design ranges from that of outputs.
pub fn evaluate_each(
    name: &str,
    sessions: &mut [Box<dyn Predictor>],
    ranges: &[DesignRange],
    runs: &[&Trajectory],
    options: &Options,
    progress: Progress<'_>,
) -> Result<Evaluation, EvaluateError> {
    assert_eq!(sessions.len(), runs.len(), "one session for each run");
    evaluate_with(name, Sessions::Each(sessions), ranges, runs, options, progress)
}

/// Sessions of the runs.
enum Sessions<'a> {
    One(&'a mut dyn Predictor),
    Each(&'a mut [Box<dyn Predictor>]),
}

impl Sessions<'_> {
    fn of(&mut self, run: usize) -> &mut dyn Predictor {
        match self {
            Self::One(session) => *session,
            Self::Each(sessions) => sessions[run].as_mut(),
        }
    }
}

fn evaluate_with(
    name: &str,
    mut sessions: Sessions<'_>,
    ranges: &[DesignRange],
    runs: &[&Trajectory],
    options: &Options,
    progress: Progress<'_>,
) -> Result<Evaluation, EvaluateError> {
    let (n, h) = (ranges.len(), options.horizon);
    let count = if let Sessions::Each(sessions) = &sessions { sessions.len() } else { 1 };
    let mut warm_up = options.warm_up.max(1);
    for index in 0..count {
        warm_up = warm_up.max(sessions.of(index).warm_up());
    }
    for index in 0..count {
        let session = sessions.of(index);
        assert_eq!(session.outputs(), n, "one design range for each output");
        check(session, runs, options, warm_up)?;
    }
    let targets: Vec<&Table> = runs
        .iter()
        .map(|run| match options.against {
            Against::Measurement => &run.outputs,
            Against::Truth => run.truth.as_ref().unwrap_or(&run.outputs),
        })
        .collect();
    let shift: Vec<f64> =
        (0..n).map(|c| mean_finite(targets.iter().flat_map(|t| t.column(c))).unwrap_or(0.0)).collect();
    let variance: Vec<f64> = (0..n)
        .map(|c| {
            let squares = targets.iter().flat_map(|t| t.column(c)).map(|y| (y - shift[c]).powi(2));
            mean_finite(squares).filter(|v| *v > 0.0).unwrap_or(f64::INFINITY)
        })
        .collect();
    let mut tally = Tally::new(h * n, options.errors_at.len() * n);
    let samples: usize = runs.iter().map(|run| run.len()).sum();
    let keep_every = (samples / options.origin_stride / MOST_KEPT).max(1);
    let total: usize = runs.iter().map(|run| run.len()).sum();
    let mut before = 0;
    let mut by_run = Vec::new();
    let mut windows_of_runs = Vec::new();
    for (index, (run, target)) in runs.iter().zip(&targets).enumerate() {
        let ranges: Vec<DesignRange> =
            ranges.iter().enumerate().map(|(c, range)| range.including(target.column(c))).collect();
        let evaluation = RunEvaluation {
            run,
            target,
            ranges,
            shift: &shift,
            variance: &variance,
            options,
            warm_up,
            keep_every,
        };
        let mut of_run = Tally::new(h * n, options.errors_at.len() * n);
        evaluation.go(sessions.of(index), &mut of_run, &mut |done| {
            progress::report(progress, (before + done) as f64 / total as f64)
        })?;
        if of_run.windows > 0 {
            tally.runs.used += 1;
            by_run.push(of_run.errors(&run.name, &variance, n));
            windows_of_runs.extend(of_run.errors.first().map(Vec::len));
            tally.add(of_run);
        } else {
            tally.runs.unused += 1;
            tally.runs.unused_samples += run.len();
        }
        before += run.len();
    }
    if tally.windows == 0 {
        // Runs are long enough, so that a missing value is the cause.
        return Err(EvaluateError::NoOrigin { channel: latest(runs, options) });
    }
    Ok(Evaluation { by_run, windows_of_runs, ..tabulate(name, runs[0], options, &tally) })
}

fn check(
    predictor: &dyn Predictor,
    runs: &[&Trajectory],
    options: &Options,
    warm_up: usize,
) -> Result<(), EvaluateError> {
    let kept = options.errors_at.iter().all(|horizon| (1..=options.horizon).contains(horizon));
    if options.horizon == 0 || options.origin_stride == 0 || !kept {
        return Err(EvaluateError::NoHorizon);
    }
    let needed = warm_up.saturating_add(options.horizon);
    let longest = runs.iter().map(|run| run.len()).max().unwrap_or(0);
    if longest < needed {
        return Err(EvaluateError::TooShort { needed, warm_up, horizon: options.horizon, longest });
    }
    for run in runs {
        let name = || run.name.clone();
        for (what, expected, given) in [
            ("outputs", predictor.outputs(), run.outputs.width()),
            ("inputs", predictor.inputs(), run.inputs.width()),
        ] {
            if expected != given {
                return Err(EvaluateError::Channels { run: name(), what, expected, given });
            }
        }
        if (run.dt / runs[0].dt - 1.0).abs() > 1e-6 {
            return Err(EvaluateError::SampleTime { run: name(), expected: runs[0].dt, given: run.dt });
        }
        let wanted = options.origin == Origin::True || options.against == Against::Truth;
        if wanted && run.truth.is_none() {
            return Err(EvaluateError::NoTruth { run: name() });
        }
    }
    Ok(())
}

fn seen<'a>(run: &'a Trajectory, options: &Options) -> &'a Table {
    match (options.origin, &run.truth) {
        (Origin::True, Some(truth)) => truth,
        _ => &run.outputs,
    }
}

/// The output whose first value is the latest in the longest run.
pub(crate) fn latest(runs: &[&Trajectory], options: &Options) -> String {
    let Some(run) = runs.iter().max_by_key(|run| run.len()) else { return String::new() };
    let table = seen(run, options);
    let first = |c: &usize| table.column(*c).position(|y| !y.is_nan()).unwrap_or(run.len());
    (0..table.width())
        .rev()
        .max_by_key(first)
        .map_or_else(String::new, |c| run.outputs.channels()[c].name.clone())
}

/// Pending origins: whole tasks, so that origins of tasks and blocks of losses are the same for all models.
fn batch(size: usize) -> usize {
    (SNAPSHOTS / size.max(1) / TASK).clamp(1, 64) * TASK
}

struct Tally {
    sums: Sums,
    /// Loss and number of windows of each task, in order.
    losses: Vec<(f64, usize)>,
    windows: usize,
    independent: usize,
    diverged: usize,
    divergences: Vec<Divergence>,
    runs: RunCount,
    /// Errors of single windows, for each horizon and output.
    errors: Vec<Vec<f32>>,
}

impl Tally {
    fn new(cells: usize, kept: usize) -> Self {
        Self {
            sums: Sums::new(cells),
            losses: Vec::new(),
            windows: 0,
            independent: 0,
            diverged: 0,
            divergences: Vec::new(),
            runs: RunCount::default(),
            errors: vec![Vec::new(); kept],
        }
    }

    fn add(&mut self, run: Self) {
        self.sums.merge(&run.sums);
        self.losses.extend(run.losses);
        self.errors.iter_mut().zip(run.errors).for_each(|(all, errors)| all.extend(errors));
        self.windows += run.windows;
        self.independent += run.independent;
        self.diverged += run.diverged;
        let room = MOST_LISTED.saturating_sub(self.divergences.len());
        self.divergences.extend(run.divergences.into_iter().take(room));
    }

    /// Errors at the longest horizon, with the standard deviations of all runs.
    fn errors(&self, run: &str, variance: &[f64], outputs: usize) -> RunErrors {
        let last = self.sums.len() - outputs;
        let figures: Vec<Figures> = (0..outputs).map(|c| self.sums.figures(last + c)).collect();
        let relative = |of: fn(&Figures) -> f64| -> Vec<f64> {
            // The NRMSE of a constant output is undefined.
            let deviation = |variance: f64| if variance.is_finite() { variance.sqrt() } else { f64::NAN };
            figures
                .iter()
                .zip(variance)
                .map(|(figures, variance)| of(figures) / deviation(*variance))
                .collect()
        };
        RunErrors {
            run: run.to_owned(),
            windows: self.windows,
            diverged: self.diverged,
            nrmse: relative(|figures| figures.rmse),
            persistence: relative(|figures| figures.kept_rmse),
        }
    }
}

struct RunEvaluation<'a> {
    run: &'a Trajectory,
    target: &'a Table,
    /// Design ranges, widened to the range of the run.
    ranges: Vec<DesignRange>,
    shift: &'a [f64],
    variance: &'a [f64],
    options: &'a Options,
    warm_up: usize,
    /// Windows per window whose errors are kept.
    keep_every: usize,
}

/// A pending origin: sample and last observed value of each output.
struct Pending {
    origin: usize,
    kept: Vec<f64>,
}

impl RunEvaluation<'_> {
    fn go(
        &self,
        session: &mut dyn Predictor,
        tally: &mut Tally,
        report: &mut dyn FnMut(usize) -> Result<(), progress::Cancelled>,
    ) -> Result<(), EvaluateError> {
        let seen = seen(self.run, self.options);
        let end = self.run.len().saturating_sub(self.options.horizon);
        session.reset();
        let size = session.snapshot_len();
        let batch = batch(size);
        let mut pending: Vec<Pending> = Vec::new();
        let mut snapshots: Vec<f64> = Vec::new();
        let mut kept = vec![f64::NAN; seen.width()];
        let mut first_origin = None;
        // The end of the last window that overlaps none of those before it.
        let mut free_from = 0;
        for k in 0..self.run.len() {
            session.observe_heading(self.run.heading_at(k));
            if k == 0 {
                session.observe(seen.row(k));
            } else {
                session.advance_observe(self.run.inputs.row(k - 1), seen.row(k));
            }
            for (kept, &y) in kept.iter_mut().zip(seen.row(k)) {
                if !y.is_nan() {
                    *kept = y;
                }
            }
            // The warm-up ends after enough samples, with each output observed at least once.
            if first_origin.is_none() && k + 1 >= self.warm_up && kept.iter().all(|y| !y.is_nan()) {
                first_origin = Some(k);
            }
            let due = |first: usize| (k - first).is_multiple_of(self.options.origin_stride);
            if k < end && first_origin.is_some_and(due) {
                if k >= free_from {
                    tally.independent += 1;
                    free_from = k + self.options.horizon;
                }
                pending.push(Pending { origin: k, kept: kept.clone() });
                let at = snapshots.len();
                snapshots.resize(at + size, 0.0);
                session.snapshot(&mut snapshots[at..]);
            }
            if pending.len() == batch || k + 1 == self.run.len() {
                self.roll_out(session, &pending, &snapshots, tally);
                pending.clear();
                snapshots.clear();
                report(k)?;
            }
        }
        Ok(())
    }

    fn roll_out(&self, session: &dyn Predictor, pending: &[Pending], snapshots: &[f64], tally: &mut Tally) {
        let (n, h, size) = (session.outputs(), self.options.horizon, session.snapshot_len());
        let before = tally.windows;
        let parts: Vec<(Sums, Vec<Divergence>, Vec<f32>)> = pending
            .par_chunks(TASK)
            .enumerate()
            .map_init(
                || (session.fork(), Workspace::new(), Vec::new(), Vec::new()),
                |(fork, work, commands, predicted), (task, origins)| {
                    let mut sums = Sums::new(h * n);
                    let mut divergences = Vec::new();
                    commands.clear();
                    for pending in origins {
                        commands.extend_from_slice(self.run.inputs.rows(pending.origin, pending.origin + h));
                    }
                    predicted.resize(origins.len() * h * n, 0.0);
                    let snapshots = &snapshots[task * TASK * size..][..origins.len() * size];
                    fork.rollout_snapshots(origins.len(), snapshots, commands, work, predicted);
                    let mut errors = Vec::new();
                    for (i, (pending, y)) in origins.iter().zip(predicted.chunks_exact_mut(h * n)).enumerate()
                    {
                        if let Some(divergence) = self.diverged(pending.origin, y) {
                            divergences.push(divergence);
                            self.limit(pending.origin, y);
                        }
                        self.add(pending, y, &mut sums);
                        if (before + task * TASK + i).is_multiple_of(self.keep_every) {
                            self.keep(pending.origin, y, &mut errors);
                        }
                    }
                    (sums, divergences, errors)
                },
            )
            .collect();
        tally.windows += pending.len();
        for ((sums, divergences, errors), origins) in parts.into_iter().zip(pending.chunks(TASK)) {
            let loss = if divergences.is_empty() { sums.loss(self.variance) } else { f64::INFINITY };
            tally.losses.push((loss, origins.len()));
            tally.sums.merge(&sums);
            if !tally.errors.is_empty() {
                for window in errors.chunks_exact(tally.errors.len()) {
                    tally.errors.iter_mut().zip(window).for_each(|(all, error)| all.push(*error));
                }
            }
            tally.diverged += divergences.len();
            let room = MOST_LISTED.saturating_sub(tally.divergences.len());
            tally.divergences.extend(divergences.into_iter().take(room));
        }
    }

    /// Appends the absolute errors at the horizons of [`Options::errors_at`].
    fn keep(&self, origin: usize, y: &[f64], errors: &mut Vec<f32>) {
        let n = self.ranges.len();
        for &horizon in &self.options.errors_at {
            let predicted = &y[(horizon - 1) * n..horizon * n];
            let target = self.target.row(origin + horizon);
            #[expect(clippy::cast_possible_truncation, reason = "single precision suffices for bands")]
            errors.extend(predicted.iter().zip(target).map(|(y, target)| (y - target).abs() as f32));
        }
    }

    fn diverged(&self, origin: usize, y: &[f64]) -> Option<Divergence> {
        let n = self.ranges.len();
        let bad = y.iter().enumerate().position(|(i, &value)| self.ranges[i % n].diverged(value))?;
        Some(Divergence {
            run: self.run.name.clone(),
            origin_s: self.run.t0 + origin as f64 * self.run.dt,
            horizon: bad / n + 1,
            channel: self.run.outputs.channels()[bad % n].name.clone(),
        })
    }

    /// Limits a diverged rollout; a value that is not a number becomes the limit that is farther from the target.
    fn limit(&self, origin: usize, y: &mut [f64]) {
        let n = self.ranges.len();
        for (step, row) in y.chunks_exact_mut(n).enumerate() {
            let target = self.target.row(origin + step + 1);
            for ((y, range), target) in row.iter_mut().zip(&self.ranges).zip(target) {
                let (low, high) = range.limits();
                let farther = if target - low > high - target { low } else { high };
                *y = if y.is_nan() { farther } else { y.clamp(low, high) };
            }
        }
    }

    fn add(&self, pending: &Pending, y: &[f64], sums: &mut Sums) {
        let n = self.ranges.len();
        for (step, predicted) in y.chunks_exact(n).enumerate() {
            let target = self.target.row(pending.origin + step + 1);
            for c in 0..n {
                sums.add(step * n + c, predicted[c], pending.kept[c], target[c], self.shift[c]);
            }
        }
    }
}

fn tabulate(name: &str, run: &Trajectory, options: &Options, tally: &Tally) -> Evaluation {
    let (channels, units) = describe(run.outputs.channels());
    let n = channels.len();
    let table = |figure: fn(&Figures) -> f64| -> Vec<Vec<f64>> {
        (0..options.horizon)
            .map(|h| (0..n).map(|c| figure(&tally.sums.figures(h * n + c))).collect())
            .collect()
    };
    Evaluation {
        model: name.to_owned(),
        origin: options.origin,
        against: options.against,
        dt: run.dt,
        channels,
        units,
        horizons: (1..=options.horizon).collect(),
        windows: tally.windows,
        independent: tally.independent,
        runs: tally.runs,
        diverged: tally.diverged,
        divergences: tally.divergences.clone(),
        mae: table(|f| f.mae),
        max: table(|f| f.max),
        rmse: table(|f| f.rmse),
        nrmse: table(|f| f.nrmse),
        r2: table(|f| 1.0 - f.nrmse * f.nrmse),
        persistence: Baseline {
            mae: table(|f| f.kept_mae),
            rmse: table(|f| f.kept_rmse),
            nrmse: table(|f| f.kept_nrmse),
        },
        blocks: blocks(&tally.losses),
        by_run: Vec::new(),
        errors_at: options.errors_at.clone(),
        errors: tally.errors.clone(),
        windows_of_runs: Vec::new(),
    }
}

/// Merges the losses of tasks into blocks of consecutive windows.
pub(crate) fn blocks(losses: &[(f64, usize)]) -> Vec<f64> {
    let size = losses.len().div_ceil(BLOCKS).max(1);
    losses
        .chunks(size)
        .map(|part| {
            let windows: usize = part.iter().map(|(_, count)| count).sum();
            part.iter().map(|(loss, count)| loss * *count as f64).sum::<f64>() / windows as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_begin_at_the_same_origins_for_models_of_any_size() {
        for size in [0, 1, 2_100, 4_097, 50_000, 90_001, 1 << 20, 1 << 30] {
            assert!((TASK..=64 * TASK).contains(&batch(size)) && batch(size).is_multiple_of(TASK), "{size}");
        }
    }
}
