//! Inversion of actuators: from efforts to commands within limits.

use alloc::vec::Vec;

use num_traits::Float;

use super::error::{ControlError, at_least, positive};
use super::liveness::SHORTEST_LIMIT_S as HOLD_S;
use crate::actuator::{Channel, Limits, Map};
use crate::memory::Memory;

/// All actuators of a vessel.
///
/// The motion depends on the efforts `tau_i = phi_i(a_i)` of the actuator positions `a_i` (force, angle, revolutions).
/// In a sample of `dt` seconds the command `c` changes the position from `a` to `a+ = e a + (1 - e) c`, `e = exp(-dt /
/// T)` ([`Lag`](crate::actuator::Lag), in general). The command for a demanded effort *at the end of the sample* is
///
/// ```text
/// a_w = phi^-1(tau_w)
/// a_t = a_w + (a - a_w) exp(-dt / response)
/// c   = (a_t - e a) / (1 - e),     within [low, high] and within rate dt of the last one
/// ```
///
/// The inverse amplifies demand and sensor noise by `1 / (1 - e)`, ten for a sample of a tenth of the lag; `response`
/// \[s\] gives the actuator more than one sample. (A demand on the *mean* effort over a sample would oscillate: each
/// sample reduces the previous overshoot by the factor `e` only.) The lag must be known; in equilibrium `a = c`.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuators {
    all: Vec<Actuator>,
    dt: f64,
    left: f64,
    held_s: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Actuator {
    map: Map,
    /// `a+ = decay a + gain c + offset`.
    decay: f64,
    gain: f64,
    offset: f64,
    limits: Limits,
    position: f64,
    command: f64,
}

impl Actuator {
    fn settled(&self, command: f64) -> f64 {
        (self.gain * command + self.offset) / (1.0 - self.decay)
    }

    fn reset(&mut self) {
        self.command = self.limits.rest;
        self.position = self.settled(self.command);
    }

    fn take(&mut self, demand: f64, dt: f64) -> Applied {
        let Limits { low, high, rate, .. } = self.limits;
        let inside = demand.clamp(low, high);
        let change = rate * dt;
        let command = inside.clamp((self.command - change).max(low), (self.command + change).min(high));
        self.position = self.decay * self.position + self.gain * command + self.offset;
        self.command = command;
        Applied { saturated: inside != demand, rate_limited: command != inside }
    }
}

/// Limits that were active.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Applied {
    /// A command is at its limit.
    pub saturated: bool,
    /// A command is at its rate limit.
    pub rate_limited: bool,
}

impl Actuators {
    /// Actuators at rest with samples of `dt` seconds and the response time `response` \[s\], 0 for one sample.
    ///
    /// # Errors
    /// If the number of limits differs from the number of channels, or limits, lags, maps or times are out of range.
    pub fn new(
        channels: &[Channel],
        limits: &[Limits],
        dt: f64,
        response: f64,
    ) -> Result<Self, ControlError> {
        positive("the sample time", dt)?;
        at_least("the response time of the actuators", response, 0.0)?;
        if channels.len() != limits.len() {
            return Err(ControlError::Count { expected: channels.len(), given: limits.len() });
        }
        let mut all = Vec::with_capacity(channels.len());
        for (index, (channel, limits)) in channels.iter().zip(limits).enumerate() {
            if !limits.are_ordered() {
                return Err(ControlError::Limits { channel: index });
            }
            let mut actuator = Self::checked(index, channel, *limits, dt)?;
            actuator.reset();
            all.push(actuator);
        }
        let left = if response > 0.0 { Float::exp(-dt / response) } else { 0.0 };
        Ok(Self { all, dt, left, held_s: 0.0 })
    }

    fn checked(index: usize, channel: &Channel, limits: Limits, dt: f64) -> Result<Actuator, ControlError> {
        let over = channel.lag.discretize(dt);
        let [decay, gain, offset] = over;
        if !channel.lag.is_invertible() || over.iter().any(|x| !x.is_finite()) || gain == 0.0 {
            return Err(ControlError::Lag { channel: index });
        }
        let map = channel.map;
        let actuator = Actuator { map, decay, gain, offset, limits, position: 0.0, command: 0.0 };
        let ends = [limits.low, limits.high].map(|command| actuator.settled(command));
        if map.is_invertible(ends[0].min(ends[1]), ends[0].max(ends[1])) {
            Ok(actuator)
        } else {
            Err(ControlError::NotInvertible { channel: index })
        }
    }

    /// Replaces the channels after an update of the model. Positions and commands stay.
    ///
    /// # Errors
    /// If a channel is not invertible or their number differs. Nothing changes then.
    pub fn set_channels(&mut self, channels: &[Channel]) -> Result<(), ControlError> {
        if channels.len() != self.all.len() {
            return Err(ControlError::Count { expected: channels.len(), given: self.all.len() });
        }
        for (index, (channel, actuator)) in channels.iter().zip(&self.all).enumerate() {
            Self::checked(index, channel, actuator.limits, self.dt)?;
        }
        for (actuator, channel) in self.all.iter_mut().zip(channels) {
            actuator.map = channel.map;
            [actuator.decay, actuator.gain, actuator.offset] = channel.lag.discretize(self.dt);
        }
        Ok(())
    }

    /// Number of actuators.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Whether there are no actuators.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Sample time \[s\].
    pub const fn dt(&self) -> f64 {
        self.dt
    }

    /// Sets all actuators to rest: the steady state under the commands at rest.
    pub fn reset(&mut self) {
        self.held_s = 0.0;
        self.all.iter_mut().for_each(Actuator::reset);
    }

    /// Visits all numbers on which later commands depend; see [`Controller::visit_state`](super::Controller::visit_state).
    pub fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.number(&mut self.held_s);
        for actuator in &mut self.all {
            memory.number(&mut actuator.position);
            memory.number(&mut actuator.command);
            let Limits { low, high, rest, .. } = actuator.limits;
            if !(low..=high).contains(&actuator.command) {
                actuator.command = rest;
            }
        }
    }

    /// Takes measured positions; values that are not finite are missing.
    pub fn observe(&mut self, positions: &[f64]) {
        for (actuator, &position) in self.all.iter_mut().zip(positions) {
            if position.is_finite() {
                actuator.position = position;
            }
        }
    }

    /// Present effort of an actuator.
    pub fn effort(&self, index: usize) -> f64 {
        let actuator = &self.all[index];
        actuator.map.value(actuator.position)
    }

    /// Half of the steady-state range of the effort of an actuator.
    pub fn span(&self, index: usize) -> f64 {
        let actuator = &self.all[index];
        let [low, high] = [actuator.limits.low, actuator.limits.high]
            .map(|command| actuator.map.value(actuator.settled(command)));
        0.5 * (high - low).abs()
    }

    /// Least and greatest effort that an actuator can reach at the end of a sample, within its limits.
    #[inline]
    pub fn reach(&self, index: usize) -> [f64; 2] {
        let actuator = &self.all[index];
        let Limits { low, high, rate, .. } = actuator.limits;
        let change = rate * self.dt;
        let [a, b] = [(actuator.command - change).max(low), (actuator.command + change).min(high)].map(|c| {
            actuator.map.value(actuator.decay * actuator.position + actuator.gain * c + actuator.offset)
        });
        [a.min(b), a.max(b)]
    }

    /// Commands for demanded efforts; steps the actuators, so that [`effort`](Self::effort) is that at the end of the
    /// sample. A demand that is not finite leaves its command unchanged.
    ///
    /// # Panics
    /// If `efforts` or `commands` have not one number for each actuator.
    pub fn apply(&mut self, efforts: &[f64], commands: &mut [f64]) -> Applied {
        assert_eq!(efforts.len(), self.all.len(), "one effort for each actuator");
        assert_eq!(commands.len(), self.all.len(), "one command for each actuator");
        self.held_s = 0.0;
        let mut all = Applied::default();
        for ((actuator, &effort), command) in self.all.iter_mut().zip(efforts).zip(commands) {
            let wanted = actuator.map.inverse(effort);
            let target = wanted + (actuator.position - wanted) * self.left;
            let demand = (target - actuator.decay * actuator.position - actuator.offset) / actuator.gain;
            let one = if demand.is_nan() {
                let held = actuator.take(actuator.command, self.dt);
                Applied { saturated: true, ..held }
            } else {
                actuator.take(demand, self.dt)
            };
            *command = actuator.command;
            all.saturated |= one.saturated;
            all.rate_limited |= one.rate_limited;
        }
        all
    }

    /// Applies the limits to commands of a law without a model. Lags are not inverted.
    ///
    /// # Panics
    /// If `commands` has not one number for each actuator.
    pub fn limit(&mut self, commands: &mut [f64]) -> Applied {
        assert_eq!(commands.len(), self.all.len(), "one command for each actuator");
        self.held_s = 0.0;
        let mut all = Applied::default();
        for (actuator, command) in self.all.iter_mut().zip(commands) {
            let demand = if command.is_nan() { actuator.command } else { *command };
            let one = actuator.take(demand, self.dt);
            *command = actuator.command;
            all.saturated |= one.saturated;
            all.rate_limited |= one.rate_limited;
        }
        all
    }

    /// Commands without an estimate: the last ones for a second, then rest, within the rate limits.
    ///
    /// # Panics
    /// If `commands` has not one number for each actuator.
    pub fn hold(&mut self, commands: &mut [f64]) {
        assert_eq!(commands.len(), self.all.len(), "one command for each actuator");
        // Half a sample covers the rounding of the sum.
        let expired = self.held_s >= HOLD_S - 0.5 * self.dt;
        self.held_s += self.dt;
        for (actuator, command) in self.all.iter_mut().zip(commands) {
            let demand = if expired { actuator.limits.rest } else { actuator.command };
            actuator.take(demand, self.dt);
            *command = actuator.command;
        }
    }
}
