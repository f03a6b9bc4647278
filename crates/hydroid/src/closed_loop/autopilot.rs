//! The autopilot for any actuators.

use hydroid_core::actuator::{Channel, Limits};
use hydroid_core::control::{Actuators, Autopilot, AutopilotOptions, Controller, Estimate, Status};
use hydroid_core::memory::Memory;
use serde::Serialize;

use super::controller::{ClosedLoopController, Observation};
use super::error::ClosedLoopError;
use super::reference::Timing;
use crate::plant::InputMap;

/// Gains of the [`Autopilot`] in units of propulsion (1: full ahead) and steering (1: hard to starboard), and the inputs
/// that push and turn the vessel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AutopilotGains {
    /// Gains.
    #[serde(skip)]
    pub options: AutopilotOptions,
    /// Inputs.
    pub inputs: InputMap,
}

pub(super) struct AutopilotController {
    law: Autopilot,
    inputs: InputMap,
    actuators: Actuators,
}

impl AutopilotController {
    pub(super) fn new(gains: &AutopilotGains, limits: &[Limits], dt_s: f64) -> Result<Self, ClosedLoopError> {
        let AutopilotGains { options, inputs } = gains;
        // The slowest actuator limits the rate of a direction.
        let rate = |direction: &[f64]| {
            let each = direction.iter().zip(limits).filter(|(part, _)| **part != 0.0);
            each.map(|(part, limits)| limits.rate / part.abs()).fold(f64::INFINITY, f64::min)
        };
        let astern = inputs.astern();
        let channels = [
            Limits::between([-astern, 1.0]).with_rest(0.0).with_rate(rate(&inputs.push)),
            Limits::between([-inputs.hard_over(-1.0), inputs.hard_over(1.0)])
                .with_rest(0.0)
                .with_rate(rate(&inputs.turn)),
        ];
        Ok(Self {
            law: Autopilot::new(&channels, dt_s, *options)?,
            inputs: inputs.clone(),
            actuators: Actuators::new(&vec![Channel::default(); limits.len()], limits, dt_s, 0.0)?,
        })
    }
}

impl ClosedLoopController for AutopilotController {
    fn lead(&self) -> f64 {
        0.0
    }

    fn timing(&self) -> Timing {
        Timing::Path
    }

    fn reset(&mut self) {
        self.law.reset();
        self.actuators.reset();
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.law.visit_state(memory);
        self.actuators.visit_state(memory);
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut [f64]) -> Status {
        let Observation { eta, nu, .. } = *observation;
        let estimate = Estimate { eta, nu, current: [0.0; 2], actuators: &[] };
        let mut demand = [0.0; 2];
        let status = self.law.command(&estimate, observation.reference, &mut demand);
        self.inputs.write_command(demand[0], demand[1], command);
        let wanted_beyond = (0..command.len()).any(|c| {
            let InputMap { neutral, push, turn, limits, .. } = &self.inputs;
            let whole = neutral[c] + demand[0] * push[c] + demand[1] * turn[c];
            !(limits[c][0]..=limits[c][1]).contains(&whole)
        });
        let applied = self.actuators.limit(command);
        let status = if applied.rate_limited { status.and(Status::RateLimited) } else { status };
        if applied.saturated || wanted_beyond { status.and(Status::Saturated) } else { status }
    }
}
