//! The grid of candidates, their fits and their predictions on folds that were left out.

use hydroid_core::adapt::RecursiveLeastSquares;
use hydroid_core::model::committee::Shape;
use rayon::prelude::*;

use super::ChooseError;
use super::folds::{Fold, Segment};
use super::library::Library;
use super::regression::{Moments, Regression};
use super::ridge::{Fit, solve};
use super::rollouts::{Coefficients, predictions};
use crate::log::Trajectory;

/// Clock steps in a horizon.
const CLOCKS: [usize; 2] = [30, 15];

/// Most past clock steps.
const LAGS: usize = 3;

/// Clock steps over which rows are averaged.
const AVERAGING: [usize; 2] = [1, 4];

/// Ridge penalties relative to the mean square of a term.
const RIDGES: [f64; 4] = [1e-6, 1e-4, 1e-2, 1e-1];

/// Weights of the training rows for members that learn.
const INFORMATION: [f64; 2] = [1.0, 0.1];

/// Shares of the horizon at which predictions are compared.
const MARKS: [usize; 4] = [1, 2, 3, 4];

/// Windows of the comparison, over all folds.
const WINDOWS: usize = 400;

/// Most samples of all folds with origins: the beginnings of long folds.
const JUDGED: usize = 60_000;

/// Most rows of a regression; of more rows, evenly spread ones are used.
const ROWS: usize = 60_000;

/// Candidates with constant coefficients that are also tried with learning ones.
const LEARNING: usize = 80;

/// A candidate: a regression, its ridge penalty, and the weight of the training rows if it learns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    pub(super) regression: usize,
    pub(super) ridge: f64,
    pub(super) information: Option<f64>,
}

/// Origins of a segment.
struct Origins {
    fold: usize,
    segment: usize,
    at: Vec<usize>,
}

/// The grid of candidates and what they share.
pub(super) struct Grid<'a> {
    folds: Vec<Fold<'a>>,
    pub(super) regressions: Vec<Regression>,
    /// Moments of each regression in each fold.
    moments: Vec<Vec<Moments>>,
    origins: Vec<Origins>,
    marks: Vec<usize>,
    pub(super) outputs: usize,
    /// Low and high value of each output.
    ranges: Vec<(f64, f64)>,
    /// True outputs in the layout of predictions.
    pub(super) truth: Vec<f32>,
}

impl<'a> Grid<'a> {
    pub(super) fn new(
        runs: &[&'a Trajectory],
        folds: Vec<Fold<'a>>,
        horizon: usize,
    ) -> Result<Self, ChooseError> {
        let Some(run) = runs.first() else { return Err(ChooseError::Singular) };
        let mut regressions = Vec::new();
        let mut clocks: Vec<usize> = CLOCKS.iter().map(|steps| (horizon / steps).max(1)).collect();
        clocks.dedup();
        for clock in clocks {
            for lags in 0..=LAGS {
                regressions.extend(Self::regressions(run, &Library::ALL, lags, clock));
            }
        }
        Self::with(runs, folds, horizon, regressions)
    }

    /// Some of the regressions of the grid: those of a few libraries with these past values, at the finer clock.
    pub(super) fn part(
        runs: &[&'a Trajectory],
        folds: Vec<Fold<'a>>,
        horizon: usize,
        libraries: &[Library],
        lags: &[usize],
    ) -> Result<Self, ChooseError> {
        let Some(run) = runs.first() else { return Err(ChooseError::Singular) };
        let clock = (horizon / CLOCKS[0]).max(1);
        let of = |&lags: &usize| Self::regressions(run, libraries, lags, clock);
        Self::with(runs, folds, horizon, lags.iter().flat_map(of).collect())
    }

    fn regressions(run: &Trajectory, libraries: &[Library], lags: usize, clock: usize) -> Vec<Regression> {
        let (outputs, inputs) = (run.outputs.width(), run.inputs.width());
        let shape = Shape { outputs, inputs, lags, clock, dt: run.dt };
        let mut regressions = Vec::new();
        for terms in libraries.iter().filter_map(|library| library.terms(&shape, run)) {
            let of = |&averaging| Regression::new(terms.clone(), shape, averaging).ok();
            regressions.extend(AVERAGING.iter().filter_map(of));
        }
        regressions
    }

    fn with(
        runs: &[&'a Trajectory],
        folds: Vec<Fold<'a>>,
        horizon: usize,
        regressions: Vec<Regression>,
    ) -> Result<Self, ChooseError> {
        let outputs = runs.first().map_or(0, |run| run.outputs.width());
        let clocks = regressions.iter().map(|regression| regression.shape.clock);
        let coarsest = clocks.max().unwrap_or(1);
        let mut marks: Vec<usize> = MARKS.iter().map(|mark| (horizon * mark / MARKS.len()).max(1)).collect();
        marks.dedup();
        let warm_up = LAGS * coarsest;
        let origins = origins(&folds, warm_up, horizon);
        let with_origins = |fold: &usize| origins.iter().any(|o| o.fold == *fold && !o.at.is_empty());
        if (0..folds.len()).filter(with_origins).count() < 2 {
            return Err(ChooseError::TooShort { folds: folds.len(), horizon, warm_up });
        }
        let segments = || folds.iter().flat_map(|fold| &fold.segments);
        let ranges = (0..outputs).map(|c| range(segments(), c)).collect();
        let mut truth = Vec::new();
        for Origins { fold, segment, at } in &origins {
            let segment = &folds[*fold].segments[*segment];
            for k in at {
                for mark in &marks {
                    #[expect(
                        clippy::cast_possible_truncation,
                        reason = "single precision suffices for the choice"
                    )]
                    truth.extend(segment.output(k + mark).iter().map(|y| *y as f32));
                }
            }
        }
        let samples = samples(&folds);
        let moments = |of: &Regression| -> Vec<Moments> {
            let (stride, _) = of.increments();
            let every = (samples / stride).div_ceil(ROWS).max(1);
            folds.iter().map(|fold| of.moments(fold, every)).collect()
        };
        let moments = regressions.par_iter().map(moments).collect();
        Ok(Self { folds, regressions, moments, origins, marks, outputs, ranges, truth })
    }

    /// Number of horizons at which predictions are compared.
    pub(super) fn marks(&self) -> usize {
        self.marks.len()
    }

    /// Squared errors of predictions in each fold, relative to the variance of the truth over all folds: means over
    /// windows, marks and outputs.
    pub(super) fn losses(&self, predicted: &[f32]) -> Vec<f64> {
        let columns = self.outputs * self.marks();
        let rows = (self.truth.len() / columns).max(1) as f64;
        let (mut mean, mut variance) = (vec![0.0; columns], vec![0.0; columns]);
        for (at, y) in self.truth.iter().enumerate() {
            mean[at % columns] += f64::from(*y) / rows;
        }
        for (at, y) in self.truth.iter().enumerate() {
            variance[at % columns] += (f64::from(*y) - mean[at % columns]).powi(2) / rows;
        }
        let mut sums = vec![(0.0, 0.0); self.folds()];
        let folds = self.origins.iter().flat_map(|o| std::iter::repeat_n(o.fold, o.at.len() * columns));
        for (at, (fold, (p, y))) in folds.zip(predicted.iter().zip(&self.truth)).enumerate() {
            let variance = variance[at % columns];
            if variance > 0.0 {
                sums[fold].0 += (f64::from(*p) - f64::from(*y)).powi(2) / variance;
                sums[fold].1 += 1.0;
            }
        }
        sums.into_iter().filter(|(_, count)| *count > 0.0).map(|(sum, count)| sum / count).collect()
    }

    /// Number of folds.
    pub(super) fn folds(&self) -> usize {
        self.folds.len()
    }

    /// Windows of all folds but `without`, in the layout of predictions.
    pub(super) fn windows_outside(&self, without: Option<usize>) -> Vec<usize> {
        let folds = self.origins.iter().flat_map(|o| std::iter::repeat_n(o.fold, o.at.len()));
        folds.enumerate().filter(|(_, fold)| Some(*fold) != without).map(|(window, _)| window).collect()
    }

    /// All candidates with constant coefficients.
    pub(super) fn constant(&self) -> Vec<Candidate> {
        let of = |regression| RIDGES.map(|ridge| Candidate { regression, ridge, information: None });
        (0..self.regressions.len()).flat_map(of).collect()
    }

    /// The candidates with constant coefficients and this ridge penalty.
    pub(super) fn with_ridge(&self, ridge: f64) -> Vec<Candidate> {
        (0..self.regressions.len())
            .map(|regression| Candidate { regression, ridge, information: None })
            .collect()
    }

    /// Candidates that learn, for the best ones with constant coefficients.
    pub(super) fn learning(of: &[Candidate]) -> Vec<Candidate> {
        let learning = |candidate: &Candidate| {
            let candidate = *candidate;
            INFORMATION.map(|information| Candidate { information: Some(information), ..candidate })
        };
        of.iter().take(LEARNING).flat_map(learning).collect()
    }

    /// Fit on the folds that `with` admits.
    pub(super) fn fit(&self, candidate: &Candidate, with: impl Fn(usize) -> bool) -> Option<Fit> {
        let of = &self.regressions[candidate.regression];
        let mut sum = Moments::zero(of.terms.len(), self.outputs);
        let moments = self.moments[candidate.regression].iter().enumerate();
        moments.filter(|(fold, _)| with(*fold)).for_each(|(_, moments)| sum.add(moments));
        solve(&sum, of.terms.len(), candidate.ridge)
    }

    /// Whether a fold contains training runs alone; true for all folds if none does.
    pub(super) fn is_training(&self, fold: usize) -> bool {
        !self.folds[fold].validation || self.folds.iter().all(|fold| fold.validation)
    }

    /// Limits of predictions, as in the committee: one width of the range beyond it.
    fn limits(&self) -> Vec<(f64, f64)> {
        let limit = |&(low, high): &(f64, f64)| (low - (high - low), high + (high - low));
        self.ranges.iter().map(limit).collect()
    }

    /// Range of each output in the folds that `with` admits.
    pub(super) fn ranges_of(&self, with: impl Fn(usize) -> bool) -> Vec<(f64, f64)> {
        let folds = || self.folds.iter().enumerate().filter(|(fold, _)| with(*fold)).map(|(_, of)| of);
        (0..self.outputs).map(|c| range(folds().flat_map(|fold| &fold.segments), c)).collect()
    }

    /// Predictions of a candidate on each fold, fitted without it, in the layout of the truth; `None` if a fit fails.
    pub(super) fn predictions(&self, candidate: &Candidate) -> Option<Vec<f32>> {
        let of = &self.regressions[candidate.regression];
        let limits = self.limits();
        let mut all = Vec::with_capacity(self.truth.len());
        let mut fit: Option<(usize, Fit)> = None;
        for Origins { fold, segment, at } in &self.origins {
            if fit.as_ref().is_none_or(|(of, _)| of != fold) {
                fit = Some((*fold, self.fit(candidate, |other| other != *fold)?));
            }
            let (_, fit) = fit.as_ref()?;
            let segment = &self.folds[*fold].segments[*segment];
            let roll = |coefficients| predictions(of, coefficients, segment, at, &self.marks, &limits);
            all.extend(match candidate.information {
                None => roll(Coefficients::Shared(&fit.coefficients)),
                Some(information) => {
                    let mut learner = Learner::new(of, fit, information);
                    let mut coefficients: Vec<Vec<f64>> = Vec::with_capacity(at.len());
                    let (_, increments) = of.increments();
                    let last = at.last().map_or(0, |last| last + 1);
                    of.for_each_row(segment, increments, last, &mut |end, phi, z| {
                        while at.get(coefficients.len()).is_some_and(|&origin| origin < end) {
                            coefficients.push(learner.coefficients());
                        }
                        learner.learn(phi, z);
                    });
                    coefficients.resize_with(at.len(), || learner.coefficients());
                    if coefficients.is_empty() { Vec::new() } else { roll(Coefficients::Each(&coefficients)) }
                }
            });
        }
        Some(all)
    }
}

/// Recursive least squares along a segment, as in [`CommitteeSession`](hydroid_core::adapt::CommitteeSession) without its
/// innovation gate.
struct Learner<'a> {
    kernel: RecursiveLeastSquares,
    scale: &'a [f64],
    averaging: f64,
    row: Vec<f64>,
}

impl<'a> Learner<'a> {
    fn new(of: &Regression, fit: &'a Fit, information: f64) -> Self {
        let terms = of.terms.len();
        let rows = fit.coefficients.chunks_exact(terms);
        let theta: Vec<f64> = rows.flat_map(|row| row.iter().zip(&fit.scale).map(|(xi, s)| xi * s)).collect();
        Self {
            kernel: RecursiveLeastSquares::with_r_factor(&theta, information, &fit.r_factor, false),
            scale: &fit.scale,
            averaging: of.averaging as f64,
            row: vec![0.0; terms],
        }
    }

    fn learn(&mut self, phi: &[f64], z: &[f64]) {
        for ((row, phi), s) in self.row.iter_mut().zip(phi).zip(self.scale) {
            *row = phi / s;
        }
        self.kernel.predict(&self.row, z);
        self.kernel.correct(self.averaging);
    }

    fn coefficients(&self) -> Vec<f64> {
        let rows = self.kernel.coefficients().chunks_exact(self.scale.len());
        rows.flat_map(|row| row.iter().zip(self.scale).map(|(theta, s)| theta / s)).collect()
    }
}

/// Range of an output; of positive width, also for a constant output.
fn range<'a>(segments: impl Iterator<Item = &'a Segment<'a>>, c: usize) -> (f64, f64) {
    let values = segments.flat_map(|segment| (0..segment.len()).map(|k| segment.output(k)[c]));
    let (low, high) = values
        .filter(|y| y.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| (low.min(y), high.max(y)));
    if low < high {
        (low, high)
    } else {
        let middle = if low.is_finite() { low } else { 0.0 };
        (middle - 0.5 * middle.abs().max(1.0), middle + 0.5 * middle.abs().max(1.0))
    }
}

/// Samples of all folds.
fn samples(folds: &[Fold<'_>]) -> usize {
    folds.iter().flat_map(|fold| &fold.segments).map(Segment::len).sum()
}

/// Origins with complete windows, evenly spread over the first samples of each fold: at most five in a horizon, and about
/// [`WINDOWS`] in all.
fn origins(folds: &[Fold<'_>], warm_up: usize, horizon: usize) -> Vec<Origins> {
    let most = JUDGED / folds.len().max(1);
    let stride = (horizon / 5).max(samples(folds).min(JUDGED) / WINDOWS).max(1);
    let mut all = Vec::new();
    for (fold, of) in folds.iter().enumerate() {
        let mut left = most;
        for (segment, s) in of.segments.iter().enumerate() {
            let end = s.len().min(left);
            left -= end;
            let known =
                |k: &usize| (k - warm_up..=k + horizon).all(|k| s.output(k).iter().all(|y| y.is_finite()));
            let at = (warm_up..end.saturating_sub(horizon)).step_by(stride).filter(known).collect();
            all.push(Origins { fold, segment, at });
        }
    }
    all
}
