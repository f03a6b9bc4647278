//! A plant in motion, behind a lock.

use std::sync::Mutex;

use hydroid::model::Model;
use hydroid::plant::Simulation as Plant;

use crate::error::{Error, Outcome, Status, check_finite, check_length};

/// A model that runs freely, without measurements: the motion from the model, the pose by kinematics.
pub struct Simulation {
    pub(crate) outputs: usize,
    pub(crate) inputs: usize,
    state: Mutex<Plant>,
}

impl Simulation {
    pub(crate) fn new(model: &Model, current: [f64; 2]) -> Outcome<Self> {
        check_finite("the current", &current)?;
        let plant = Plant::new(model).map_err(|error| Error::new(Status::Unsupported, error.to_string()))?;
        Ok(Self {
            outputs: model.description.outputs.len(),
            inputs: model.description.inputs.len(),
            state: Mutex::new(plant.with_current(current)),
        })
    }

    fn with<T>(&self, act: impl FnOnce(&mut Plant) -> T) -> Outcome<T> {
        let message =
            "an internal error ended an earlier call of this simulation: free it and make a new one";
        let mut state = self.state.lock().map_err(|_| Error::new(Status::Failed, message))?;
        Ok(act(&mut state))
    }

    pub(crate) fn start(&self, eta: &[f64], y: &[f64], c: &[f64]) -> Outcome {
        let [x, y_east, psi] = *eta else { return Err(Error::length("eta", 3, eta.len())) };
        check_length("y", self.outputs, y.len())?;
        check_length("c", self.inputs, c.len())?;
        check_finite("eta", eta)?;
        check_finite("y", y)?;
        check_finite("c", c)?;
        self.with(|plant| plant.start([x, y_east, psi], y, c))
    }

    pub(crate) fn advance(&self, c: &[f64]) -> Outcome {
        check_length("c", self.inputs, c.len())?;
        check_finite("c", c)?;
        self.with(|plant| plant.advance(c))
    }

    pub(crate) fn outputs(&self, y: &mut [f64]) -> Outcome {
        check_length("y", self.outputs, y.len())?;
        self.with(|plant| y.copy_from_slice(plant.outputs()))
    }

    pub(crate) fn eta(&self, eta: &mut [f64]) -> Outcome {
        check_length("eta", 3, eta.len())?;
        self.with(|plant| eta.copy_from_slice(&plant.eta()))
    }

    pub(crate) fn nu_over_ground(&self, nu: &mut [f64]) -> Outcome {
        check_length("nu", 3, nu.len())?;
        self.with(|plant| nu.copy_from_slice(&plant.nu_over_ground()))
    }

    pub(crate) fn check(&self) -> Outcome {
        self.with(|plant| plant.check())?.map_err(|error| Error::new(Status::Diverged, error.to_string()))
    }
}
