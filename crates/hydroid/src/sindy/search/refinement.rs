//! Refinement of the selected equations by multi-step prediction errors, accepted only if the predictions improve.

use hydroid_core::model::sparse::Equations;

use super::excerpts::excerpts;
use super::{RefineScope, Search, SearchError, SearchGrid, Variables};
use crate::log::Trajectory;
use crate::progress::Progress;
use crate::sindy::constraints::{Coefficient, Constraints, Equality};
use crate::sindy::ensemble::Ensemble;
use crate::sindy::fit::Fit;
use crate::sindy::refine::{
    Attempt, Outcome, RefineOptions, RefinedEquations, Refinement, noise_excess, refine,
};
use crate::sindy::robust::Loss;
use crate::sindy::structure::{GateSpec, Lag, Structure};

/// Window lengths relative to the horizon; a shorter window has a smaller share of initial-state errors.
const WINDOW_LENGTHS: [f64; 2] = [1.0, 1.0 / 3.0];

/// Strengths of the prior, relative to the information of the windows.
const PRIOR_STRENGTHS: [f64; 4] = [1.0, 0.1, 0.01, 0.001];

/// Maximum ratio of prediction errors to sensor noise for a refinement: half of the mean square is noise.
///
/// Beyond it, unmodelled forces dominate: errors of multi-step predictions are then correlated, and least squares on
/// them would fit the forces of these particular runs.
const MAX_NOISE_EXCESS: f64 = std::f64::consts::SQRT_2;

impl RefineScope {
    /// Lags and gates of structures that are refined.
    pub(super) fn of(self, structures: &[&Structure]) -> (Vec<Lag>, Vec<GateSpec>) {
        let lags = structures.iter().filter(|_| self.lags).flat_map(|s| s.lags.iter().copied());
        let gates = structures.iter().filter(|_| self.gate).filter_map(|s| s.gate);
        (lags.collect(), gates.collect())
    }
}

pub(super) struct Selected<'a> {
    pub(super) rows: &'a [usize],
    pub(super) fit: Fit,
    pub(super) ensemble: Option<Ensemble>,
    pub(super) score: f64,
}

impl Search<'_> {
    /// Refines the selected equations. The best result replaces them if its score is lower and it is not less stable.
    pub(super) fn refine_selected<'a>(
        &self,
        training: &[&Trajectory],
        grid: &SearchGrid,
        mut selected: Selected<'a>,
        progress: Progress<'_>,
    ) -> Result<(Selected<'a>, Refinement), SearchError> {
        let mut refinement = Refinement::default();
        let Some(scope) = grid.refine else { return Ok((selected, refinement)) };
        refinement.before = selected.score.is_finite().then_some(selected.score);
        let structures: Vec<&Structure> =
            selected.rows.iter().map(|&row| &self.tried[row].trial.structure).collect();
        let (lags, gates) = scope.of(&structures);
        let constraints = constraints_of(grid, &self.variables, &structures, &selected.fit.equations);
        let unbounded = self.stability(&selected.fit.equations).unbounded;
        let mut best: Option<RefinedEquations> = None;
        let excerpts =
            refined_excerpts(training, grid, self.options.evaluation.horizon, self.options.refine_samples);
        let excerpts: Vec<&Trajectory> = excerpts.iter().collect();
        for (index, length) in WINDOW_LENGTHS.into_iter().enumerate() {
            // A positive number far below 2^53.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let horizon = (length * self.options.evaluation.horizon as f64).round().max(2.0) as usize;
            if refinement.attempts.iter().any(|attempt| attempt.horizon == horizon) {
                continue;
            }
            let options = RefineOptions {
                runs: &excerpts,
                ranges: self.options.outputs,
                horizon,
                strengths: &PRIOR_STRENGTHS,
                huber: if let Loss::Huber(bound) = grid.loss { Some(bound) } else { None },
                lags: &lags,
                gates: &gates,
                constraints: &constraints,
            };
            if refinement.excess.is_none() {
                refinement.excess = noise_excess(&options, &selected.fit.equations);
                if refinement.max_excess().is_some_and(|noise_excess| noise_excess > MAX_NOISE_EXCESS)
                    && !scope.always
                {
                    refinement.outcome = Outcome::FarFromNoise;
                    return Ok((selected, refinement));
                }
            }
            let share = |f: f64| (index as f64 + f) / WINDOW_LENGTHS.len() as f64;
            for refined in refine(&options, &selected.fit.equations, &mut |f| progress(share(f)))? {
                let judged = self.score(&refined.equations);
                refinement.attempts.push(Attempt {
                    horizon,
                    strength: refined.strength,
                    steps: refined.steps,
                    score: judged.score.is_finite().then_some(judged.score),
                });
                if judged.score < selected.score && self.stability(&refined.equations).unbounded <= unbounded
                {
                    selected.score = judged.score;
                    refinement.taken = Some(refinement.attempts.len() - 1);
                    best = Some(refined);
                }
            }
        }
        refinement.outcome = match (&best, refinement.attempts.is_empty()) {
            (Some(_), _) => Outcome::Taken,
            (None, true) => Outcome::NoStart,
            (None, false) => Outcome::NoBetter,
        };
        if let Some(refined) = best {
            take_refined(refined.equations, &mut selected.fit, &mut selected.ensemble, &constraints);
        }
        Ok((selected, refinement))
    }
}

/// The training runs of a refinement.
pub(super) fn refined_excerpts(
    training: &[&Trajectory],
    grid: &SearchGrid,
    horizon: usize,
    most: usize,
) -> Vec<Trajectory> {
    let warm_up = training.first().map_or(1, |run| grid.warm_up(run));
    excerpts(training, horizon, warm_up, most)
}

/// Replaces the coefficients of a fit and shifts its ensemble.
pub(super) fn take_refined(
    refined: Equations,
    fit: &mut Fit,
    ensemble: &mut Option<Ensemble>,
    constraints: &Constraints,
) {
    let before = fit.equations.coefficients();
    if let Some(ensemble) = ensemble {
        let by: Vec<f64> = refined.coefficients().iter().zip(before).map(|(new, old)| new - old).collect();
        ensemble.shift(&by, &constraints.signs, refined.terms().len());
    }
    // A contribution is proportional to its coefficient.
    for ((scaled, old), new) in fit.scaled.iter_mut().zip(before).zip(refined.coefficients()) {
        *scaled *= if *old == 0.0 { 1.0 } else { new / old };
    }
    fit.equations = refined;
}

/// The constraints on the terms of equations that may come from several trials, those of `structures`.
pub(super) fn constraints_of(
    grid: &SearchGrid,
    variables: &Variables,
    structures: &[&Structure],
    equations: &Equations,
) -> Constraints {
    let mut constraints = Constraints::default();
    for (output, structure) in structures.iter().enumerate() {
        let own = structure.constraints(&grid.constraints, variables);
        let terms = structure.terms(variables);
        let place = |at: &Coefficient| {
            let term = equations.terms().iter().position(|t| *t == terms[at.term])?;
            Some(Coefficient { equation: at.equation, term })
        };
        let here = |at: &Coefficient| at.equation == output;
        let signs = own.signs.iter().filter(|(at, _)| here(at));
        constraints.signs.extend(signs.filter_map(|(at, sign)| Some((place(at)?, *sign))));
        // Coupled equations come from one trial: each equality is taken once.
        let first = |e: &&Equality| e.weights.first().is_some_and(|(at, _)| here(at));
        for equality in own.equalities.iter().filter(first) {
            let weights = equality.weights.iter().filter_map(|(at, a)| Some((place(at)?, *a))).collect();
            constraints.equalities.push(Equality { weights, value: equality.value });
        }
    }
    constraints
}
