//! Models that a control law can invert.

use alloc::vec;
use alloc::vec::Vec;

use super::error::ControlError;
use crate::actuator::{Channel, Lag, Limits, Map};
use crate::vessel::{Command, InvalidParams, Plant, RudderLaw, VesselParams};

/// Motion that is affine in efforts:
///
/// ```text
/// d nu/dt = f(nu) + sum_i g_i(nu) phi_i(a_i),     nu = (u, v, r)
/// ```
///
/// with a known invertible map `phi_i` for each command and an actuator `a_i` that follows it at once or with a lag
/// ([`Channel`]).
pub trait Affine {
    /// How each command acts.
    fn channels(&self) -> &[Channel];

    /// `f` and `g` at body velocities `[u, v, r]` \[m/s, m/s, rad/s\], without allocating.
    ///
    /// # Panics
    /// If `into` is of another number of commands.
    fn evaluate(&mut self, nu: [f64; 3], into: &mut Motion);
}

/// `f` and `g` of an [`Affine`] model at a moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Accelerations without any effort \[m/s^2, m/s^2, rad/s^2\].
    pub f: [f64; 3],
    /// What one unit of each effort adds to them.
    pub g: Vec<[f64; 3]>,
}

impl Motion {
    /// Room for so many commands.
    pub fn new(inputs: usize) -> Self {
        Self { f: [0.0; 3], g: vec![[0.0; 3]; inputs] }
    }
}

/// A vessel with known parameters ([`Plant`]): the propeller's force through its lag, and the rudder.
#[derive(Clone, Debug, PartialEq)]
pub struct AffinePlant {
    plant: Plant,
    channels: [Channel; 2],
    /// Yaw moment per surge velocity of one unit of the rudder's effort \[N s\].
    moment: f64,
}

impl AffinePlant {
    /// From parameters.
    ///
    /// # Errors
    /// If they describe no vessel.
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

    /// Limits of its two commands, as the parameters have them.
    pub fn limits(params: &VesselParams) -> [Limits; 2] {
        [params.commands.propeller.limits, params.commands.rudder.limits].map(Limits::between)
    }
}

impl Affine for AffinePlant {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn evaluate(&mut self, nu: [f64; 3], into: &mut Motion) {
        let f = self.plant.acceleration(nu, 0.0, 0.0);
        let slope = |with: [f64; 3]| core::array::from_fn(|i| with[i] - f[i]);
        // In steps of 100 N, so that nothing of a slope of 0.01 is lost beside drag.
        let propeller = self.plant.acceleration(nu, 100.0, 0.0);
        into.g.copy_from_slice(&[
            slope(propeller).map(|x| x * 0.01),
            slope(self.plant.acceleration(nu, 0.0, self.moment)),
        ]);
        into.f = f;
    }
}

/// `limits` for each command of a model, and at least two of them.
pub(super) fn check_count(channels: &[Channel], limits: &[Limits]) -> Result<(), ControlError> {
    if channels.len() < 2 {
        return Err(ControlError::TooFewInputs { given: channels.len() });
    }
    if channels.len() != limits.len() {
        return Err(ControlError::Count { expected: channels.len(), given: limits.len() });
    }
    Ok(())
}
