//! Model predictive control (MPC) in the closed loop.

use std::time::Duration;

use hydroid_core::control::Status;
use hydroid_core::control::cem::Planner;
use hydroid_core::memory::Memory;
use web_time::Instant;

use super::controller::{ClosedLoopController, Observation};
use super::reference::Timing;

/// Model predictive control by the cross-entropy method ([`Planner`]) on the session of any model. Without a session it is
/// blind.
pub(super) struct PredictiveController {
    pub(super) planner: Planner,
    pub(super) lead: f64,
    pub(super) timing: Timing,
    pub(super) tolerance: f64,
    /// Computing time of a plan; `None` for all iterations, which makes results independent of the machine.
    pub(super) budget: Option<Duration>,
}

impl ClosedLoopController for PredictiveController {
    fn lead(&self) -> f64 {
        self.lead
    }

    fn timing(&self) -> Timing {
        self.timing
    }

    fn horizon(&self) -> usize {
        self.planner.horizon()
    }

    fn preview_step(&self) -> usize {
        self.planner.hold()
    }

    fn reset(&mut self) {
        self.planner.reset();
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.planner.visit_state(memory);
    }

    fn planned(&self, later: usize) -> Option<&[f64]> {
        Some(self.planner.planned(later))
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut [f64]) -> Status {
        let begun = Instant::now();
        let Self { planner, budget, .. } = self;
        let Some(session) = observation.session else {
            command.copy_from_slice(&planner.plan()[..command.len()]);
            return Status::Blind;
        };
        let mut stop = || budget.is_some_and(|budget| begun.elapsed() >= budget);
        let plan =
            planner.command(session.predictor, observation.eta, observation.preview, &mut stop, command);
        let [x, y, psi] = observation.eta;
        let north = x + self.lead * psi.cos() - observation.reference.position[0];
        let east = y + self.lead * psi.sin() - observation.reference.position[1];
        // The planner sets its status from the preview; the reference of this sample is checked here.
        if north.hypot(east) > self.tolerance { plan.status.and(Status::Lost) } else { plan.status }
    }
}
