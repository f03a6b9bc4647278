//! Controllers of the closed loop.

use hydroid_core::control::{Controller, Estimate, Status};
use hydroid_core::guidance::Reference;

use super::reference::Timing;

/// Data of a controller at sample `k`.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// Pose `[x, y, psi]` in north, east \[m\] and clockwise from north \[rad\], without noise.
    pub eta: [f64; 3],
    /// Measured body velocities over ground `[u, v, r]` \[m/s, m/s, rad/s\].
    pub nu: [f64; 3],
    /// Measured propeller force \[N\]; NaN if the vessel does not measure it.
    pub force: f64,
    /// Reference of this sample.
    pub reference: &'a Reference,
    /// References of samples `k + 1, k + 2, ..`; the length is [`horizon`](ClosedLoopController::horizon).
    pub preview: &'a [Reference],
}

/// Maps the observation of each sample to a command.
pub trait ClosedLoopController {
    /// Distance of the controlled point ahead of the vessel's origin \[m\].
    fn lead(&self) -> f64;

    /// Parameter that moves the reference.
    fn timing(&self) -> Timing;

    /// Samples of reference preview.
    fn horizon(&self) -> usize {
        0
    }

    /// Resets the state before a run; adapted weights stay.
    fn reset(&mut self);

    /// Computes the command `[propeller, rudder]`, held until the next sample.
    fn command(&mut self, observation: &Observation<'_>, command: &mut [f64; 2]) -> Status;
}

/// A control law without adaptation.
#[derive(Clone, Debug)]
pub struct ControlLaw<C> {
    /// Control law.
    pub controller: C,
    /// Distance of the controlled point ahead of the origin \[m\].
    pub lead: f64,
    /// Parameter that moves the reference.
    pub timing: Timing,
    /// Whether the law receives the measured propeller force.
    pub force: bool,
}

impl<C: Controller> ClosedLoopController for ControlLaw<C> {
    fn lead(&self) -> f64 {
        self.lead
    }

    fn timing(&self) -> Timing {
        self.timing
    }

    fn reset(&mut self) {
        self.controller.reset();
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut [f64; 2]) -> Status {
        let force = [observation.force, f64::NAN];
        let actuators = if self.force { &force[..] } else { &[] };
        let estimate = Estimate { eta: observation.eta, nu: observation.nu, current: [0.0; 2], actuators };
        self.controller.command(&estimate, observation.reference, command)
    }
}
