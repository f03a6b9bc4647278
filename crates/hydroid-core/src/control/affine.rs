//! Models that a control law can invert.

use alloc::vec;
use alloc::vec::Vec;

use super::error::ControlError;
use crate::actuator::{Channel, Limits};
use crate::craft::{CommandInput, Craft, CraftChannel, Dynamics, Effect, MAX_SERVOS, NotAffineCraft};

/// A model that is affine in the efforts of its actuators:
///
/// ```text
/// d nu/dt = f(nu) + sum_i g_i(nu) phi_i(a_i),     nu = (u, v, r)
/// ```
///
/// with a known invertible map `phi_i` for each command, and an actuator `a_i` with or without a lag ([`Channel`]).
pub trait Affine {
    /// Lag and map of each command.
    fn channels(&self) -> &[Channel];

    /// Evaluates `f` and `g` at body velocities `[u, v, r]` \[m/s, m/s, rad/s\], without allocating.
    ///
    /// # Panics
    /// If `into` is for another number of commands.
    fn evaluate(&mut self, nu: [f64; 3], into: &mut Motion);
}

/// `f` and `g` of an [`Affine`] model at one state.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Accelerations without effort \[m/s^2, m/s^2, rad/s^2\].
    pub f: [f64; 3],
    /// Accelerations per unit of each effort.
    pub g: Vec<[f64; 3]>,
}

impl Motion {
    /// Zeros for `inputs` commands.
    pub fn new(inputs: usize) -> Self {
        Self { f: [0.0; 3], g: vec![[0.0; 3]; inputs] }
    }
}

/// A vessel with known parameters whose commands move one actuator each: fixed thrusters with a force that is proportional to
/// the order, and rudders that are a yaw moment ([`Craft::channels`]).
#[derive(Clone, Debug, PartialEq)]
pub struct AffinePlant {
    craft: Craft,
    dynamics: Dynamics,
    commands: Vec<CraftChannel>,
    channels: Vec<Channel>,
}

impl AffinePlant {
    /// Builds the model from a vessel.
    ///
    /// # Errors
    /// If the vessel is invalid, or a command cannot be inverted.
    pub fn new(craft: &Craft) -> Result<Self, NotAffineCraft> {
        let commands = craft.channels()?;
        let channels = commands.iter().map(|command| command.channel).collect();
        Ok(Self { dynamics: Dynamics::new(craft), craft: craft.clone(), commands, channels })
    }

    /// Limits of the commands of a vessel, which have their neutral values at rest.
    pub fn limits(craft: &Craft) -> Vec<Limits> {
        let limits = |command: &CommandInput| Limits::between(command.limits).with_rest(command.neutral);
        craft.commands.iter().map(limits).collect()
    }

    /// The vessel.
    pub fn craft(&self) -> &Craft {
        &self.craft
    }

    /// Replaces the numbers of the vessel, in the order of [`Craft::parameters`]. Numbers that are invalid, or with which a
    /// command cannot be inverted, are refused, and the model stays.
    pub fn set_numbers(&mut self, numbers: &[f64]) {
        if let Ok(changed) = Self::new(&self.craft.with_numbers(numbers)) {
            *self = changed;
        }
    }
}

impl Affine for AffinePlant {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn evaluate(&mut self, nu: [f64; 3], into: &mut Motion) {
        // All forces of the actuators are zero at the positions zero.
        into.f = self.dynamics.acceleration(nu, &[0.0; MAX_SERVOS][..self.dynamics.servos()]);
        assert_eq!(into.g.len(), self.commands.len(), "an effort for each command");
        for (g, command) in into.g.iter_mut().zip(&self.commands) {
            let force = match command.effect {
                Effect::Force(force) => force,
                Effect::MomentPerSpeed(moment) => [0.0, 0.0, moment * nu[0]],
            };
            *g = self.dynamics.pushed(nu[0], force);
            let neutral = command.channel.map.value(command.neutral);
            for (f, g) in into.f.iter_mut().zip(g) {
                *f -= *g * neutral;
            }
        }
    }
}

/// Requires one limit per command, and at least two commands.
pub(super) fn check_count(channels: &[Channel], limits: &[Limits]) -> Result<(), ControlError> {
    if channels.len() < 2 {
        return Err(ControlError::TooFewInputs { given: channels.len() });
    }
    if channels.len() != limits.len() {
        return Err(ControlError::Count { expected: channels.len(), given: limits.len() });
    }
    Ok(())
}
