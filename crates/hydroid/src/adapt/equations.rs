//! Adaptation of equations by an extended Kalman filter over outputs and coefficients.

use hydroid_core::adapt::kalman::{
    CovarianceForm, FilterOptions, KalmanEquations, KalmanError, LearnableEquations,
};
use hydroid_core::predict::Predictor;

use super::AdaptError;
use super::kalman::{Kalman, ResolvedKalman};
use crate::log::Trajectory;
use crate::model::{Model, NamedEquations};

impl Kalman {
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

/// Equations, tuning and measurement noise of the filter.
fn tuned(
    model: &Model,
    motion: &NamedEquations<'_>,
    options: &Kalman,
    runs: &[&Trajectory],
) -> Result<(LearnableEquations, FilterOptions, Vec<f64>), AdaptError> {
    let noise = options.noise_of(model, runs)?;
    let ranges = model.description.ranges();
    let learnable = LearnableEquations::new(motion.equations(), &ranges).map_err(AdaptError::Settings)?;
    let dt = model.description.dt;
    let tuning = options.uniform(learnable.places().len(), &noise, learnable.scale(), dt);
    Ok((learnable, tuning, noise))
}

/// The session that adapts equations, and the settings that it was made with. `runs` tell the noise where nothing else
/// does.
pub(super) fn adapter(
    model: &Model,
    motion: &NamedEquations<'_>,
    options: &Kalman,
    runs: &[&Trajectory],
) -> Result<(KalmanEquations, ResolvedKalman), AdaptError> {
    let (learnable, tuning, noise) = tuned(model, motion, options, runs)?;
    let adapter = KalmanEquations::new(learnable, tuning).map_err(KalmanError::Options)?;
    Ok((adapter, options.used(noise)))
}

/// The filter on the outputs only, with constant coefficients.
pub(super) fn filtered(
    model: &Model,
    motion: &NamedEquations<'_>,
    options: &Kalman,
    runs: &[&Trajectory],
) -> Result<Box<dyn Predictor>, AdaptError> {
    let sure = Kalman {
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
