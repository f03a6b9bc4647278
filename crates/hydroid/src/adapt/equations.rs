//! Adaptation of equations by an extended Kalman filter over outputs and coefficients.

use hydroid_core::adapt::kalman::{
    CovarianceForm, FilterOptions, KalmanEquations, KalmanError, LearnableEquations,
};
use hydroid_core::predict::Predictor;

use super::AdaptError;
use super::kalman::{KalmanOptions, ResolvedKalman};
use crate::log::Trajectory;
use crate::model::{Model, NamedEquations};

impl KalmanOptions {
    /// Defaults for equations.
    pub fn of_equations() -> Self {
        Self {
            weight_variance: 1e-3,
            weight_noise_per_s: 1e-6,
            state_noise_per_s: 1e-3,
            noise_factor: 1.0,
            leak_s: f64::INFINITY,
            ..Self::default()
        }
    }
}

fn filter_parts(
    model: &Model,
    motion: &NamedEquations<'_>,
    options: &KalmanOptions,
    runs: &[&Trajectory],
) -> Result<(LearnableEquations, FilterOptions, Vec<f64>), AdaptError> {
    let noise = options.noise_of(model, runs)?;
    let ranges = model.description.ranges();
    let learnable = LearnableEquations::new(motion.equations(), &ranges).map_err(AdaptError::Options)?;
    let dt = model.description.dt;
    let filter = options.uniform(learnable.places().len(), &noise, learnable.scale(), dt);
    Ok((learnable, filter, noise))
}

/// Adapter of equations and its resolved options. `runs` give the noise if options and model do not.
pub(super) fn adapter(
    model: &Model,
    motion: &NamedEquations<'_>,
    options: &KalmanOptions,
    runs: &[&Trajectory],
) -> Result<(KalmanEquations, ResolvedKalman), AdaptError> {
    let (learnable, filter, noise) = filter_parts(model, motion, options, runs)?;
    let adapter = KalmanEquations::new(learnable, filter).map_err(KalmanError::Options)?;
    Ok((adapter, options.resolved(noise)))
}

/// The filter on the outputs only, with constant coefficients.
pub(super) fn filtered(
    model: &Model,
    motion: &NamedEquations<'_>,
    options: &KalmanOptions,
    runs: &[&Trajectory],
) -> Result<Box<dyn Predictor>, AdaptError> {
    let sure = KalmanOptions {
        weight_variance: 0.0,
        weight_noise_per_s: 0.0,
        leak_s: f64::INFINITY,
        forgetting_s: f64::INFINITY,
        covariance: CovarianceForm::Full,
        ..options.clone()
    };
    let (session, _) = adapter(model, motion, &sure, runs)?;
    Ok(Box::new(session))
}
