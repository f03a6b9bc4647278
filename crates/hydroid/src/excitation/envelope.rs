//! Top speed and response time from a vessel's parameters.

use super::error::ExcitationError;
use super::vessel::PropellerRudder;

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
    pub fn new(vessel: &PropellerRudder) -> Result<Self, ExcitationError> {
        let [_, limit] = vessel.propeller().limits;
        let (force, dynamics) = (vessel.force_of(limit), vessel.dynamics());
        if force <= 0.0 {
            return Err(ExcitationError::NoForwardForce { limit });
        }
        // The holding force of a hydrofoil is not monotone: scan for the last speed that full force holds, then bisect.
        let mut held = 0.0;
        let mut u = FINEST;
        while u <= ABSURD_SPEED {
            if dynamics.holding_force(u) <= force {
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
            if dynamics.holding_force(middle) <= force { low = middle } else { high = middle }
        }
        let [m11, ..] = vessel.craft().hull.mass_matrix();
        Ok(Self { top_speed: low, time_s: vessel.lag_s() + m11 * low / force })
    }
}
