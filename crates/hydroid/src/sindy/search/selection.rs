//! Choice of the equations among the trials, output by output, and their bootstrap ensemble.

use super::refinement::Selected;
use super::{
    Search, SearchError, SearchGrid, SearchResult, Trial, TrialScore, Variables, fit_options, prepare,
};
use crate::log::Trajectory;
use crate::progress::Progress;
use crate::sindy::ensemble::{BootstrapOptions, Ensemble};
use crate::sindy::fit::Fit;
use crate::sindy::parsimony::combine_equations;
use crate::sindy::propagated_noise::propagated_noise;
use crate::sindy::structure_constraints::couples_outputs;

/// Number of other trials whose equation of one output is tried in place of the selected one.
const MAX_SWAPS: usize = 12;

/// A stable model is preferred to an unstable one if its score is worse by at most this factor.
const STABILITY_TOLERANCE: f64 = 1.1;

const BOOTSTRAP_BLOCKS: usize = 24;

impl Search<'_> {
    /// Trials within one standard error of the best by their number of parameters, then the others by score.
    fn preference(&self) -> Vec<usize> {
        let score = |i: usize| self.tried[i].trial.score.unwrap_or(f64::INFINITY);
        let mut order: Vec<usize> = self.finalists().collect();
        order.sort_by(|&a, &b| score(a).total_cmp(&score(b)));
        let Some(&best) = order.first() else { return order };
        let alike = |i: usize| self.tried[i].losses.is_within_one_standard_error(&self.tried[best].losses);
        let (mut simple, rest): (Vec<usize>, Vec<usize>) = order.into_iter().partition(|&i| alike(i));
        simple.sort_by_key(|&i| self.tried[i].trial.terms + self.tried[i].trial.structure.parameters());
        simple.extend(rest);
        simple
    }

    pub(super) fn select(
        &self,
        training: &[&Trajectory],
        grid: &SearchGrid,
        progress: Progress<'_>,
    ) -> Result<SearchResult, SearchError> {
        let preference = self.preference();
        let score = |i: usize| self.tried[i].trial.score.unwrap_or(f64::INFINITY);
        let best = preference.iter().map(|&i| score(i)).fold(f64::INFINITY, f64::min);
        let bounded = |i: &&usize| self.stability(&self.tried[**i].fit.equations).is_bounded();
        let comparable = preference.iter().filter(|&&i| score(i) <= STABILITY_TOLERANCE * best);
        let chosen = comparable.clone().find(bounded).or(comparable.clone().next()).copied().unwrap_or(0);
        // Equations that constraints couple come from one fit.
        let coupled = grid.constraints.iter().any(couples_outputs);
        let others: &[usize] = if coupled { &[] } else { &preference };
        let (equations, fit, score) = self.select_by_output(chosen, others);
        let trials: Vec<&Trial> = equations.iter().map(|&i| &self.tried[i].trial).collect();
        let bootstrap = (self.options.ensemble_size, self.options.seed);
        let ensemble = ensemble(training, grid, &trials, &fit, bootstrap)?;
        let candidate = Selected { rows: &equations, fit, ensemble, score };
        let (refined, refinement) = self.refine_selected(training, grid, candidate, progress)?;
        let Selected { fit, ensemble, score, .. } = refined;
        let winner = &self.tried[chosen];
        let lost = winner.prepared.unidentifiable();
        let independent: Vec<usize> =
            (0..winner.prepared.terms().len()).filter(|j| !lost.contains(j)).collect();
        Ok(SearchResult {
            stability: self.stability(&fit.equations),
            chosen,
            equations,
            score,
            condition: winner.prepared.condition(&independent),
            unidentifiable: lost.iter().map(|&j| winner.prepared.terms()[j].clone()).collect(),
            rows: (winner.prepared.rows(), winner.prepared.skipped()),
            trials: self.tried.iter().map(|tried| tried.trial.clone()).collect(),
            ensemble,
            refinement,
            fit,
            grid: grid.clone(),
            noise_ratio: None,
        })
    }

    /// Replaces the equation of each output by that of another trial, if significantly better and not less stable.
    fn select_by_output(&self, chosen: usize, preference: &[usize]) -> (Vec<usize>, Fit, f64) {
        let outputs = self.variables.outputs().count();
        let mut rows = vec![chosen; outputs];
        let mut fit = self.tried[chosen].fit.clone();
        let mut losses = self.tried[chosen].losses.clone();
        let mut score = self.tried[chosen].trial.score.unwrap_or(f64::INFINITY);
        let signals = fit.equations.signals().to_vec();
        for output in 0..outputs {
            let mut known: Vec<Vec<f64>> = vec![self.equation(chosen, output)];
            let mut best: Option<(usize, Fit, TrialScore)> = None;
            for &other in preference {
                if known.len() > MAX_SWAPS {
                    break;
                }
                let equation = self.equation(other, output);
                if self.tried[other].fit.equations.signals() != signals || known.contains(&equation) {
                    continue;
                }
                known.push(equation);
                let mut next = rows.clone();
                next[output] = other;
                let fits: Vec<&Fit> = next.iter().map(|&i| &self.tried[i].fit).collect();
                let Ok(composed) = combine_equations(&fits) else { continue };
                let judged = self.score(&composed.equations);
                let ahead = best.as_ref().map_or(score, |(_, _, best)| best.score);
                if judged.score < ahead && judged.losses.is_significantly_better(&losses) {
                    best = Some((other, composed, judged));
                }
            }
            if let Some((other, composed, judged)) = best
                && self.stability(&composed.equations).unbounded <= self.stability(&fit.equations).unbounded
            {
                rows[output] = other;
                (fit, losses, score) = (composed, judged.losses, judged.score);
            }
        }
        (rows, fit, score)
    }

    fn equation(&self, trial: usize, output: usize) -> Vec<f64> {
        let fit = &self.tried[trial].fit;
        let terms = fit.equations.terms().len();
        fit.equations.coefficients()[output * terms..(output + 1) * terms].to_vec()
    }
}

/// The bootstrap ensemble of equations, over their terms; `trials` are those of the equations.
pub(super) fn ensemble(
    training: &[&Trajectory],
    grid: &SearchGrid,
    trials: &[&Trial],
    fit: &Fit,
    (resamples, seed): (usize, u64),
) -> Result<Option<Ensemble>, SearchError> {
    let Some(run) = training.first().filter(|_| resamples > 0) else { return Ok(None) };
    let variables = Variables::of(run);
    let terms = fit.equations.terms();
    let bootstrap = BootstrapOptions { resamples, seed, ..BootstrapOptions::default() };
    let mut whole = Ensemble::zero(resamples, trials.len(), terms.len());
    let noise = match (&grid.noise, trials.first()) {
        (Some(noise), Some(trial)) => propagated_noise(training, trial.regression, noise, &fit.equations)?,
        _ => Vec::new(),
    };
    for (output, trial) in trials.iter().enumerate() {
        let Trial { structure, regression, .. } = trial;
        let weights = noise.get(output).map_or(&[][..], |noise| &noise.weights);
        let groups = (grid.loss, BOOTSTRAP_BLOCKS);
        let prepared = prepare(training, &variables, structure, *regression, groups, weights)?;
        let constraints = structure.constraints(&grid.constraints, &variables);
        let options = fit_options(trial.optimizer, trial.ridge, run.dt, &constraints);
        let ensemble = prepared.ensemble(&options, &bootstrap)?;
        let places: Vec<Option<usize>> =
            prepared.terms().iter().map(|term| terms.iter().position(|known| known == term)).collect();
        whole.replace_equation(output, &ensemble, &places);
    }
    Ok(Some(whole))
}
