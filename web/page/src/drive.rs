//! A vessel that is driven, sample by sample.

use hydroid::model::Model;
use hydroid::plant::{self, InputMap, PlantError, Simulation, neutral};
use wasm_bindgen::prelude::*;

/// A model that runs freely, without measurements, under the commands of the page.
#[wasm_bindgen]
pub struct Drive {
    simulation: Simulation,
    map: Option<InputMap>,
    rest: Vec<f64>,
    neutral: Vec<f64>,
}

impl Drive {
    pub(crate) fn new(model: &Model, current: [f64; 2]) -> Result<Self, PlantError> {
        let simulation = Simulation::new(model)?.with_current(current);
        let map = InputMap::find(model).ok();
        let neutral = match &map {
            Some(map) => map.command(0.0, 0.0),
            None => model
                .description
                .inputs
                .iter()
                .map(|port| neutral([port.range.low, port.range.high]))
                .collect(),
        };
        let mut own = Self { simulation, map, rest: plant::rest(model), neutral };
        own.start();
        Ok(own)
    }
}

#[wasm_bindgen]
impl Drive {
    /// Places the vessel at the origin, at rest and heading north.
    pub fn start(&mut self) {
        self.simulation.start([0.0; 3], &self.rest, &self.neutral);
    }

    /// The command for propulsion and steering between -1 and 1; empty if no input pushes and turns the vessel.
    pub fn command(&self, propulsion: f64, steering: f64) -> Vec<f64> {
        self.map.as_ref().map_or_else(Vec::new, |map| map.command(propulsion, steering))
    }

    /// Holds a command over samples. A command of another length, or one with a number that is not finite, is replaced by the
    /// neutral one.
    pub fn advance(&mut self, command: &[f64], samples: u32) {
        let fits = command.len() == self.neutral.len() && command.iter().all(|c| c.is_finite());
        let command = if fits { command } else { &self.neutral };
        for _ in 0..samples {
            self.simulation.advance(command);
        }
    }

    /// Pose (north, east \[m\], heading \[rad\]), velocities over ground (surge, sway \[m/s\], yaw rate \[rad/s\]), then the
    /// outputs of the model.
    pub fn state(&self) -> Vec<f64> {
        let mut state = self.simulation.eta().to_vec();
        state.extend(self.simulation.nu_over_ground());
        state.extend(self.simulation.outputs());
        state
    }

    /// Whether the motion is finite.
    pub fn is_sound(&self) -> bool {
        self.simulation.check().is_ok()
    }
}
