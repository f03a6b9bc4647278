//! Options of a simulation.

use hydroid_core::craft::Craft;

use super::error::SimulateError;
use crate::excitation::Excitation;

/// Options of a simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The vessel, with [one propeller and one rudder](crate::excitation::PropellerRudder).
    pub vessel: Craft,
    /// Excitation.
    pub excitation: Excitation,
    /// Duration \[s\]; one sample per `dt_s`. A lawn-mower with given speeds ends after its last leg.
    pub duration_s: f64,
    /// Sample time \[s\]; commands are held for it.
    pub dt_s: f64,
    /// Integration step \[s\]; the sample time is a whole multiple.
    pub step_s: f64,
    /// Seed of commands and noise.
    pub seed: u64,
    /// Scale of the vessel's measurement noise; 0 for none.
    pub noise_scale: f64,
    /// Velocity of the water, north and east \[m/s\]: constant and uniform. Pose and velocities are over ground.
    pub current: [f64; 2],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) samples: usize,
    pub(crate) substeps: u32,
}

/// Largest number of samples.
const MOST_SAMPLES: f64 = 5e7;

impl Options {
    /// Defaults of the thesis: 7,200 s, samples of 0.1 s, integration step 10 ms, noise of the vessel, seed 0, still
    /// water.
    pub const fn new(vessel: Craft, excitation: Excitation) -> Self {
        Self {
            vessel,
            excitation,
            duration_s: 7_200.0,
            dt_s: 0.1,
            step_s: 0.01,
            seed: 0,
            noise_scale: 1.0,
            current: [0.0; 2],
        }
    }

    /// Checks the options; returns the number of samples and of integration steps in each.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive and bounded by the checks
    pub(crate) fn counts(&self) -> Result<Counts, SimulateError> {
        for (what, value) in [
            ("the duration", self.duration_s),
            ("the sample time", self.dt_s),
            ("the integration step", self.step_s),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(SimulateError::Option {
                    what,
                    value,
                    needed: "seconds greater than 0 are needed",
                });
            }
        }
        if !(self.noise_scale.is_finite() && self.noise_scale >= 0.0) {
            return Err(SimulateError::Option {
                what: "the scale of the noise",
                value: self.noise_scale,
                needed: "0 for none, 1 for the vessel's own",
            });
        }
        if let Some(value) = self.current.into_iter().find(|value| !value.is_finite()) {
            let needed = "a velocity in m/s is needed";
            return Err(SimulateError::Option { what: "the current", value, needed });
        }
        let substeps = (self.dt_s / self.step_s).round();
        let whole = (substeps * self.step_s - self.dt_s).abs() <= 1e-9 * self.dt_s;
        if !whole || !(1.0..=1e6).contains(&substeps) {
            return Err(SimulateError::Substeps { dt_s: self.dt_s, step_s: self.step_s });
        }
        let samples = (self.duration_s / self.dt_s).round();
        if !(1.0..=MOST_SAMPLES).contains(&samples) {
            return Err(SimulateError::Option {
                what: "the duration",
                value: self.duration_s,
                needed: "it must hold between one and 50 million samples",
            });
        }
        Ok(Counts { samples: samples as usize, substeps: substeps as u32 })
    }
}
