//! Models that a control law can invert.

use alloc::vec;
use alloc::vec::Vec;

use super::error::ControlError;
use crate::actuator::{Channel, Lag, Limits, Map};
use crate::vessel::{Command, InvalidParams, Plant, RudderLaw, VesselParams};

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

/// A vessel with known parameters ([`Plant`]): the force of the propeller with its lag, and the rudder.
#[derive(Clone, Debug, PartialEq)]
pub struct AffinePlant {
    plant: Plant,
    channels: [Channel; 2],
    /// Yaw moment per surge velocity and unit of rudder effort \[N s\].
    moment: f64,
}

impl AffinePlant {
    /// Builds the model from parameters.
    ///
    /// # Errors
    /// If a parameter is out of range.
    pub fn new(params: &VesselParams) -> Result<Self, InvalidParams> {
        let plant = Plant::new(params)?;
        let (map, unit) = match params.rudder.law {
            RudderLaw::Linear => (Map::Identity, 1.0),
            RudderLaw::Sine => (Map::Sine, core::f64::consts::FRAC_PI_2),
        };
        let moment = plant.actuation(&Command { pp: 0.0, rd: unit }).moment_per_speed;
        let propeller = Channel { lag: Lag::of_time_constant(params.propeller.lag), map: Map::Identity };
        Ok(Self { plant, channels: [propeller, Channel { map, ..Channel::default() }], moment })
    }

    /// Limits of the two commands in the parameters; at rest they are 0, or the nearest value to it.
    pub fn limits(params: &VesselParams) -> [Limits; 2] {
        [params.commands.propeller.limits, params.commands.rudder.limits]
            .map(|limits| Limits::between(limits).with_rest(0.0_f64.max(limits[0]).min(limits[1])))
    }
}

impl Affine for AffinePlant {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn evaluate(&mut self, nu: [f64; 3], into: &mut Motion) {
        let f = self.plant.acceleration(nu, 0.0, 0.0);
        let slope = |with: [f64; 3]| core::array::from_fn(|i| with[i] - f[i]);
        // Steps of 100 N: a slope of 0.01 keeps its digits beside the drag.
        let propeller = self.plant.acceleration(nu, 100.0, 0.0);
        into.g.copy_from_slice(&[
            slope(propeller).map(|x| x * 0.01),
            slope(self.plant.acceleration(nu, 0.0, self.moment)),
        ]);
        into.f = f;
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
