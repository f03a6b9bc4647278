//! Committees of difference equations, chosen by cross-validated rollouts.
//!
//! Candidates are ridge regressions of difference equations ([`DifferenceEquations`]): every library, number of past
//! values, clock step, averaging and ridge penalty of a grid, with constant coefficients, and the best of them with
//! coefficients that continue to learn along a run. Each candidate is fitted without one fold of the runs and rolled out
//! over the horizon on that fold, for all folds in turn. Members are chosen with replacement, each time the one that
//! reduces the error of the mean most (Caruana, Niculescu-Mizil, Crew and Ksikes, ICML 2004), and are fitted again on all
//! runs. The committee predicts with their weighted median, because a member can run away outside the training data.
//!
//! [`DifferenceEquations`]: hydroid_core::model::committee::DifferenceEquations

mod candidates;
pub mod currents;
pub(crate) mod folds;
mod library;
pub mod rate_limits;
mod regression;
pub(crate) mod ridge;
mod rollouts;
mod selection;

use hydroid_core::model::committee::{Committee, CommitteeError};

use crate::key::key;
use crate::log::Trajectory;
use crate::progress::{Cancelled, Progress};

/// Result of the choice of a committee.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// The committee, fitted on all runs.
    pub committee: Committee,
    /// The same members, fitted without the folds that contain validation runs; equal to the committee if there are
    /// none, or only such folds.
    pub before_refit: Committee,
    /// For each fold, a committee that was chosen by the errors on the other folds and fitted without it. Its errors on
    /// the fold are nearly unbiased: the errors of a candidate on the other folds belong to fits that include the fold,
    /// but no error on the fold influences the choice (Tsamardinos, Greasidou and Borboudakis, Machine Learning 107
    /// (2018) 1895).
    pub left_out: Vec<Committee>,
    /// Number of candidates that were compared.
    pub candidates: usize,
    /// Cross-validated error of the choice: NRMSE of the mean prediction of the members, averaged over outputs and the
    /// quarters of the horizon. The members were chosen by it.
    pub error: f64,
    /// The same of the committee with constant coefficients.
    pub constant_error: f64,
    /// Cross-validated error of the best single candidate.
    pub best_error: f64,
}

/// Reasons why there is no committee.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum ChooseError {
    #[error(
        "the runs are too short for a committee: of {folds} folds, those with a window of {horizon} samples after {warm_up} samples of past are fewer than two. Record for longer, or give a shorter {}",
        key("horizon")
    )]
    TooShort { folds: usize, horizon: usize, warm_up: usize },
    #[error(
        "no difference equation can be fitted to these runs: the outputs or inputs have no finite rows, or do not vary"
    )]
    Singular,
    #[error("the members do not form a committee: {0}")]
    Committee(#[from] CommitteeError),
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Chooses a committee for predictions up to `horizon` samples ahead.
///
/// # Errors
/// If the runs are too short or cannot be fitted, or `progress` cancels.
pub fn choose(runs: &[&Trajectory], horizon: usize, progress: Progress<'_>) -> Result<Chosen, ChooseError> {
    choose_with_validation(runs, &[], horizon, progress)
}

/// As [`choose`], for training and validation runs together, with the same members fitted without validation runs as
/// [`Chosen::before_refit`].
///
/// # Errors
/// As [`choose`].
pub fn choose_with_validation(
    training: &[&Trajectory],
    validation: &[&Trajectory],
    horizon: usize,
    progress: Progress<'_>,
) -> Result<Chosen, ChooseError> {
    let runs = [training, validation].concat();
    let folds = folds::folds(&runs, validation.len());
    let grid = candidates::Grid::new(&runs, folds, horizon)?;
    selection::choose(&grid, progress)
}
