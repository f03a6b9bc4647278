//! Vessels with one propeller and one rudder.

use hydroid_core::actuator::Map;
use hydroid_core::craft::{CommandInput, Craft, Dynamics, Effect};
use hydroid_core::vessel::Command;

use super::error::ExcitationError;

/// A vessel whose one propeller on the centreline has a force that is proportional to its command, and whose one rudder is a
/// yaw moment that grows with the surge velocity, as the vessels of the thesis.
#[derive(Clone, Debug)]
pub struct PropellerRudder {
    craft: Craft,
    dynamics: Dynamics,
    /// Index of the command of the propeller.
    propeller: usize,
    /// Propeller force of a unit of the command \[N\].
    force: f64,
    lag_s: f64,
    /// Yaw moment per surge velocity and effort of the rudder \[N s\].
    moment: f64,
    map: Map,
}

impl PropellerRudder {
    /// The vessel in this form.
    ///
    /// # Errors
    /// [`ExcitationError::Actuators`] or [`ExcitationError::NotPropellerRudder`] if it has other actuators.
    pub fn new(craft: &Craft) -> Result<Self, ExcitationError> {
        let channels = craft.channels()?;
        let other = || ExcitationError::NotPropellerRudder { name: craft.name.clone() };
        let [first, second] = channels.as_slice() else { return Err(other()) };
        let (propeller, force, moment, map) = match (first.effect, second.effect) {
            (Effect::Force(force), Effect::MomentPerSpeed(moment)) => (0, force, moment, second.channel.map),
            (Effect::MomentPerSpeed(moment), Effect::Force(force)) => (1, force, moment, first.channel.map),
            _ => return Err(other()),
        };
        let [x, y, n] = force;
        if !(x > 0.0 && y == 0.0 && n == 0.0 && moment > 0.0) {
            return Err(other());
        }
        Ok(Self {
            dynamics: Dynamics::new(craft),
            lag_s: craft.thrusters[0].servo.lag,
            craft: craft.clone(),
            propeller,
            force: x,
            moment,
            map,
        })
    }

    /// The vessel.
    pub fn craft(&self) -> &Craft {
        &self.craft
    }

    /// Its equations of motion.
    pub fn dynamics(&self) -> &Dynamics {
        &self.dynamics
    }

    /// The command of the propeller.
    pub fn propeller(&self) -> &CommandInput {
        &self.craft.commands[self.propeller]
    }

    /// The command of the rudder.
    pub fn rudder(&self) -> &CommandInput {
        &self.craft.commands[1 - self.propeller]
    }

    /// Time constant of the propeller force \[s\].
    pub(crate) const fn lag_s(&self) -> f64 {
        self.lag_s
    }

    /// A command as a row of the inputs of the vessel.
    pub(crate) fn row(&self, Command { pp, rd }: Command) -> [f64; 2] {
        if self.propeller == 0 { [pp, rd] } else { [rd, pp] }
    }

    /// Force \[N\] under a command of the propeller, held for a long time.
    pub(crate) fn force_of(&self, pp: f64) -> f64 {
        self.force * (pp - self.propeller().neutral)
    }

    /// Command of the propeller for a force \[N\], without its limits.
    pub(crate) fn command_of(&self, force: f64) -> f64 {
        self.propeller().neutral + force / self.force
    }

    /// The command that holds a force \[N\] with the rudder amidships, without limits.
    pub(crate) fn held(&self, force: f64) -> Command {
        Command { pp: self.command_of(force), rd: self.rudder().neutral }
    }

    /// Command of the rudder for a yaw moment at a surge velocity; beyond the largest moment, that of the largest one.
    pub(crate) fn rudder_of(&self, moment: f64, surge: f64) -> f64 {
        let neutral = self.map.value(self.rudder().neutral);
        self.map.inverse(neutral + moment / (self.moment * surge))
    }
}
