//! The chosen equations refined by their predictions, if that makes these better.

use super::{Bench, Grid, SearchError};
use crate::log::Trajectory;
use crate::progress::Progress;
use crate::sindy::constraints::{Coefficient, Constraints, Equality};
use crate::sindy::ensemble::Ensemble;
use crate::sindy::fit::Fit;
use crate::sindy::refine::{Attempt, Outcome, Refined, Refinement, Refining, excess, refine};
use crate::sindy::robust::Loss;
use crate::sindy::structure::{Lag, Schedule};

/// Lengths of the windows, in horizons: what the model is judged on, and shorter ones, which hold less of the starts' and
/// of other errors. On ten records of the hydrofoil each was taken at times.
const LENGTHS: [f64; 2] = [1.0, 1.0 / 3.0];

/// Strengths of the pull towards the regression's estimate: from as much as the windows say of a parameter to next to
/// none.
const STRENGTHS: [f64; 4] = [1.0, 0.1, 0.01, 0.001];

/// Refinement is tried where predictions miss the measurements of every output by at most so many standard deviations of
/// its sensor's noise: at the root of two, that noise makes half of the mean square.
///
/// Beyond it something else makes more than half of the errors, and if that is forces that no term has, errors of
/// predictions are correlated over a window, least squares on them are no longer the most likely estimate, and what they
/// fit is the forces of these runs. On simulated records of 5, 10 and 120 minutes of the hydrofoil and 10 of the simple
/// vessel the worst output was at 1.01 to 1.27.
const NEAR_NOISE: f64 = std::f64::consts::SQRT_2;

/// Equations with what is known of them.
pub(super) struct Candidate<'a> {
    /// The trial that each equation comes from.
    pub(super) rows: &'a [usize],
    pub(super) fit: Fit,
    pub(super) ensemble: Option<Ensemble>,
    pub(super) score: f64,
}

impl Bench<'_> {
    /// Refines the candidate with several settings. The one that predicts best takes its place, if it predicts better
    /// than the candidate and is not less stable.
    pub(super) fn improve<'a>(
        &self,
        training: &[&Trajectory],
        grid: &Grid,
        mut candidate: Candidate<'a>,
        progress: Progress<'_>,
    ) -> Result<(Candidate<'a>, Refinement), SearchError> {
        let mut refinement = Refinement::default();
        let Some(free) = grid.refine else { return Ok((candidate, refinement)) };
        refinement.before = candidate.score.is_finite().then_some(candidate.score);
        let structures = || candidate.rows.iter().map(|&row| &self.tried[row].trial.structure);
        let lags: Vec<Lag> =
            structures().filter(|_| free.lags).flat_map(|s| s.lags.iter().copied()).collect();
        let gates: Vec<Schedule> = structures().filter(|_| free.gate).filter_map(|s| s.gate).collect();
        let constraints = self.rules(grid, &candidate);
        let unbounded = self.screen(&candidate.fit.equations).unbounded;
        let mut best: Option<Refined> = None;
        for (index, length) in LENGTHS.into_iter().enumerate() {
            // A positive number far below 2^53.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let horizon = (length * self.judge.options.horizon as f64).round().max(2.0) as usize;
            if refinement.attempts.iter().any(|attempt| attempt.horizon == horizon) {
                continue;
            }
            let refining = Refining {
                runs: training,
                ranges: self.judge.outputs,
                horizon,
                strengths: &STRENGTHS,
                huber: if let Loss::Huber(bound) = grid.loss { Some(bound) } else { None },
                lags: &lags,
                gates: &gates,
                constraints: &constraints,
            };
            if refinement.excess.is_none() {
                refinement.excess = excess(&refining, &candidate.fit.equations);
                if refinement.largest().is_some_and(|excess| excess > NEAR_NOISE) && !free.anywhere {
                    refinement.outcome = Outcome::FarFromNoise;
                    return Ok((candidate, refinement));
                }
            }
            let share = |f: f64| (index as f64 + f) / LENGTHS.len() as f64;
            for refined in refine(&refining, &candidate.fit.equations, &mut |f| progress(share(f)))? {
                let judged = self.judge(&refined.equations)?;
                refinement.attempts.push(Attempt {
                    horizon,
                    strength: refined.strength,
                    steps: refined.steps,
                    score: judged.score.is_finite().then_some(judged.score),
                });
                if judged.score < candidate.score && self.screen(&refined.equations).unbounded <= unbounded {
                    candidate.score = judged.score;
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
            if let Some(ensemble) = &mut candidate.ensemble {
                let old = candidate.fit.equations.coefficients();
                let by: Vec<f64> =
                    refined.equations.coefficients().iter().zip(old).map(|(new, old)| new - old).collect();
                ensemble.moved(&by, &constraints.signs, refined.equations.terms().len());
            }
            // A contribution is in proportion to its coefficient.
            let before = candidate.fit.equations.coefficients();
            for ((scaled, old), new) in
                candidate.fit.scaled.iter_mut().zip(before).zip(refined.equations.coefficients())
            {
                *scaled *= if *old == 0.0 { 1.0 } else { new / old };
            }
            candidate.fit.equations = refined.equations;
        }
        Ok((candidate, refinement))
    }

    /// The rules on the terms of equations that may come from several trials.
    fn rules(&self, grid: &Grid, candidate: &Candidate<'_>) -> Constraints {
        let mut rules = Constraints::default();
        for (output, &row) in candidate.rows.iter().enumerate() {
            let structure = &self.tried[row].trial.structure;
            let own = structure.constraints(&grid.constraints, &self.variables);
            let terms = structure.terms(&self.variables);
            let place = |at: &Coefficient| {
                let term = candidate.fit.equations.terms().iter().position(|t| *t == terms[at.term])?;
                Some(Coefficient { equation: at.equation, term })
            };
            let here = |at: &Coefficient| at.equation == output;
            let signs = own.signs.iter().filter(|(at, _)| here(at));
            rules.signs.extend(signs.filter_map(|(at, sign)| Some((place(at)?, *sign))));
            // Equations that are tied together come from one trial: each relation is taken once.
            let first = |e: &&Equality| e.weights.first().is_some_and(|(at, _)| here(at));
            for equality in own.equalities.iter().filter(first) {
                let weights = equality.weights.iter().filter_map(|(at, a)| Some((place(at)?, *a))).collect();
                rules.equalities.push(Equality { weights, value: equality.value });
            }
        }
        rules
    }
}
