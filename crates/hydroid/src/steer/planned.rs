//! Plans on any model, which may learn.

use std::time::{Duration, Instant};

use hydroid_core::control::Status;
use hydroid_core::control::cem::Planner;

use super::channels::Channels;
use super::guide::Timing;
use super::helm::{Helm, Sight};
use super::mind::Mind;

/// The cross-entropy method in the loop.
pub(super) struct Planned {
    pub(super) planner: Planner,
    pub(super) mind: Mind,
    pub(super) channels: Channels,
    pub(super) lead: f64,
    pub(super) timing: Timing,
    /// Farther than this from the reference is lost \[m\].
    pub(super) tolerance: f64,
    /// Time for a plan; none to finish all of it, which alone is the same on every machine.
    pub(super) budget: Option<Duration>,
    pub(super) y: Vec<f64>,
}

impl Helm for Planned {
    fn lead(&self) -> f64 {
        self.lead
    }

    fn timing(&self) -> Timing {
        self.timing
    }

    fn horizon(&self) -> usize {
        self.planner.horizon()
    }

    fn reset(&mut self) {
        self.planner.reset();
        self.mind.reset();
    }

    fn command(&mut self, sight: &Sight<'_>, command: &mut [f64; 2]) -> Status {
        let begun = Instant::now();
        let Self { planner, mind, channels, budget, y, .. } = self;
        channels.fill(sight, y);
        mind.observe(y);
        let mut stop = || budget.is_some_and(|budget| begun.elapsed() >= budget);
        let plan = planner.command(mind.predictor(), sight.eta, sight.ahead, &mut stop, command);
        mind.advance(command);
        let [x, y, psi] = sight.eta;
        let north = x + self.lead * psi.cos() - sight.reference.position[0];
        let east = y + self.lead * psi.sin() - sight.reference.position[1];
        // The planner judges by references of later samples; this one is of now.
        if north.hypot(east) > self.tolerance { plan.status.and(Status::Lost) } else { plan.status }
    }
}
