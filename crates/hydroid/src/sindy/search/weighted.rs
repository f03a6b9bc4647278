//! Fits of trials, and those on rows that are weighted by the noise that the equations propagate.

use super::{SearchError, SearchGrid, TrialSettings, Variables, fit_options, prepare};
use crate::log::Trajectory;
use crate::sindy::constraints::Constraints;
use crate::sindy::fit::{Fit, LinearRegression};
use crate::sindy::propagated_noise::{PropagatedNoise, propagated_noise};

impl TrialSettings<'_> {
    /// Equations from the regression of the trial. With the noise of the grid, each is the best subset on rows that are weighted by
    /// the noise of the equations of equal weights.
    pub(super) fn fit(
        self,
        runs: &[&Trajectory],
        variables: &Variables,
        grid: &SearchGrid,
        prepared: &LinearRegression,
        constraints: &Constraints,
    ) -> Result<Fit, SearchError> {
        let dt = runs.first().map_or(1.0, |run| run.dt);
        let options = fit_options(self.optimizer, self.ridge, dt, constraints);
        let fit = prepared.fit(&options)?;
        let Some(deviations) = &grid.noise else { return Ok(fit) };
        let noise = propagated_noise(runs, self.regression, deviations, &fit.equations)?;
        let mut coefficients = Vec::with_capacity(fit.scaled.len());
        for (equation, noise) in noise.iter().enumerate() {
            let rows =
                prepare(runs, variables, self.structure, self.regression, (grid.loss, 0), &noise.weights)?;
            coefficients.extend(rows.best_subset(equation));
        }
        Ok(prepared.with_coefficients(coefficients, options.substeps)?)
    }

    /// Mean squared residual of each equation relative to the noise that the equations propagate, for each degree of freedom: 1 for
    /// true equations. The equations have the terms of the trial.
    fn noise_ratio(
        self,
        runs: &[&Trajectory],
        variables: &Variables,
        grid: &SearchGrid,
        fit: &Fit,
    ) -> Result<Vec<f64>, SearchError> {
        let deviations = grid.noise.as_deref().unwrap_or_default();
        let noise = propagated_noise(runs, self.regression, deviations, &fit.equations)?;
        let count = fit.equations.terms().len();
        let ratio = |(equation, noise): (usize, &PropagatedNoise)| {
            let rows =
                prepare(runs, variables, self.structure, self.regression, (grid.loss, 0), &noise.weights)?;
            let own = &fit.equations.coefficients()[equation * count..(equation + 1) * count];
            let used = own.iter().filter(|c| **c != 0.0).count() as f64;
            let free = 1.0 - used / rows.effective_rows();
            Ok(rows.residual_rms(equation, own).powi(2) * noise.mean_inverse / free)
        };
        noise.iter().enumerate().map(ratio).collect()
    }
}

/// Mean squared residual of each equation relative to the noise that the equations propagate, for each degree of freedom: 1 for
/// true equations. The equations are those of `fit` with the terms of the only trial of a grid that states the noise; without
/// `fit`, they are fitted.
///
/// # Errors
/// If the grid is empty, or its trial cannot be fitted.
pub fn noise_ratio(
    runs: &[&Trajectory],
    grid: &SearchGrid,
    fit: Option<&Fit>,
) -> Result<Vec<f64>, SearchError> {
    let run = runs.first().ok_or(SearchError::Empty)?;
    let variables = Variables::of(run);
    let first =
        (grid.structures.first(), grid.regressions.first(), grid.optimizers.first(), grid.ridges.first());
    let (Some(structure), Some(&regression), Some(&optimizer), Some(&ridge)) = first else {
        return Err(SearchError::Empty);
    };
    let settings = TrialSettings { structure, regression, optimizer, ridge };
    if let Some(fit) = fit {
        return settings.noise_ratio(runs, &variables, grid, fit);
    }
    let prepared = prepare(runs, &variables, structure, regression, (grid.loss, 0), &[])?;
    let fit = settings.fit(runs, &variables, grid, &prepared, &Constraints::default())?;
    settings.noise_ratio(runs, &variables, grid, &fit)
}
