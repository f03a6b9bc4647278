//! The true plant: a vessel with given parameters, or any other model.

use std::collections::VecDeque;
use std::sync::Arc;

use hydroid_core::actuator::Limits;
use hydroid_core::control::AffinePlant;
use hydroid_core::craft::Craft;

use super::disturbance::Conditions;
use super::error::ClosedLoopError;
use super::perturbed::{PerturbedPlant, forces};
use super::simulated::SimulatedModel;
use crate::boat::{BoatError, Value};
use crate::log::Channel;
use crate::model::{Model, Port};
use crate::plant::{PlantError, believed, input_values};

/// The vessel that a closed loop steers. The controller does not know it.
#[derive(Clone, Debug)]
pub enum TruePlant {
    /// A vessel with given parameters: wind and mass can change.
    Vessel(Box<Craft>),
    /// An identified model.
    Model(Arc<Model>),
}

impl From<Craft> for TruePlant {
    fn from(craft: Craft) -> Self {
        Self::Vessel(Box::new(craft))
    }
}

impl From<Arc<Model>> for TruePlant {
    /// A model with given parameters is a vessel.
    fn from(model: Arc<Model>) -> Self {
        match model.craft() {
            Some(craft) => craft.clone().into(),
            None => Self::Model(model),
        }
    }
}

impl TruePlant {
    /// Name of the vessel or of the model.
    pub fn name(&self) -> &str {
        match self {
            Self::Vessel(craft) => &craft.name,
            Self::Model(model) => &model.description.name,
        }
    }

    /// The plant as a model with a sample time \[s\].
    ///
    /// # Errors
    /// If a vessel or the sample time is invalid.
    pub fn model(&self, dt_s: f64) -> Result<Arc<Model>, ClosedLoopError> {
        Ok(match self {
            Self::Vessel(craft) => Arc::new(Model::of_vessel(craft, dt_s).map_err(PlantError::from)?),
            Self::Model(model) => Arc::clone(model),
        })
    }

    /// Names and units of the commands.
    pub fn commands(&self) -> Vec<Channel> {
        match self {
            Self::Vessel(craft) => {
                craft.commands.iter().map(|c| Channel::new(c.name.as_str(), c.unit.as_str())).collect()
            }
            Self::Model(model) => model.description.inputs.iter().map(|port| port.channel.clone()).collect(),
        }
    }

    /// Names and units of the measured outputs.
    pub fn measured(&self) -> Vec<Channel> {
        let mut all = self.outputs();
        if let Self::Vessel(craft) = self {
            all.truncate(3 + craft.thrusters.iter().filter(|t| t.force_noise.is_some()).count());
        }
        all
    }

    /// Names and units of all outputs; those that are not measured follow the measured ones.
    pub(super) fn outputs(&self) -> Vec<Channel> {
        match self {
            Self::Vessel(craft) => {
                let motion = [("u", "m/s"), ("v", "m/s"), ("r", "rad/s")];
                let force = |index: usize| match craft.thrusters.as_slice() {
                    [_] => Channel::new("P_f", "N"),
                    all => Channel::new(format!("P_f {}", all[index].name), "N"),
                };
                let motion = motion.map(|(name, unit)| Channel::new(name, unit));
                motion.into_iter().chain(forces(craft).into_iter().map(force)).collect()
            }
            Self::Model(model) => model.description.outputs.iter().map(|port| port.channel.clone()).collect(),
        }
    }

    /// Standard deviation of the measurement noise of each output.
    pub(super) fn noise(&self) -> Vec<f64> {
        match self {
            Self::Vessel(craft) => {
                let force = |index: usize| craft.thrusters[index].force_noise.unwrap_or(0.0);
                craft.noise.into_iter().chain(forces(craft).into_iter().map(force)).collect()
            }
            Self::Model(model) => {
                model.description.outputs.iter().map(|port| port.noise.unwrap_or(0.0)).collect()
            }
        }
    }

    /// Limits of the commands: those of the vessel, or those of the [model's inputs](limits_of). Limits that contradict each
    /// other are not a number: control laws refuse them.
    pub fn limits(&self) -> Vec<Limits> {
        match self {
            Self::Vessel(craft) => AffinePlant::limits(craft),
            Self::Model(model) => {
                let none = || vec![Limits::held(f64::NAN); model.description.inputs.len()];
                limits_of(model).unwrap_or_else(|_| none())
            }
        }
    }
}

/// Limits of the inputs of a model and their values at rest, by its [boat](input_values), and the limits of the rates that the
/// model states. An input that is not commanded has one value: the wind is 0, a setting in the middle of its range. A neutral
/// value outside of limits that only follow from the logs is the nearest one. No controller commands what its model knows nothing of:
/// the limits of a model that was identified lie within the range in which it is believed, its training range and half of its width to
/// either side.
///
/// # Errors
/// If the boat contradicts itself.
pub fn limits_of(model: &Model) -> Result<Vec<Limits>, BoatError> {
    let limits = |(port, value): (&Port, Value)| {
        let [low, high] = value.limits;
        if !value.is_commanded {
            return Limits::held(value.neutral);
        }
        let rest = value.neutral.max(low).min(high);
        let [least, most] =
            if model.is_vessel() { [low, high] } else { believed(port).map(|end| end.max(low).min(high)) };
        let limits = Limits::between([least.min(rest), most.max(rest)]).with_rest(rest);
        port.rate_limit.map_or(limits, |rate| limits.with_rate(rate))
    };
    Ok(model.description.inputs.iter().zip(input_values(model)?).map(limits).collect())
}

/// Commands on their way to the actuators.
pub(super) struct DelayLine {
    held: VecDeque<f64>,
    inputs: usize,
}

impl DelayLine {
    /// A delay of a whole number of samples, filled with `idle`.
    pub(super) fn new(delay_s: f64, dt_s: f64, idle: &[f64]) -> Result<Self, ClosedLoopError> {
        let samples = (delay_s / dt_s).round();
        if samples > 1e4 {
            let needed = "fewer than 10,000 samples are needed";
            return Err(ClosedLoopError::Option { what: "the delay", value: delay_s, needed });
        }
        if (samples * dt_s - delay_s).abs() > 1e-6 * dt_s {
            return Err(ClosedLoopError::Delay { delay_s, dt_s });
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and not negative")]
        let samples = samples as usize;
        Ok(Self { held: idle.repeat(samples).into(), inputs: idle.len() })
    }

    /// Takes the command of this sample; `command` becomes the one that acts.
    pub(super) fn exchange(&mut self, command: &mut [f64]) {
        self.held.extend(&*command);
        for (acts, held) in command.iter_mut().zip(self.held.drain(..self.inputs)) {
            *acts = held;
        }
    }
}

/// The true plant in motion.
pub(super) enum PlantInMotion {
    Vessel(Box<PerturbedPlant>),
    Model(Box<SimulatedModel>),
}

impl PlantInMotion {
    pub(super) fn new(
        plant: &TruePlant,
        conditions: &Conditions,
        dt_s: f64,
        idle: &[f64],
    ) -> Result<Self, ClosedLoopError> {
        let delay = DelayLine::new(conditions.delay_s, dt_s, idle)?;
        Ok(match plant {
            TruePlant::Vessel(craft) => {
                Self::Vessel(Box::new(PerturbedPlant::new(craft, conditions, dt_s, idle, delay)?))
            }
            TruePlant::Model(model) => {
                Self::Model(Box::new(SimulatedModel::new(model, conditions, dt_s, idle, delay)?))
            }
        })
    }

    /// Places the vessel at a pose, with a surge velocity through the water.
    pub(super) fn place(&mut self, eta: [f64; 3], surge: f64) {
        match self {
            Self::Vessel(plant) => plant.place(eta, surge),
            Self::Model(model) => model.place(eta, surge),
        }
    }

    /// Pose `[x, y, psi]`.
    pub(super) fn eta(&self) -> [f64; 3] {
        match self {
            Self::Vessel(plant) => plant.eta(),
            Self::Model(model) => model.eta(),
        }
    }

    /// Velocities `[u, v, r]` over ground.
    pub(super) fn nu(&self) -> [f64; 3] {
        match self {
            Self::Vessel(plant) => plant.nu(),
            Self::Model(model) => model.nu(),
        }
    }

    /// Writes all outputs, with velocities over ground.
    pub(super) fn write_outputs(&self, y: &mut [f64]) {
        match self {
            Self::Vessel(plant) => plant.write_outputs(y),
            Self::Model(model) => model.write_outputs(y),
        }
    }

    /// Integrates over one sample. The command acts after the delay.
    pub(super) fn advance(&mut self, command: &[f64]) {
        match self {
            Self::Vessel(plant) => plant.advance(command),
            Self::Model(model) => model.advance(command),
        }
    }
}
