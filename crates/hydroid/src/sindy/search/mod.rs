//! Settings chosen by what the equations predict.
//!
//! The score of a setting is the mean of two errors: of rollouts on the validation runs, and of rollouts on
//! excerpts of the training runs. Validation alone is at the mercy of chance where it is short: on a log of
//! ten minutes it chose equations that run away on the very data they were fitted to.

mod decide;
mod excerpts;
mod improve;

use std::sync::Arc;

use hydroid_core::model::sparse::{Equations, EquationsSession, Term};
use serde::{Deserialize, Serialize};

use crate::evaluate::{self, DesignRange, EvaluateError, Evaluation, evaluate};
use crate::log::Trajectory;
use crate::progress::{self, Cancelled, Progress};
use crate::sindy::choose::Losses;
use crate::sindy::constraints::Constraints;
use crate::sindy::ensemble::Ensemble;
use crate::sindy::error::FitError;
use crate::sindy::expression::Constraint;
use crate::sindy::fit::{Fit, Prepared};
use crate::sindy::kernel::Regression;
use crate::sindy::library::Variables;
use crate::sindy::options::{FitOptions, Optimizer, Preparation};
use crate::sindy::refine::Refinement;
use crate::sindy::robust::Loss;
use crate::sindy::screen::{Screen, Screened, screen};
use crate::sindy::structure::Structure;

/// What to try.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Libraries, with lags, gates and past.
    pub structures: Vec<Structure>,
    /// Regressions.
    pub regressions: Vec<Regression>,
    /// How terms are selected.
    pub optimizers: Vec<Optimizer>,
    /// Ridge penalties, per row, on columns of unit RMS.
    pub ridges: Vec<f64>,
    /// What residuals cost, in all trials.
    pub loss: Loss,
    /// What the coefficients must obey, in all trials: each [is kept](super::is_kept) by the solver.
    pub constraints: Vec<Constraint>,
    /// What of the chosen equations is refined by predictions over many steps.
    pub refine: Option<Free>,
}

/// What may move beside the coefficients when equations are refined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Free {
    /// Time constants of lags: not those that are given.
    pub lags: bool,
    /// Centre and slope of a gate: not one that is given.
    pub gate: bool,
    /// Whether it is tried where predictions miss the measurements by far more than the noise, too.
    pub anywhere: bool,
}

impl Grid {
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
pub struct Judge<'a> {
    /// Runs that nothing is fitted to.
    pub validation: &'a [&'a Trajectory],
    /// Design ranges of the outputs.
    pub outputs: &'a [DesignRange],
    /// Ranges of the inputs in the training runs.
    pub inputs: &'a [DesignRange],
    /// Rollouts that are compared.
    pub options: evaluate::Options,
    /// Seed of the stability screen and of the ensemble.
    pub seed: u64,
    /// Members of the ensemble that tells how sure the coefficients are; 0 for none.
    pub members: usize,
}

/// One setting that was tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// The library, with lags, gate and past.
    pub structure: Structure,
    /// The regression.
    pub regression: Regression,
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
pub struct Found {
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
    /// Regression rows used, and left out because a sample was missing.
    pub rows: (u64, u64),
    /// How the equations bear states and commands that no log has.
    pub screened: Screened,
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
    /// Every setting diverged on the validation runs.
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

/// Fits every setting of the grid to the training runs and chooses by rollouts on the validation runs and on
/// excerpts of the training runs.
///
/// # Errors
/// If nothing could be fitted, everything diverged, or the work was interrupted.
pub fn search(
    training: &[&Trajectory],
    judge: &Judge<'_>,
    grid: &Grid,
    progress: Progress<'_>,
) -> Result<Found, SearchError> {
    let run = training.first().ok_or(SearchError::Empty)?;
    let excerpts = excerpts::excerpts(training, judge.options.horizon, grid.warm_up(run));
    let excerpts: Vec<&Trajectory> = excerpts.iter().collect();
    let mut bench = Bench { judge, excerpts: &excerpts, variables: Variables::of(run), tried: Vec::new() };
    let mut refusal = None;
    let pairs = grid.structures.len() * grid.regressions.len();
    for (index, (structure, &regression)) in
        grid.structures.iter().flat_map(|s| grid.regressions.iter().map(move |r| (s, r))).enumerate()
    {
        let prepared = match bench.prepare(training, structure, regression, grid, 0) {
            Ok(prepared) => Arc::new(prepared),
            // Larger libraries may be beyond these runs; the first refusal is the plainest.
            Err(error) => {
                refusal.get_or_insert(error);
                continue;
            }
        };
        let constraints = structure.constraints(&grid.constraints, &bench.variables);
        for (position, &ridge) in grid.ridges.iter().enumerate() {
            let done = (index as f64 + position as f64 / grid.ridges.len() as f64) / pairs as f64;
            progress::report(progress, 0.9 * done)?;
            let mut last: Option<Vec<f64>> = None;
            for &optimizer in &grid.optimizers {
                let fit = match prepared.fit(&options(optimizer, ridge, run.dt, &constraints)) {
                    Ok(fit) => fit,
                    Err(error) => {
                        refusal.get_or_insert(error.into());
                        continue;
                    }
                };
                // A stricter setting that changes nothing need not be judged again.
                if last.as_ref() != Some(&fit.scaled) {
                    last = Some(fit.scaled.clone());
                    let setting = Setting { structure, regression, optimizer, ridge };
                    bench.try_out(setting, fit, Arc::clone(&prepared))?;
                }
            }
        }
    }
    if bench.tried.iter().all(|tried| tried.trial.score.is_none()) {
        return Err(match refusal {
            Some(error) if bench.tried.is_empty() => error,
            _ if bench.tried.is_empty() => SearchError::Empty,
            _ => SearchError::AllDiverged(bench.tried.len()),
        });
    }
    let found = bench.choose(training, grid, run.dt, &mut |f| progress(0.9 + 0.1 * f))?;
    progress::report(progress, 1.0)?;
    Ok(found)
}

fn options(optimizer: Optimizer, ridge: f64, dt: f64, constraints: &Constraints) -> FitOptions {
    FitOptions { optimizer, ridge, substeps: substeps(dt), constraints: constraints.clone() }
}

/// The trials and what they are judged on.
struct Bench<'a> {
    judge: &'a Judge<'a>,
    excerpts: &'a [&'a Trajectory],
    variables: Variables,
    tried: Vec<Tried>,
}

/// A setting.
#[derive(Clone, Copy)]
struct Setting<'a> {
    structure: &'a Structure,
    regression: Regression,
    optimizer: Optimizer,
    ridge: f64,
}

/// A trial with all that is needed to choose it.
struct Tried {
    trial: Trial,
    fit: Fit,
    losses: Losses,
    prepared: Arc<Prepared>,
}

/// Rollouts of one model.
struct Judged {
    score: f64,
    validation: f64,
    training: Option<f64>,
    diverged: usize,
    losses: Losses,
}

impl Bench<'_> {
    fn prepare(
        &self,
        training: &[&Trajectory],
        structure: &Structure,
        regression: Regression,
        grid: &Grid,
        groups: usize,
    ) -> Result<Prepared, SearchError> {
        structure.check(&self.variables)?;
        let signals = structure.signals(&self.variables);
        let preparation =
            Preparation { signals: &signals, loss: grid.loss, groups, ..Preparation::default() };
        let terms = structure.terms(&self.variables);
        Ok(Prepared::with(training, terms, regression, &preparation)?)
    }

    fn try_out(
        &mut self,
        setting: Setting<'_>,
        fit: Fit,
        prepared: Arc<Prepared>,
    ) -> Result<(), SearchError> {
        let judged = self.judge(&fit.equations)?;
        let finite = |x: f64| x.is_finite().then_some(x);
        let trial = Trial {
            structure: setting.structure.clone(),
            regression: setting.regression,
            optimizer: setting.optimizer,
            ridge: setting.ridge,
            terms: fit.equations.active_terms(),
            score: finite(judged.score),
            validation: finite(judged.validation),
            training: judged.training.and_then(finite),
            diverged: judged.diverged,
        };
        self.tried.push(Tried { trial, fit, losses: judged.losses, prepared });
        Ok(())
    }

    fn judge(&self, equations: &Equations) -> Result<Judged, SearchError> {
        let on_validation =
            self.evaluate(equations, self.judge.validation, self.judge.options.origin_stride)?;
        let validation = on_validation.score();
        let mut judged = Judged {
            score: validation,
            validation,
            training: None,
            diverged: on_validation.diverged,
            losses: Losses { validation: on_validation.blocks, training: Vec::new() },
        };
        // What fails on the validation runs, or cannot win any more, need not be tried on the training runs.
        let best = self.tried.iter().filter_map(|tried| tried.trial.score).fold(f64::INFINITY, f64::min);
        if !self.excerpts.is_empty() && 0.5 * validation < best {
            // As many origins as on the validation runs: more would weigh no more.
            let samples = |runs: &[&Trajectory]| runs.iter().map(|run| run.len()).sum::<usize>();
            let ratio = samples(self.excerpts) / samples(self.judge.validation).max(1);
            let stride = self.judge.options.origin_stride * ratio.max(1);
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
        let options = evaluate::Options { origin_stride, ..self.judge.options.clone() };
        let mut session = EquationsSession::new(Arc::new(equations.clone()));
        let silent = &mut progress::silent();
        evaluate("sindy", &mut session, self.judge.outputs, runs, &options, silent).map_err(|error| {
            match error {
                EvaluateError::Cancelled(cancelled) => SearchError::Cancelled(cancelled),
                other => SearchError::Validation(other),
            }
        })
    }

    fn screen(&self, equations: &Equations) -> Screened {
        let steps = (5 * self.judge.options.horizon).clamp(300, 3_000);
        let plan = Screen { rollouts: 64, steps, seed: self.judge.seed };
        screen(equations, self.judge.outputs, self.judge.inputs, plan)
    }
}
