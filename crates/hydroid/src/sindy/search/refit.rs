//! The equations of a search, fitted to other runs.

use super::refinement::{constraints_of, refined_excerpts, take_refined};
use super::selection::ensemble;
use super::{SearchError, SearchResult, Trial, TrialSettings, Variables, prepare};
use crate::evaluate::DesignRange;
use crate::log::Trajectory;
use crate::progress;
use crate::sindy::ensemble::Ensemble;
use crate::sindy::fit::Fit;
use crate::sindy::parsimony::combine_equations;
use crate::sindy::refine::{Attempt, RefineOptions, refine};
use crate::sindy::robust::Loss;
use crate::sindy::structure::Structure;

/// Fits equations with the settings of a search to `runs`: library, lags, gate, form of the regression, method of term
/// selection, ridge penalty and refinement of each equation. Terms are selected and coefficients fitted again.
/// `resamples` is the size of the bootstrap ensemble, `seed` its seed, and `refine_samples` the largest number of samples
/// for the refinement.
///
/// # Errors
/// If the equations cannot be fitted.
pub fn refit(
    found: &SearchResult,
    runs: &[&Trajectory],
    outputs: &[DesignRange],
    (resamples, seed): (usize, u64),
    refine_samples: usize,
) -> Result<(Fit, Option<Ensemble>), SearchError> {
    let run = runs.first().ok_or(SearchError::Empty)?;
    let grid = &found.grid;
    let variables = Variables::of(run);
    let mut fitted: Vec<(usize, Fit)> = Vec::new();
    for &index in &found.equations {
        if fitted.iter().all(|(known, _)| *known != index) {
            let Trial { structure, regression, optimizer, ridge, .. } = &found.trials[index];
            let (regression, optimizer, ridge) = (*regression, *optimizer, *ridge);
            let settings = TrialSettings { structure, regression, optimizer, ridge };
            let prepared = prepare(runs, &variables, structure, regression, (grid.loss, 0), &[])?;
            let constraints = structure.constraints(&grid.constraints, &variables);
            fitted.push((index, settings.fit(runs, &variables, grid, &prepared, &constraints)?));
        }
    }
    let of = |index: &usize| fitted.iter().find(|(known, _)| known == index).map(|(_, fit)| fit);
    let rows: Vec<&Fit> = found.equations.iter().filter_map(of).collect();
    let mut fit = combine_equations(&rows).map_err(crate::sindy::error::FitError::from)?;
    let trials: Vec<&Trial> = found.equations.iter().map(|&index| &found.trials[index]).collect();
    let mut members = ensemble(runs, grid, &trials, &fit, (resamples, seed))?;
    let Some((taken, scope)) = found.refinement.taken.zip(grid.refine) else { return Ok((fit, members)) };
    let Attempt { horizon, strength, .. } = found.refinement.attempts[taken];
    let structures: Vec<&Structure> = trials.iter().map(|trial| &trial.structure).collect();
    let (lags, gates) = scope.of(&structures);
    let constraints = constraints_of(grid, &variables, &structures, &fit.equations);
    let excerpts = refined_excerpts(runs, grid, horizon, refine_samples);
    let excerpts: Vec<&Trajectory> = excerpts.iter().collect();
    let options = RefineOptions {
        runs: &excerpts,
        ranges: outputs,
        horizon,
        strengths: &[strength],
        huber: if let Loss::Huber(bound) = grid.loss { Some(bound) } else { None },
        lags: &lags,
        gates: &gates,
        constraints: &constraints,
    };
    // Without a result the estimate of the regression remains.
    if let Some(refined) = refine(&options, &fit.equations, &mut progress::silent())?.pop() {
        take_refined(refined.equations, &mut fit, &mut members, &constraints);
    }
    Ok((fit, members))
}
