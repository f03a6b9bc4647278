//! What steers.

use hydroid_core::control::{Controller, Estimate, Status};
use hydroid_core::guidance::Reference;

use super::guide::Timing;

/// What is known at a sample.
#[derive(Clone, Copy, Debug)]
pub struct Sight<'a> {
    /// Pose `[x, y, psi]`, measured exactly.
    pub eta: [f64; 3],
    /// Body velocities over ground `[u, v, r]` as measured.
    pub nu: [f64; 3],
    /// Force of the propeller as measured \[N\]; NaN where it is not.
    pub force: f64,
    /// Where to be now.
    pub reference: &'a Reference,
    /// Where to be after 1, 2, .. samples: as many as the helm's [`horizon`](Helm::horizon).
    pub ahead: &'a [Reference],
}

/// Whatever turns what is known into commands, sample by sample.
pub trait Helm {
    /// Distance of the point that is to be on the path ahead of the vessel's origin \[m\].
    fn lead(&self) -> f64;

    /// What moves the reference.
    fn timing(&self) -> Timing;

    /// How many samples it looks ahead.
    fn horizon(&self) -> usize {
        0
    }

    /// At the start of a voyage; what was learned before stays.
    fn reset(&mut self);

    /// The command from this sample to the next, propeller and rudder.
    fn command(&mut self, sight: &Sight<'_>, command: &mut [f64; 2]) -> Status;
}

/// A control law as it stands.
#[derive(Clone, Debug)]
pub struct Law<C> {
    /// The law.
    pub controller: C,
    /// Distance of its point ahead of the origin \[m\].
    pub lead: f64,
    /// What moves its reference.
    pub timing: Timing,
    /// Whether it is told the measured force of the propeller.
    pub force: bool,
}

impl<C: Controller> Helm for Law<C> {
    fn lead(&self) -> f64 {
        self.lead
    }

    fn timing(&self) -> Timing {
        self.timing
    }

    fn reset(&mut self) {
        self.controller.reset();
    }

    fn command(&mut self, sight: &Sight<'_>, command: &mut [f64; 2]) -> Status {
        let force = [sight.force, f64::NAN];
        let actuators = if self.force { &force[..] } else { &[] };
        let estimate = Estimate { eta: sight.eta, nu: sight.nu, actuators };
        self.controller.command(&estimate, sight.reference, command)
    }
}
