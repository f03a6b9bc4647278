//! Inversion of actuators: from efforts to commands within limits.

use alloc::vec::Vec;

use num_traits::Float;

use super::error::{ControlError, at_least, positive};
use crate::actuator::{Channel, Limits, Map};

/// Time for which the last commands are held without an estimate \[s\].
const HOLD_S: f64 = 1.0;

/// All actuators of a vessel.
///
/// The motion depends on the efforts `tau_i = phi_i(a_i)`; `a_i` is the position of an actuator (a force, an angle, revolutions) and `c_i`
/// its command. Over a sample of `dt` seconds the position changes from `a` to `a+ = e a + (1 - e) c`, `e = exp(-dt / T)`
/// ([`Lag`](crate::actuator::Lag), in general). The command for a wanted effort *at the end of the sample* is
///
/// ```text
/// a_w = phi^-1(tau_w)
/// a_t = a_w + (a - a_w) exp(-dt / response)
/// c   = (a_t - e a) / (1 - e),     within [low, high] and within rate dt of the last one
/// ```
///
/// `a` is measured or predicted from the commands. The inverse amplifies the demand by `1 / (1 - e)`, ten for a sample of a tenth of the
/// lag, and with it sensor noise. `response` \[s\] gives the actuator more time than one sample. (A demand on the *mean* effort over a
/// sample would oscillate: each sample corrects the overshoot of the sample before with the factor `e` only.)
///
/// Assumption: the lag is known. With a wrong lag, effort and motion are wrong until the feedback settles; in equilibrium `a = c`.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuators {
    all: Vec<Actuator>,
    dt: f64,
    /// Decay of the difference to the wanted position per sample.
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
    /// Estimate of the position.
    position: f64,
    /// The last command.
    command: f64,
}

impl Actuator {
    fn rest(&self) -> f64 {
        0.0_f64.clamp(self.limits.low, self.limits.high)
    }

    /// Steady-state position under a command.
    fn settled(&self, command: f64) -> f64 {
        (self.gain * command + self.offset) / (1.0 - self.decay)
    }

    fn reset(&mut self) {
        self.command = self.rest();
        self.position = self.settled(self.command);
    }

    /// Applies the command nearest to the demand and steps the position.
    fn take(&mut self, wished: f64, dt: f64) -> Applied {
        let Limits { low, high, rate } = self.limits;
        let inside = wished.clamp(low, high);
        let change = rate * dt;
        let command = inside.clamp((self.command - change).max(low), (self.command + change).min(high));
        self.position = self.decay * self.position + self.gain * command + self.offset;
        self.command = command;
        Applied { saturated: inside != wished, rate_limited: command != inside }
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
    /// Actuators at rest, asked every `dt` seconds; `response` seconds are given to them, 0 for one sample.
    ///
    /// # Errors
    /// If there are not as many limits as channels, or limits, lags, maps or times are not possible.
    pub fn new(
        channels: &[Channel],
        limits: &[Limits],
        dt: f64,
        response: f64,
    ) -> Result<Self, ControlError> {
        positive("the sample time", dt)?;
        at_least("the time that is given to the actuators", response, 0.0)?;
        if channels.len() != limits.len() {
            return Err(ControlError::Count { expected: channels.len(), given: limits.len() });
        }
        let mut all = Vec::with_capacity(channels.len());
        for (index, (channel, limits)) in channels.iter().zip(limits).enumerate() {
            if !limits.are_possible() {
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

    /// Replaces the channels after an update of the model; positions and commands stay.
    ///
    /// # Errors
    /// If a channel is not invertible or their number differs; nothing changes then.
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

    /// Sets all actuators to rest: settled under the command nearest to 0.
    pub fn reset(&mut self) {
        self.held_s = 0.0;
        self.all.iter_mut().for_each(Actuator::reset);
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

    /// The last command of an actuator.
    pub fn last_command(&self, index: usize) -> f64 {
        self.all[index].command
    }

    /// Commands for wanted efforts; steps the actuators, so that [`effort`](Self::effort) is the one at the end of the sample.
    ///
    /// An effort that is not finite leaves its command unchanged.
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
            let wished = (target - actuator.decay * actuator.position - actuator.offset) / actuator.gain;
            let one = if wished.is_nan() {
                let held = actuator.take(actuator.command, self.dt);
                Applied { saturated: true, ..held }
            } else {
                actuator.take(wished, self.dt)
            };
            *command = actuator.command;
            all.saturated |= one.saturated;
            all.rate_limited |= one.rate_limited;
        }
        all
    }

    /// Applies limits to the commands of a law without a model; lags are not inverted.
    ///
    /// # Panics
    /// If `commands` has not one number for each actuator.
    pub fn limit(&mut self, commands: &mut [f64]) -> Applied {
        assert_eq!(commands.len(), self.all.len(), "one command for each actuator");
        self.held_s = 0.0;
        let mut all = Applied::default();
        for (actuator, command) in self.all.iter_mut().zip(commands) {
            let wished = if command.is_nan() { actuator.command } else { *command };
            let one = actuator.take(wished, self.dt);
            *command = actuator.command;
            all.saturated |= one.saturated;
            all.rate_limited |= one.rate_limited;
        }
        all
    }

    /// Commands without an estimate: the last ones for a second, then those of rest, within their rates.
    ///
    /// # Panics
    /// If `commands` has not one number for each actuator.
    pub fn hold(&mut self, commands: &mut [f64]) {
        assert_eq!(commands.len(), self.all.len(), "one command for each actuator");
        // Half a sample makes up for the rounding of the sum.
        let tired = self.held_s >= HOLD_S - 0.5 * self.dt;
        self.held_s += self.dt;
        for (actuator, command) in self.all.iter_mut().zip(commands) {
            let wished = if tired { actuator.rest() } else { actuator.command };
            actuator.take(wished, self.dt);
            *command = actuator.command;
        }
    }
}
