//! Grid search over libraries, regressions, optimizers and ridge penalties, scored by multi-step predictions.
//!
//! The score of a trial is the mean of the errors on the validation runs and on excerpts of the training runs, which
//! make the choice robust for short validation runs.

mod excerpts;
mod halving;
mod judge;
mod refinement;
mod refit;
mod selection;
mod weighted;
mod windows;

use std::sync::Arc;

use hydroid_core::model::sparse::{Equations, Term};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::evaluate::{self, DesignRange, EvaluateError};
use crate::log::Trajectory;
use crate::progress::{self, Cancelled, Progress};
use crate::sindy::constraints::Constraints;
use crate::sindy::ensemble::Ensemble;
use crate::sindy::error::FitError;
use crate::sindy::expression::Constraint;
use crate::sindy::fit::{Fit, LinearRegression};
use crate::sindy::library::Variables;
use crate::sindy::options::{FitOptions, Optimizer, RegressionOptions};
use crate::sindy::parsimony::BlockLosses;
use crate::sindy::refine::Refinement;
use crate::sindy::regression_form::RegressionForm;
use crate::sindy::robust::Loss;
use crate::sindy::stability::{StabilityCheck, StabilityOptions, stability_check};
use crate::sindy::structure::Structure;

use excerpts::SCORE_SAMPLES;
use judge::{Judge, TrialScore};

pub use refit::refit;
pub use weighted::noise_ratio;

/// The grid of options.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchGrid {
    /// Libraries with lags, gates and past values.
    pub structures: Vec<Structure>,
    /// Forms of the regression.
    pub regressions: Vec<RegressionForm>,
    /// Methods of term selection.
    pub optimizers: Vec<Optimizer>,
    /// Ridge penalties per row, for columns of unit RMS.
    pub ridges: Vec<f64>,
    /// Loss of the residuals, in all trials.
    pub loss: Loss,
    /// Constraints on the coefficients, in all trials, supported by the solver.
    pub constraints: Vec<Constraint>,
    /// Standard deviation of the white noise of each output: rows have the weights of the noise that the equations
    /// propagate. None for equal weights.
    pub noise: Option<Vec<f64>>,
    /// Scope of the refinement of the selected equations; none for no refinement.
    pub refine: Option<RefineScope>,
}

/// Parameters that are refined besides the coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RefineScope {
    /// Time constants of lags that were found by search.
    pub lags: bool,
    /// Centre and slope of a gate that was found by search.
    pub gate: bool,
    /// Whether refinement is tried even if model error exceeds the sensor noise by far.
    pub always: bool,
}

impl SearchGrid {
    /// Warm-up of the slowest structure \[samples\], shared by all trials for a comparison on the same windows.
    pub fn warm_up(&self, run: &Trajectory) -> usize {
        let variables = Variables::of(run);
        let signals = self.structures.iter().flat_map(|structure| structure.signals(&variables));
        1 + signals.map(|signal| signal.warm_up(run.dt)).max().unwrap_or(0)
    }
}

/// Data and options that trials are scored with.
#[derive(Clone, Debug)]
pub struct SearchOptions<'a> {
    /// Validation runs.
    pub validation: &'a [&'a Trajectory],
    /// Design ranges of the outputs.
    pub outputs: &'a [DesignRange],
    /// Ranges of the inputs in the training runs.
    pub inputs: &'a [DesignRange],
    /// Options of the rollouts.
    pub evaluation: evaluate::Options,
    /// Seed of the stability check and of the bootstrap.
    pub seed: u64,
    /// Bootstrap ensemble over the terms of `fit`.
    pub ensemble_size: usize,
    /// Largest number of samples for the refinement; of longer runs excerpts are used.
    pub refine_samples: usize,
}

/// One point of the grid and its score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// The library, with lags, gate and past.
    pub structure: Structure,
    /// The regression.
    pub regression: RegressionForm,
    /// The method of term selection.
    pub optimizer: Optimizer,
    /// The ridge penalty.
    pub ridge: f64,
    /// Number of non-zero coefficients.
    pub terms: usize,
    /// Mean of the next two errors, or the first one if the training runs are too short; none if a rollout diverged.
    pub score: Option<f64>,
    /// Mean NRMSE over channels and horizons on the validation runs.
    pub validation: Option<f64>,
    /// Mean NRMSE over channels and horizons on excerpts of the training runs.
    pub training: Option<f64>,
    /// Windows that diverged in validation and training runs.
    pub diverged: usize,
    /// Whether the scores are over all origins. The others are over a part of them.
    pub finalist: bool,
}

/// Result of the search.
#[derive(Clone, Debug)]
pub struct SearchResult {
    /// The selected equations.
    pub fit: Fit,
    /// All trials, in the order of the grid.
    pub trials: Vec<Trial>,
    /// Index of the selected trial.
    pub chosen: usize,
    /// Index of the trial of each equation: the selected one, or another one that is better for that output.
    pub equations: Vec<usize>,
    /// Score of the combined equations.
    pub score: f64,
    /// Condition number of the chosen library on the training runs.
    pub condition: f64,
    /// Terms of the selected library that are zero or linearly dependent on the training runs.
    pub unidentifiable: Vec<Term>,
    /// Regression rows used, and rows omitted because of a missing sample.
    pub rows: (u64, u64),
    /// Result of the stability check.
    pub stability: StabilityCheck,
    /// Bootstrap ensemble over the terms of `fit`.
    pub ensemble: Option<Ensemble>,
    /// Record of the refinement.
    pub refinement: Refinement,
    /// The grid of the search.
    pub grid: SearchGrid,
    /// Mean squared residual of each equation relative to the noise that the equations propagate, if they explain the training
    /// runs to within it.
    pub noise_ratio: Option<Vec<f64>>,
}

impl SearchResult {
    /// That the equations explain the data to within their noise, for the user; none if they were selected by rollouts.
    pub fn explained(&self) -> Option<String> {
        let largest = self.noise_ratio.iter().flatten().copied().reduce(f64::max)?;
        Some(format!(
            "equations that explain the training runs to within their white noise: the mean squared residual is at most {largest:.2} times that of the noise"
        ))
    }
}

/// Failure of the search.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum SearchError {
    /// No library could be fitted; the error of the smallest one.
    #[error(transparent)]
    Fit(#[from] FitError),
    #[error("the validation runs cannot be used: {0}")]
    Validation(EvaluateError),
    #[error(
        "the rollouts of all {0} trials diverge on the validation or training runs: no equations are selected. Give training runs that cover the speeds and commands of the validation runs, a smaller degree, or a shorter horizon"
    )]
    AllDiverged(usize),
    #[error(
        "the library '{library}' has {terms} terms over these outputs and inputs; the maximum is {MOST_TERMS}. Choose a smaller degree or fewer inputs"
    )]
    LibraryTooLarge { library: String, terms: usize },
    #[error(
        "the library '{0}' has no terms over these outputs and inputs: choose a degree of 1 or more, or give terms"
    )]
    LibraryEmpty(String),
    #[error(
        "the search grid is empty: libraries, regressions, optimizers and ridges each need at least one entry"
    )]
    Empty,
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Maximum number of terms of a library: the cost of the selection grows with their cube.
pub(super) const MOST_TERMS: usize = 1_000;

/// Integration steps per sample of at most 0.1 s: RK4 is accurate for motions slower than about ten per second.
pub fn substeps(dt: f64) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 1 and 1,000
    let steps = (dt / 0.1 - 1e-9).ceil().clamp(1.0, 1000.0) as usize;
    steps
}

/// Fits the grid to the training runs and selects by rollouts on validation runs and excerpts of training runs.
///
/// # Errors
/// If nothing could be fitted, everything diverged, or the work was interrupted.
pub fn search(
    training: &[&Trajectory],
    options: &SearchOptions<'_>,
    grid: &SearchGrid,
    progress: Progress<'_>,
) -> Result<SearchResult, SearchError> {
    let run = training.first().ok_or(SearchError::Empty)?;
    let mut options = options.clone();
    options.evaluation.warm_up = options.evaluation.warm_up.max(grid.warm_up(run));
    let options = &options;
    let horizon = options.evaluation.horizon;
    let excerpts = excerpts::excerpts(training, horizon, grid.warm_up(run), SCORE_SAMPLES);
    let excerpts: Vec<&Trajectory> = excerpts.iter().collect();
    let mut search = Search {
        options,
        excerpts: &excerpts,
        judge: Judge::new(options, &excerpts, 1)?,
        variables: Variables::of(run),
        tried: Vec::new(),
    };
    let (fitted, first_error) = fit_all(training, &search.variables, grid, &mut |f| progress(0.4 * f))?;
    search.halve(fitted, &mut |f| progress(0.4 + 0.5 * f))?;
    // Rollouts from noisy samples do not judge equations that explain the data to within the noise.
    if search.finalists().next().is_none() && (grid.noise.is_none() || search.tried.is_empty()) {
        return Err(match first_error {
            Some(error) if search.tried.is_empty() => error,
            _ if search.tried.is_empty() => SearchError::Empty,
            _ => SearchError::AllDiverged(search.tried.len()),
        });
    }
    let found = search.select(training, grid, &mut |f| progress(0.9 + 0.1 * f))?;
    progress::report(progress, 1.0)?;
    Ok(found)
}

/// Fits of the whole grid, and the error of the first, smallest library that could not be fitted.
fn fit_all<'a>(
    training: &[&Trajectory],
    variables: &Variables,
    grid: &'a SearchGrid,
    progress: Progress<'_>,
) -> Result<(Vec<Fitted<'a>>, Option<SearchError>), SearchError> {
    let (mut fitted, mut first_error) = (Vec::new(), None);
    let pairs = grid.structures.len() * grid.regressions.len();
    for (index, (structure, &regression)) in
        grid.structures.iter().flat_map(|s| grid.regressions.iter().map(move |r| (s, r))).enumerate()
    {
        progress::report(progress, index as f64 / pairs as f64)?;
        let prepared = match prepare(training, variables, structure, regression, (grid.loss, 0), &[]) {
            Ok(prepared) => Arc::new(prepared),
            Err(error) => {
                first_error.get_or_insert(error);
                continue;
            }
        };
        let constraints = structure.constraints(&grid.constraints, variables);
        let fits = |ridge: f64| -> Vec<(TrialSettings<'a>, Result<Fit, SearchError>)> {
            let of = |&optimizer: &Optimizer| {
                let settings = TrialSettings { structure, regression, optimizer, ridge };
                (settings, settings.fit(training, variables, grid, &prepared, &constraints))
            };
            let mut fits: Vec<_> = grid.optimizers.iter().map(of).collect();
            // A stricter optimizer with an unchanged result is not evaluated again.
            fits.dedup_by(|b, a| matches!((&a.1, &b.1), (Ok(a), Ok(b)) if a.scaled == b.scaled));
            fits
        };
        let fits: Vec<_> = grid.ridges.par_iter().flat_map_iter(|&ridge| fits(ridge)).collect();
        for (settings, fit) in fits {
            match fit {
                Ok(fit) => fitted.push(Fitted { settings, fit, prepared: Arc::clone(&prepared) }),
                Err(error) => {
                    first_error.get_or_insert(error);
                }
            }
        }
    }
    Ok((fitted, first_error))
}

fn fit_options(optimizer: Optimizer, ridge: f64, dt: f64, constraints: &Constraints) -> FitOptions {
    FitOptions { optimizer, ridge, substeps: substeps(dt), constraints: constraints.clone() }
}

fn prepare(
    runs: &[&Trajectory],
    variables: &Variables,
    structure: &Structure,
    regression: RegressionForm,
    (loss, groups): (Loss, usize),
    row_weights: &[Vec<f64>],
) -> Result<LinearRegression, SearchError> {
    structure.check_size(variables)?;
    let signals = structure.signals(variables);
    let preparation =
        RegressionOptions { signals: &signals, loss, groups, row_weights, ..RegressionOptions::default() };
    Ok(LinearRegression::with(runs, structure.terms(variables), regression, &preparation)?)
}

struct Search<'a> {
    options: &'a SearchOptions<'a>,
    excerpts: &'a [&'a Trajectory],
    judge: Judge<'a>,
    variables: Variables,
    tried: Vec<EvaluatedTrial>,
}

#[derive(Clone, Copy)]
struct TrialSettings<'a> {
    structure: &'a Structure,
    regression: RegressionForm,
    optimizer: Optimizer,
    ridge: f64,
}

struct Fitted<'a> {
    settings: TrialSettings<'a>,
    fit: Fit,
    prepared: Arc<LinearRegression>,
}

struct EvaluatedTrial {
    trial: Trial,
    fit: Fit,
    losses: BlockLosses,
    prepared: Arc<LinearRegression>,
}

impl Search<'_> {
    /// Trials of the last round that did not diverge.
    fn finalists(&self) -> impl Iterator<Item = usize> {
        let is_finalist = |i: &usize| self.tried[*i].trial.finalist && self.tried[*i].trial.score.is_some();
        (0..self.tried.len()).filter(is_finalist)
    }

    /// Score of equations on all origins.
    fn score(&self, equations: &Equations) -> TrialScore {
        let equations = Arc::new(equations.clone());
        self.judge.score(&equations, &self.judge.snapshots(&equations))
    }

    fn stability(&self, equations: &Equations) -> StabilityCheck {
        let steps = (5 * self.options.evaluation.horizon).clamp(300, 3_000);
        let plan = StabilityOptions { rollouts: 64, steps, seed: self.options.seed };
        stability_check(equations, self.options.outputs, self.options.inputs, plan)
    }
}
