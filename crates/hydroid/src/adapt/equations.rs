//! Equations: an extended Kalman filter over outputs and coefficients.
//!
//! # How the defaults were chosen
//!
//! On simulated vessels alone: the simple one, whose drag grows by 1.6 on the way, has been larger all along, or stays; and
//! the hydrofoil under linear equations, which miss most of it. Initial variances of the weights of 0.0003, 0.001, 0.01
//! (little between them; 0.01 costs where nothing changes), noise of 1e-8 to 1e-4 (below 3e-7 a change is followed late, from
//! 1e-5 on a steady vessel is made worse), of the state of 1e-7 to 1e-2: the less, the better the bands and the outputs
//! where the equations are right, and where they are not, the filter believes them until rollouts run away (1e-6). 0.001 is
//! between these; equations that are known to be poor want 0.01.

use hydroid_core::adapt::kalman::{KalmanEquations, KalmanError, LearnableEquations, Memory, Tuning};
use hydroid_core::predict::Predictor;

use super::AdaptError;
use super::kalman::{Kalman, UsedKalman, Which};
use crate::log::Trajectory;
use crate::model::{Model, NamedEquations};

impl Kalman {
    /// For equations that learn by the filter; chosen on simulated vessels.
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

/// The equations as the filter has them, its tuning, and the noise that it takes.
fn tuned(
    model: &Model,
    motion: &NamedEquations<'_>,
    options: &Kalman,
    runs: &[&Trajectory],
) -> Result<(LearnableEquations, Tuning, Vec<f64>), AdaptError> {
    if options.weights != Which::All {
        return Err(AdaptError::OnlyNetworks { what: "a choice of the layers that learn" });
    }
    if options.single_precision {
        return Err(AdaptError::OnlyNetworks { what: "single precision" });
    }
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
) -> Result<(KalmanEquations, UsedKalman), AdaptError> {
    let (learnable, tuning, noise) = tuned(model, motion, options, runs)?;
    let adapter = KalmanEquations::new(learnable, tuning).map_err(KalmanError::Tuning)?;
    Ok((adapter, options.used(noise)))
}

/// The same filter on the outputs alone: of the coefficients it is sure.
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
        memory: Memory::Full,
        ..options.clone()
    };
    let (session, _) = adapter(model, motion, &sure, runs)?;
    Ok(Box::new(session))
}
