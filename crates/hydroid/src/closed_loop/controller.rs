//! Controllers of the closed loop.

use std::fmt;

use hydroid_core::control::{Controller, Estimate, Status};
use hydroid_core::guidance::Reference;
use hydroid_core::memory::Memory;
use hydroid_core::predict::Predictor;

use super::reference::Timing;

/// Session of the model of a controller, with the measurement of sample `k`.
#[derive(Clone, Copy)]
pub struct ModelSession<'a> {
    /// Predictions.
    pub predictor: &'a dyn Predictor,
    /// Weights in use of a model that adapts; `None` for a frozen model.
    pub weights: Option<&'a [f64]>,
}

impl fmt::Debug for ModelSession<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ModelSession").field("weights", &self.weights).finish_non_exhaustive()
    }
}

/// Data of a controller at sample `k`.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// Pose `[x, y, psi]` in north, east \[m\] and clockwise from north \[rad\], without noise.
    pub eta: [f64; 3],
    /// Measured body velocities over ground `[u, v, r]` \[m/s, m/s, rad/s\].
    pub nu: [f64; 3],
    /// Measured outputs of the plant, in the order of [`TruePlant::measured`](super::TruePlant::measured).
    pub outputs: &'a [f64],
    /// Reference of this sample.
    pub reference: &'a Reference,
    /// References of samples `k + n, k + 2 n, ..`, with `n` of [`preview_step`](ClosedLoopController::preview_step); the
    /// length is [`horizon`](ClosedLoopController::horizon).
    pub preview: &'a [Reference],
    /// Session of the model, if its owner is not the controller.
    pub session: Option<ModelSession<'a>>,
}

/// Maps the observation of each sample to a command.
pub trait ClosedLoopController: Send + Sync {
    /// Distance of the controlled point ahead of the vessel's origin \[m\].
    fn lead(&self) -> f64;

    /// Parameter that moves the reference.
    fn timing(&self) -> Timing;

    /// Number of references of the preview.
    fn horizon(&self) -> usize {
        0
    }

    /// Samples between two references of the preview.
    fn preview_step(&self) -> usize {
        1
    }

    /// Resets the state before a run; adapted weights stay.
    fn reset(&mut self);

    /// Visits all numbers on which later commands depend besides the session of the model; see
    /// [`Controller::visit_state`].
    fn visit_state(&mut self, memory: &mut Memory<'_>);

    /// The command that is planned for `later` samples after the last one; `None` without a plan.
    fn planned(&self, later: usize) -> Option<&[f64]> {
        let _ = later;
        None
    }

    /// Computes the commands, held until the next sample.
    fn command(&mut self, observation: &Observation<'_>, command: &mut [f64]) -> Status;
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
    /// Place of the measured position of each actuator in the outputs; empty if none is measured.
    pub actuators: Vec<Option<usize>>,
}

impl<C: Controller + Send + Sync> ClosedLoopController for ControlLaw<C> {
    fn lead(&self) -> f64 {
        self.lead
    }

    fn timing(&self) -> Timing {
        self.timing
    }

    fn reset(&mut self) {
        self.controller.reset();
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.controller.visit_state(memory);
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut [f64]) -> Status {
        let measured = |place: &Option<usize>| place.map_or(f64::NAN, |place| observation.outputs[place]);
        let actuators: Vec<f64> = self.actuators.iter().map(measured).collect();
        let Observation { eta, nu, .. } = *observation;
        let estimate = Estimate { eta, nu, current: [0.0; 2], actuators: &actuators };
        self.controller.command(&estimate, observation.reference, command)
    }
}
