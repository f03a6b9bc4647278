//! Top speed and response time from a vessel's parameters.

use hydroid_core::vessel::{Plant, VesselParams};

use super::error::ExcitationError;

/// Top speed and response time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope {
    /// Speed on a straight course under full propeller force \[m/s\].
    pub top_speed: f64,
    /// Response time to a propeller command \[s\]: the lag plus the time to top speed under full force without drag.
    pub time_s: f64,
}

/// Speed \[m/s\] above which the drag is considered missing.
const ABSURD_SPEED: f64 = 1e3;
/// Start of the search for the top speed \[m/s\].
const FINEST: f64 = 1e-3;

impl Envelope {
    /// The envelope of a vessel.
    ///
    /// # Errors
    /// [`ExcitationError::NoForwardForce`] where the propeller's upper limit is not positive,
    /// [`ExcitationError::NoDrag`] where nothing would stop the vessel from accelerating.
    pub fn new(params: &VesselParams, plant: &Plant) -> Result<Self, ExcitationError> {
        let force = params.commands.propeller.limits[1];
        if force <= 0.0 {
            return Err(ExcitationError::NoForwardForce { limit: force });
        }
        // The holding force of a hydrofoil is not monotone: scan for the last speed that full force holds, then bisect.
        let mut held = 0.0;
        let mut u = FINEST;
        while u <= ABSURD_SPEED {
            if plant.holding_force(u) <= force {
                held = u;
            } else if u > 4.0 * held.max(FINEST) {
                break;
            }
            u *= 1.01;
        }
        if held * 1.01 > ABSURD_SPEED {
            return Err(ExcitationError::NoDrag);
        }
        let (mut low, mut high) = (held, held.max(FINEST) * 1.01);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if plant.holding_force(middle) <= force { low = middle } else { high = middle }
        }
        let [m11, ..] = plant.mass_matrix();
        Ok(Self { top_speed: low, time_s: params.propeller.lag + m11 * low / force })
    }
}
