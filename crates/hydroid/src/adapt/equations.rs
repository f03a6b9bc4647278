//! Adaptation of equations by an extended Kalman filter over outputs and coefficients.

use hydroid_core::adapt::kalman::{KalmanEquations, KalmanError, LearnableEquations};

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

/// Adapter of equations and its resolved options. `runs` give the noise if options and model do not.
pub(super) fn adapter(
    model: &Model,
    motion: &NamedEquations<'_>,
    options: &KalmanOptions,
    runs: &[&Trajectory],
) -> Result<(KalmanEquations, ResolvedKalman), AdaptError> {
    let noise = options.noise_of(model, runs)?;
    let ranges = model.description.ranges();
    let learnable = LearnableEquations::new(motion.equations(), &ranges).map_err(AdaptError::Options)?;
    let dt = model.description.dt;
    let filter = options.uniform(learnable.places().len(), &noise, learnable.scale(), dt);
    let adapter = KalmanEquations::new(learnable, filter).map_err(KalmanError::Options)?;
    Ok((adapter, options.resolved(noise)))
}
