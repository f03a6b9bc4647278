//! Settings chosen by what the equations predict.
//!
//! The score of a setting is the mean of two errors: of rollouts on the validation runs, and of rollouts on
//! excerpts of the training runs. Validation alone is at the mercy of chance where it is short: on a log of
//! ten minutes it chose equations that run away on the very data they were fitted to.

use serde::{Deserialize, Serialize};

use super::constraints::Constraints;
use super::error::FitError;
use super::fit::{Fit, Prepared};
use super::kernel::Regression;
use super::library::Library;
use super::options::{FitOptions, Optimizer, Scaling};
use crate::evaluate::{self, DesignRange, EvaluateError, evaluate};
use crate::log::Trajectory;
use crate::progress::{self, Cancelled, Progress};
use hydroid_core::model::sparse::{Equations, EquationsSession};
use std::sync::Arc;

/// What to try.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Libraries.
    pub libraries: Vec<Library>,
    /// Regressions.
    pub regressions: Vec<Regression>,
    /// How terms are selected.
    pub optimizers: Vec<Optimizer>,
    /// Ridge penalties, per row, on columns of unit RMS.
    pub ridges: Vec<f64>,
}

/// One setting that was tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// The library.
    pub library: Library,
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
    /// The chosen fit.
    pub fit: Fit,
    /// All trials, in the order of the grid.
    pub trials: Vec<Trial>,
    /// Position of the chosen one.
    pub chosen: usize,
    /// Condition number of the chosen library on the training runs.
    pub condition: f64,
    /// Terms of the chosen library that the training runs cannot tell apart or never move.
    pub unidentifiable: Vec<usize>,
    /// Regression rows used, and left out because a sample was missing.
    pub rows: (u64, u64),
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
        "a {library} over {variables} outputs and inputs has {terms} terms; more than {MOST_TERMS} are not searched. Choose a smaller degree or fewer inputs"
    )]
    LibraryTooLarge {
        /// The library.
        library: Library,
        /// Variables of the terms.
        variables: u16,
        /// Number of terms.
        terms: usize,
    },
    /// The grid is empty.
    #[error("there is nothing to try: libraries, regressions, optimizers and ridges must each have an entry")]
    Empty,
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Terms of a library at the most: the cost of selecting among them grows with their cube.
const MOST_TERMS: usize = 1_000;

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
    validation: &[&Trajectory],
    ranges: &[DesignRange],
    grid: &Grid,
    options: &evaluate::Options,
    progress: Progress<'_>,
) -> Result<Found, SearchError> {
    let run = training.first().ok_or(SearchError::Empty)?;
    let variables = run.outputs.width() + run.inputs.width();
    let variables = u16::try_from(variables).map_err(|_| SearchError::Empty)?;
    let excerpts = excerpts(training, options.horizon);
    let excerpts: Vec<&Trajectory> = excerpts.iter().collect();
    let mut trials: Vec<Trial> = Vec::new();
    let mut fits: Vec<(Fit, usize)> = Vec::new();
    let mut prepared: Vec<Prepared> = Vec::new();
    let mut refusal = None;
    let pairs = grid.libraries.len() * grid.regressions.len();
    for (index, (&library, &regression)) in
        grid.libraries.iter().flat_map(|l| grid.regressions.iter().map(move |r| (l, r))).enumerate()
    {
        // Larger libraries may be beyond these runs; the first refusal is the plainest.
        let terms = library.count(variables);
        if terms > MOST_TERMS {
            refusal.get_or_insert(SearchError::LibraryTooLarge { library, variables, terms });
            continue;
        }
        let regression_of =
            Prepared::new(training, library.terms(variables), regression, &Scaling::Contribution);
        let equations_of = match regression_of {
            Ok(prepared) => prepared,
            Err(error) => {
                refusal.get_or_insert(error.into());
                continue;
            }
        };
        for (position, &ridge) in grid.ridges.iter().enumerate() {
            let done = (index as f64 + position as f64 / grid.ridges.len() as f64) / pairs as f64;
            progress::report(progress, done)?;
            let mut last: Option<Fit> = None;
            for &optimizer in &grid.optimizers {
                let options_of = FitOptions {
                    optimizer,
                    ridge,
                    substeps: substeps(run.dt),
                    constraints: Constraints::default(),
                };
                let fit = match equations_of.fit(&options_of) {
                    Ok(fit) => fit,
                    Err(error) => {
                        refusal.get_or_insert(error.into());
                        continue;
                    }
                };
                // A stricter setting that changes nothing need not be judged again.
                if last.as_ref().is_some_and(|last| last.scaled == fit.scaled) {
                    continue;
                }
                let on_validation = judge(&fit.equations, validation, ranges, options)?;
                let mut diverged = on_validation.diverged;
                let validation_score = on_validation.score();
                let mut training_score = None;
                // What fails on the validation runs need not be tried on the training runs.
                if !excerpts.is_empty() && validation_score.is_finite() {
                    let on_training = judge(&fit.equations, &excerpts, ranges, options)?;
                    diverged += on_training.diverged;
                    training_score = Some(on_training.score());
                }
                let score = training_score.map_or(validation_score, |t| 0.5 * (t + validation_score));
                let finite = |x: f64| x.is_finite().then_some(x);
                trials.push(Trial {
                    library,
                    regression,
                    optimizer,
                    ridge,
                    terms: fit.equations.active_terms(),
                    score: finite(score),
                    validation: finite(validation_score),
                    training: training_score.and_then(finite),
                    diverged,
                });
                last = Some(fit.clone());
                fits.push((fit, prepared.len()));
            }
        }
        prepared.push(equations_of);
    }
    let Some(best) = trials.iter().filter_map(|t| t.score).min_by(f64::total_cmp) else {
        return Err(match refusal {
            Some(error) if trials.is_empty() => error,
            _ if trials.is_empty() => SearchError::Empty,
            _ => SearchError::AllDiverged(trials.len()),
        });
    };
    // Among equals the one with the fewest terms. A wider tolerance for simplicity costs accuracy where two
    // terms tell little apart on a noisy validation run: it drops true terms of the simple plant.
    let chosen = (0..trials.len())
        .filter(|&i| trials[i].score == Some(best))
        .min_by_key(|&i| trials[i].terms)
        .unwrap_or(0);
    let (fit, library) = fits.swap_remove(chosen);
    let library = &prepared[library];
    let all: Vec<usize> = (0..library.terms().len()).collect();
    let unidentifiable = library.unidentifiable().to_vec();
    let independent: Vec<usize> = all.into_iter().filter(|j| !unidentifiable.contains(j)).collect();
    Ok(Found {
        fit,
        chosen,
        trials,
        condition: library.condition(&independent),
        unidentifiable,
        rows: (library.rows(), library.skipped()),
    })
}

/// Samples of the training runs that take part in the score; more change no choice.
const EXCERPT_SAMPLES: usize = 15_000;

/// The training runs, or evenly spread parts of at most three horizons each where they are long together.
fn excerpts(runs: &[&Trajectory], horizon: usize) -> Vec<Trajectory> {
    let length = 3 * horizon + 1;
    let runs: Vec<&&Trajectory> = runs.iter().filter(|run| run.len() > horizon).collect();
    let total: usize = runs.iter().map(|run| run.len()).sum();
    if total <= EXCERPT_SAMPLES.max(2 * length) {
        return runs.into_iter().map(|&run| run.clone()).collect();
    }
    let count = (EXCERPT_SAMPLES / length).max(2);
    let mut parts = Vec::new();
    // Of very many runs, some stand for all.
    for run in runs.iter().step_by(runs.len().div_ceil(count)) {
        let length = length.min(run.len());
        let share = (count * run.len()).div_ceil(total);
        let room = run.len() - length;
        for i in 0..share {
            let from = if share == 1 { room / 2 } else { room * i / (share - 1) };
            parts.push(run.slice(from, from + length));
        }
    }
    parts
}

fn judge(
    equations: &Equations,
    validation: &[&Trajectory],
    ranges: &[DesignRange],
    options: &evaluate::Options,
) -> Result<evaluate::Evaluation, SearchError> {
    let mut session = EquationsSession::new(Arc::new(equations.clone()));
    evaluate("sindy", &mut session, ranges, validation, options, &mut progress::silent()).map_err(|error| {
        match error {
            EvaluateError::Cancelled(cancelled) => SearchError::Cancelled(cancelled),
            other => SearchError::Validation(other),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Channel, Table};

    fn run(samples: usize) -> Trajectory {
        let table = |name| Table::new(vec![Channel::new(name, "")], vec![0.0; samples]);
        let (outputs, inputs) = (table("y"), table("c"));
        Trajectory { name: String::from("run"), t0: 0.0, dt: 0.1, outputs, inputs, truth: None }
    }

    fn lengths(samples: usize, runs: usize) -> Vec<usize> {
        let runs: Vec<Trajectory> = (0..runs).map(|_| run(samples)).collect();
        excerpts(&runs.iter().collect::<Vec<_>>(), 100).iter().map(Trajectory::len).collect()
    }

    #[test]
    fn excerpts_are_whole_runs_or_parts_of_three_horizons_and_stay_few() {
        assert_eq!(lengths(5_000, 2), [5_000, 5_000]);
        assert_eq!(lengths(100, 3), [0; 0]);
        let long = lengths(72_000, 1);
        assert_eq!((long.len(), long[0]), (49, 301));
        // A log that gaps cut into pieces shorter than three horizons once had no excerpts at all.
        let cut = lengths(200, 2_000);
        assert!(cut.iter().all(|&n| n == 200) && (20..=49).contains(&cut.len()), "{}", cut.len());
    }
}
