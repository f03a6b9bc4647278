//! Settings chosen by what the equations predict.
//!
//! The score of a settings is the mean of two errors: of rollouts on the validation runs, and of rollouts on
//! excerpts of the training runs. Validation alone is at the mercy of chance where it is short: on a log of
//! ten minutes it chose equations that run away on the very data they were fitted to.

mod excerpts;
mod refinement;
mod selection;

use std::sync::Arc;

use hydroid_core::model::sparse::{Equations, EquationsSession, Term};
use serde::{Deserialize, Serialize};

use crate::evaluate::{self, DesignRange, EvaluateError, Evaluation, evaluate};
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

/// What to try.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchGrid {
    /// Libraries, with lags, gates and past.
    pub structures: Vec<Structure>,
    /// Regressions.
    pub regressions: Vec<RegressionForm>,
    /// How terms are selected.
    pub optimizers: Vec<Optimizer>,
    /// Ridge penalties, per row, on columns of unit RMS.
    pub ridges: Vec<f64>,
    /// What residuals cost, in all trials.
    pub loss: Loss,
    /// What the coefficients must obey, in all trials: each [is kept](super::is_supported) by the solver.
    pub constraints: Vec<Constraint>,
    /// What of the chosen equations is refined by predictions over many steps.
    pub refine: Option<RefineScope>,
}

/// What may move beside the coefficients when equations are refined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RefineScope {
    /// Time constants of lags: not those that are given.
    pub lags: bool,
    /// Centre and slope of a gate: not one that is given.
    pub gate: bool,
    /// Whether it is tried where predictions miss the measurements by far more than the noise, too.
    pub always: bool,
}

impl SearchGrid {
    /// Samples that the slowest structure needs before it predicts: given to all, so that all are judged on
    /// the same windows.
    pub fn warm_up(&self, run: &Trajectory) -> usize {
        let variables = Variables::of(run);
        let signals = self.structures.iter().flat_map(|structure| structure.signals(&variables));
        1 + signals.map(|signal| signal.warm_up(run.dt)).max().unwrap_or(0)
    }
}

/// What trials are judged on.
#[derive(Clone, Debug)]
pub struct SearchOptions<'a> {
    /// Runs that nothing is fitted to.
    pub validation: &'a [&'a Trajectory],
    /// Design ranges of the outputs.
    pub outputs: &'a [DesignRange],
    /// Ranges of the inputs in the training runs.
    pub inputs: &'a [DesignRange],
    /// Rollouts that are compared.
    pub evaluation: evaluate::Options,
    /// Seed of the stability screen and of the ensemble.
    pub seed: u64,
    /// Members of the ensemble that tells how sure the coefficients are; 0 for none.
    pub ensemble_size: usize,
}

/// One settings that was tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// The library, with lags, gate and past.
    pub structure: Structure,
    /// The regression.
    pub regression: RegressionForm,
    /// How terms were selected.
    pub optimizer: Optimizer,
    /// The ridge penalty.
    pub ridge: f64,
    /// Non-zero coefficients.
    pub terms: usize,
    /// What it was chosen by: the mean of the next two, or the first where the training runs are too short
    /// for the horizon; null where a rollout diverged.
    pub score: Option<f64>,
    /// Mean NRMSE over channels and horizons on the validation runs.
    pub validation: Option<f64>,
    /// The same on excerpts of the training runs.
    pub training: Option<f64>,
    /// Windows that diverged on either.
    pub diverged: usize,
}

/// What the search found.
#[derive(Clone, Debug)]
pub struct SearchResult {
    /// The chosen equations.
    pub fit: Fit,
    /// All trials, in the order of the grid.
    pub trials: Vec<Trial>,
    /// Position of the chosen one.
    pub chosen: usize,
    /// Position of the trial that each output's equation comes from: the chosen one but where another does
    /// better for that output alone.
    pub equations: Vec<usize>,
    /// Score of the chosen equations put together.
    pub score: f64,
    /// Condition number of the chosen library on the training runs.
    pub condition: f64,
    /// Terms of the chosen library that the training runs cannot tell apart or never move.
    pub unidentifiable: Vec<Term>,
    /// RegressionForm rows used, and left out because a sample was missing.
    pub rows: (u64, u64),
    /// How the equations bear states and commands that no log has.
    pub stability: StabilityCheck,
    /// How sure the coefficients are; over the terms of `fit`.
    pub ensemble: Option<Ensemble>,
    /// Whether its coefficients are the regression's or were refined.
    pub refinement: Refinement,
}

/// Why the search found nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SearchError {
    /// No library could be fitted; the reason of the smallest.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The validation runs cannot be evaluated.
    #[error("the validation runs cannot be used: {0}")]
    Validation(EvaluateError),
    /// Every settings diverged on the validation runs.
    #[error(
        "all {0} settings that were tried gave equations whose rollouts diverge on the validation or the training runs, so none is offered. Give training runs that cover the speeds and commands of the validation runs, a smaller degree, or a shorter horizon"
    )]
    AllDiverged(usize),
    /// A library that nobody can search, let alone read.
    #[error(
        "the library '{library}' has {terms} terms over these outputs and inputs; more than {MOST_TERMS} are not searched. Choose a smaller degree or fewer inputs"
    )]
    LibraryTooLarge {
        /// The library.
        library: String,
        /// Number of terms.
        terms: usize,
    },
    /// A library that is empty.
    #[error(
        "the library '{0}' has no terms over these outputs and inputs: choose a degree of 1 or more, or give terms"
    )]
    LibraryEmpty(String),
    /// The grid is empty.
    #[error("there is nothing to try: libraries, regressions, optimizers and ridges must each have an entry")]
    Empty,
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Terms of a library at the most: the cost of selecting among them grows with their cube.
pub const MOST_TERMS: usize = 1_000;

/// Integration steps that keep the inner step at or below 0.1 s: RK4 is then exact to the accuracy of a log
/// for motions slower than some ten per second, which a vessel's are.
pub fn substeps(dt: f64) -> usize {
    // A step count, far below 2^32 for any sample time that a log can have.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let steps = (dt / 0.1 - 1e-9).ceil().clamp(1.0, 1000.0) as usize;
    steps
}

/// Fits every settings of the grid to the training runs and chooses by rollouts on the validation runs and on
/// excerpts of the training runs.
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
    let excerpts = excerpts::excerpts(training, options.evaluation.horizon, grid.warm_up(run));
    let excerpts: Vec<&Trajectory> = excerpts.iter().collect();
    let mut search =
        Search { options, excerpts: &excerpts, variables: Variables::of(run), tried: Vec::new() };
    let mut first_error = None;
    let pairs = grid.structures.len() * grid.regressions.len();
    for (index, (structure, &regression)) in
        grid.structures.iter().flat_map(|s| grid.regressions.iter().map(move |r| (s, r))).enumerate()
    {
        let prepared = match search.prepare(training, structure, regression, grid, 0) {
            Ok(prepared) => Arc::new(prepared),
            // Larger libraries may be beyond these runs; the first first_error is the plainest.
            Err(error) => {
                first_error.get_or_insert(error);
                continue;
            }
        };
        let constraints = structure.constraints(&grid.constraints, &search.variables);
        for (position, &ridge) in grid.ridges.iter().enumerate() {
            let done = (index as f64 + position as f64 / grid.ridges.len() as f64) / pairs as f64;
            progress::report(progress, 0.9 * done)?;
            let mut last: Option<Vec<f64>> = None;
            for &optimizer in &grid.optimizers {
                let fit = match prepared.fit(&fit_options(optimizer, ridge, run.dt, &constraints)) {
                    Ok(fit) => fit,
                    Err(error) => {
                        first_error.get_or_insert(error.into());
                        continue;
                    }
                };
                // A stricter settings that changes nothing need not be judged again.
                if last.as_ref() != Some(&fit.scaled) {
                    last = Some(fit.scaled.clone());
                    let settings = TrialSettings { structure, regression, optimizer, ridge };
                    search.add_trial(settings, fit, Arc::clone(&prepared))?;
                }
            }
        }
    }
    if search.tried.iter().all(|tried| tried.trial.score.is_none()) {
        return Err(match first_error {
            Some(error) if search.tried.is_empty() => error,
            _ if search.tried.is_empty() => SearchError::Empty,
            _ => SearchError::AllDiverged(search.tried.len()),
        });
    }
    let found = search.select(training, grid, run.dt, &mut |f| progress(0.9 + 0.1 * f))?;
    progress::report(progress, 1.0)?;
    Ok(found)
}

fn fit_options(optimizer: Optimizer, ridge: f64, dt: f64, constraints: &Constraints) -> FitOptions {
    FitOptions { optimizer, ridge, substeps: substeps(dt), constraints: constraints.clone() }
}

/// The trials and what they are judged on.
struct Search<'a> {
    options: &'a SearchOptions<'a>,
    excerpts: &'a [&'a Trajectory],
    variables: Variables,
    tried: Vec<EvaluatedTrial>,
}

/// A settings.
#[derive(Clone, Copy)]
struct TrialSettings<'a> {
    structure: &'a Structure,
    regression: RegressionForm,
    optimizer: Optimizer,
    ridge: f64,
}

/// A trial with all that is needed to choose it.
struct EvaluatedTrial {
    trial: Trial,
    fit: Fit,
    losses: BlockLosses,
    prepared: Arc<LinearRegression>,
}

/// Rollouts of one model.
struct TrialScore {
    score: f64,
    validation: f64,
    training: Option<f64>,
    diverged: usize,
    losses: BlockLosses,
}

impl Search<'_> {
    fn prepare(
        &self,
        training: &[&Trajectory],
        structure: &Structure,
        regression: RegressionForm,
        grid: &SearchGrid,
        groups: usize,
    ) -> Result<LinearRegression, SearchError> {
        structure.check_size(&self.variables)?;
        let signals = structure.signals(&self.variables);
        let preparation =
            RegressionOptions { signals: &signals, loss: grid.loss, groups, ..RegressionOptions::default() };
        let terms = structure.terms(&self.variables);
        Ok(LinearRegression::with(training, terms, regression, &preparation)?)
    }

    fn add_trial(
        &mut self,
        settings: TrialSettings<'_>,
        fit: Fit,
        prepared: Arc<LinearRegression>,
    ) -> Result<(), SearchError> {
        let judged = self.score(&fit.equations)?;
        let finite = |x: f64| x.is_finite().then_some(x);
        let trial = Trial {
            structure: settings.structure.clone(),
            regression: settings.regression,
            optimizer: settings.optimizer,
            ridge: settings.ridge,
            terms: fit.equations.active_terms(),
            score: finite(judged.score),
            validation: finite(judged.validation),
            training: judged.training.and_then(finite),
            diverged: judged.diverged,
        };
        self.tried.push(EvaluatedTrial { trial, fit, losses: judged.losses, prepared });
        Ok(())
    }

    fn score(&self, equations: &Equations) -> Result<TrialScore, SearchError> {
        let on_validation =
            self.evaluate(equations, self.options.validation, self.options.evaluation.origin_stride)?;
        let validation = on_validation.score();
        let mut judged = TrialScore {
            score: validation,
            validation,
            training: None,
            diverged: on_validation.diverged,
            losses: BlockLosses { validation: on_validation.blocks, training: Vec::new() },
        };
        // What fails on the validation runs, or cannot win any more, need not be tried on the training runs.
        let best = self.tried.iter().filter_map(|tried| tried.trial.score).fold(f64::INFINITY, f64::min);
        if !self.excerpts.is_empty() && 0.5 * validation < best {
            // As many origins as on the validation runs: more would weigh no more.
            let samples = |runs: &[&Trajectory]| runs.iter().map(|run| run.len()).sum::<usize>();
            let ratio = samples(self.excerpts) / samples(self.options.validation).max(1);
            let stride = self.options.evaluation.origin_stride * ratio.max(1);
            let on_training = self.evaluate(equations, self.excerpts, stride)?;
            judged.diverged += on_training.diverged;
            judged.training = Some(on_training.score());
            judged.score = 0.5 * (validation + on_training.score());
            judged.losses.training = on_training.blocks;
        }
        Ok(judged)
    }

    fn evaluate(
        &self,
        equations: &Equations,
        runs: &[&Trajectory],
        origin_stride: usize,
    ) -> Result<Evaluation, SearchError> {
        let options = evaluate::Options { origin_stride, ..self.options.evaluation.clone() };
        let mut session = EquationsSession::new(Arc::new(equations.clone()));
        let silent = &mut progress::silent();
        evaluate("sindy", &mut session, self.options.outputs, runs, &options, silent).map_err(|error| {
            match error {
                EvaluateError::Cancelled(cancelled) => SearchError::Cancelled(cancelled),
                other => SearchError::Validation(other),
            }
        })
    }

    fn stability(&self, equations: &Equations) -> StabilityCheck {
        let steps = (5 * self.options.evaluation.horizon).clamp(300, 3_000);
        let plan = StabilityOptions { rollouts: 64, steps, seed: self.options.seed };
        stability_check(equations, self.options.outputs, self.options.inputs, plan)
    }
}
