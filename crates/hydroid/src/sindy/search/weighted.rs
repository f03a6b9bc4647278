//! Fits of trials, with the weights of the noise that the equations propagate where the grid states the noise.

use super::{SearchError, SearchGrid, TrialSettings, Variables, fit_options, prepare};
use crate::log::Trajectory;
use crate::sindy::error::FitError;
use crate::sindy::fit::{Fit, LinearRegression};
use crate::sindy::parsimony::combine_equations;
use crate::sindy::propagated_noise::propagated_noise;

impl TrialSettings<'_> {
    /// Equations from the regression of the trial.
    pub(super) fn fit(
        self,
        runs: &[&Trajectory],
        variables: &Variables,
        grid: &SearchGrid,
        prepared: &LinearRegression,
    ) -> Result<Fit, SearchError> {
        let constraints = self.structure.constraints(&grid.constraints, variables);
        let dt = runs.first().map_or(1.0, |run| run.dt);
        let fit = prepared.fit(&fit_options(self.optimizer, self.ridge, dt, &constraints))?;
        if grid.noise.is_none() { Ok(fit) } else { Ok(self.weighted(runs, variables, grid, &fit)?.0) }
    }

    /// Fits again on rows that are weighted by the noise of `fit`. Also the mean squared residual of each equation, relative to
    /// that noise.
    fn weighted(
        self,
        runs: &[&Trajectory],
        variables: &Variables,
        grid: &SearchGrid,
        fit: &Fit,
    ) -> Result<(Fit, Vec<f64>), SearchError> {
        let deviations = grid.noise.as_deref().unwrap_or_default();
        let constraints = self.structure.constraints(&grid.constraints, variables);
        let options = fit_options(self.optimizer, self.ridge, fit.equations.dt(), &constraints);
        let noise = propagated_noise(runs, self.regression, deviations, &fit.equations)?;
        let fits = noise.iter().map(|noise| {
            let rows =
                prepare(runs, variables, self.structure, self.regression, (grid.loss, 0), &noise.weights)?;
            Ok(rows.fit(&options)?)
        });
        let fits: Vec<Fit> = fits.collect::<Result<_, SearchError>>()?;
        let excess = fits.iter().zip(&noise).enumerate();
        let excess =
            excess.map(|(i, (fit, noise))| fit.residual_rms[i].powi(2) * noise.mean_inverse).collect();
        let rows: Vec<&Fit> = fits.iter().collect();
        Ok((combine_equations(&rows).map_err(FitError::from)?, excess))
    }
}

/// Mean squared residual of each equation of the first trial of a grid, relative to the noise that the equations propagate:
/// 1 for true equations.
///
/// # Errors
/// If the grid is empty, or its first trial cannot be fitted.
pub fn noise_ratio(training: &[&Trajectory], grid: &SearchGrid) -> Result<Vec<f64>, SearchError> {
    let run = training.first().ok_or(SearchError::Empty)?;
    let variables = Variables::of(run);
    let first =
        (grid.structures.first(), grid.regressions.first(), grid.optimizers.first(), grid.ridges.first());
    let (Some(structure), Some(&regression), Some(&optimizer), Some(&ridge)) = first else {
        return Err(SearchError::Empty);
    };
    let settings = TrialSettings { structure, regression, optimizer, ridge };
    let prepared = prepare(training, &variables, structure, regression, (grid.loss, 0), &[])?;
    let fit = settings.fit(training, &variables, grid, &prepared)?;
    Ok(settings.weighted(training, &variables, grid, &fit)?.1)
}
