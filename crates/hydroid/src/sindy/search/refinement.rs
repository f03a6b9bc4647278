//! Refinement of the selected equations by multi-step prediction errors, accepted only if the predictions improve.

use super::{Search, SearchError, SearchGrid};
use crate::log::Trajectory;
use crate::progress::Progress;
use crate::sindy::constraints::{Coefficient, Constraints, Equality};
use crate::sindy::ensemble::Ensemble;
use crate::sindy::fit::Fit;
use crate::sindy::refine::{
    Attempt, Outcome, RefineOptions, RefinedEquations, Refinement, noise_excess, refine,
};
use crate::sindy::robust::Loss;
use crate::sindy::structure::{GateSpec, Lag};

/// Window lengths relative to the horizon; a shorter window has a smaller share of initial-state errors.
const WINDOW_LENGTHS: [f64; 2] = [1.0, 1.0 / 3.0];

/// Strengths of the prior, relative to the information of the windows.
const PRIOR_STRENGTHS: [f64; 4] = [1.0, 0.1, 0.01, 0.001];

/// Maximum ratio of prediction errors to sensor noise for a refinement: half of the mean square is noise.
///
/// Beyond it, unmodelled forces dominate: errors of multi-step predictions are then correlated, and least squares on
/// them would fit the forces of these particular runs.
const MAX_NOISE_EXCESS: f64 = std::f64::consts::SQRT_2;

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
        let structures = || selected.rows.iter().map(|&row| &self.tried[row].trial.structure);
        let lags: Vec<Lag> =
            structures().filter(|_| scope.lags).flat_map(|s| s.lags.iter().copied()).collect();
        let gates: Vec<GateSpec> = structures().filter(|_| scope.gate).filter_map(|s| s.gate).collect();
        let constraints = self.constraints_of(grid, &selected);
        let unbounded = self.stability(&selected.fit.equations).unbounded;
        let mut best: Option<RefinedEquations> = None;
        for (index, length) in WINDOW_LENGTHS.into_iter().enumerate() {
            // A positive number far below 2^53.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let horizon = (length * self.options.evaluation.horizon as f64).round().max(2.0) as usize;
            if refinement.attempts.iter().any(|attempt| attempt.horizon == horizon) {
                continue;
            }
            let options = RefineOptions {
                runs: training,
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
                let judged = self.score(&refined.equations)?;
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
            if let Some(ensemble) = &mut selected.ensemble {
                let old = selected.fit.equations.coefficients();
                let by: Vec<f64> =
                    refined.equations.coefficients().iter().zip(old).map(|(new, old)| new - old).collect();
                ensemble.shift(&by, &constraints.signs, refined.equations.terms().len());
            }
            // A contribution is proportional to its coefficient.
            let before = selected.fit.equations.coefficients();
            for ((scaled, old), new) in
                selected.fit.scaled.iter_mut().zip(before).zip(refined.equations.coefficients())
            {
                *scaled *= if *old == 0.0 { 1.0 } else { new / old };
            }
            selected.fit.equations = refined.equations;
        }
        Ok((selected, refinement))
    }

    /// The constraints on the terms of equations that may come from several trials.
    fn constraints_of(&self, grid: &SearchGrid, selected: &Selected<'_>) -> Constraints {
        let mut constraints = Constraints::default();
        for (output, &row) in selected.rows.iter().enumerate() {
            let structure = &self.tried[row].trial.structure;
            let own = structure.constraints(&grid.constraints, &self.variables);
            let terms = structure.terms(&self.variables);
            let place = |at: &Coefficient| {
                let term = selected.fit.equations.terms().iter().position(|t| *t == terms[at.term])?;
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
}
