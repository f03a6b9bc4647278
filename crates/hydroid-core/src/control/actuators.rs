//! From efforts to commands: lags inverted, limits kept.

use alloc::vec::Vec;

use num_traits::Float;

use super::error::{ControlError, at_least, positive};
use crate::actuator::{Channel, Limits, Map};

/// Seconds for which the last commands are held where there is nothing to go by.
const HOLD_S: f64 = 1.0;

/// All actuators of a vessel.
///
/// An effort `tau_i = phi_i(a_i)` is what the motion depends on; `a_i` the position of the actuator (a force, an angle,
/// revolutions); `c_i` its command. Over a sample of `dt` seconds the position goes from `a` to `a+ = e a + (1 - e) c`, `e
/// = exp(-dt / T)` ([`Lag`](crate::actuator::Lag), in general), so the command after which the effort *at the end of the sample* is the wanted one
/// is
///
/// ```text
/// a_w = phi^-1(tau_w)
/// a_t = a_w + (a - a_w) exp(-dt / response)
/// c   = (a_t - e a) / (1 - e),     within [low, high] and within rate dt of the last one
/// ```
///
/// `a` is what was measured, or else what the commands made of it. The inverse amplifies what is asked for by `1 / (1 -
/// e)`, ten for a sample of a tenth of the lag: noise of the sensors comes out as commands at their limits. `response`
/// \[s\] gives the actuator so much time instead of one sample. (To have the wanted effort in the *mean* over the sample
/// rings: each sample undoes what the one before has overdone, by a factor of `e` only.)
///
/// Assumed: the lag is known. With a wrong one effort and motion are wrong until the feedback has settled, not for good:
/// in equilibrium `a = c` whatever the lag.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuators {
    all: Vec<Actuator>,
    dt: f64,
    /// What is left, after a sample, of a difference to what is wanted.
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

    /// Position in the long run under a command.
    fn settled(&self, command: f64) -> f64 {
        (self.gain * command + self.offset) / (1.0 - self.decay)
    }

    fn reset(&mut self) {
        self.command = self.rest();
        self.position = self.settled(self.command);
    }

    /// Takes the command nearest to what is wished, and moves on; what held it back.
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

/// What became of wanted efforts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Applied {
    /// A command is at its limit.
    pub saturated: bool,
    /// A command could not change as fast as it should.
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

    /// Takes the channels of a model that has learned; positions and commands stay.
    ///
    /// # Errors
    /// If one cannot be inverted, or there are not as many as actuators: all stays as it was.
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

    /// How many there are.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Sample time \[s\].
    pub const fn dt(&self) -> f64 {
        self.dt
    }

    /// All at rest: under the command nearest to 0, for long.
    pub fn reset(&mut self) {
        self.held_s = 0.0;
        self.all.iter_mut().for_each(Actuator::reset);
    }

    /// Takes measured positions; what is not finite was not measured.
    pub fn observe(&mut self, positions: &[f64]) {
        for (actuator, &position) in self.all.iter_mut().zip(positions) {
            if position.is_finite() {
                actuator.position = position;
            }
        }
    }

    /// The effort of an actuator now.
    pub fn effort(&self, index: usize) -> f64 {
        let actuator = &self.all[index];
        actuator.map.value(actuator.position)
    }

    /// Half of the range of an actuator's effort in the long run, between the limits of its command.
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

    /// Commands for wanted efforts; then the sample is over, and [`effort`](Self::effort) is that of its end.
    ///
    /// An effort that is no number leaves its command as it was.
    ///
    /// # Panics
    /// If `efforts` or `commands` have not as many numbers as there are actuators.
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

    /// Commands given as they are, without lags inverted, and brought within their limits: of a law that knows no model.
    ///
    /// # Panics
    /// If `commands` has not as many numbers as there are actuators.
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

    /// Commands where there is nothing to go by: the last ones for a second, then those of rest, within their rates.
    ///
    /// # Panics
    /// If `commands` has not as many numbers as there are actuators.
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
