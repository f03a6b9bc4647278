//! Commands that a control law can invert.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::f64::consts::FRAC_PI_2;

use num_traits::Float;

use super::invalid::InvalidCraft;
use super::servo::Servo;
use super::{Craft, RudderLaw, ThrustLaw};
use crate::actuator::{Channel, Lag, Map};

/// What a unit of effort of a command does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Effect {
    /// A force `[X, Y, N]` \[N, N, N m\].
    Force([f64; 3]),
    /// A yaw moment per surge velocity \[N s\].
    MomentPerSpeed(f64),
}

/// The path of a command to the motion: its actuator with a lag and a map, and the effect of the effort `phi(a)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CraftChannel {
    /// Lag and map; the position `a` of the actuator has the unit of the command.
    pub channel: Channel,
    /// Value of the command without an effect.
    pub neutral: f64,
    /// Effect of a unit of `phi(a) - phi(neutral)`.
    pub effect: Effect,
}

/// Reasons why a command of a craft has no inverse in closed form.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum NotAffineCraft {
    #[error(transparent)]
    Invalid(#[from] InvalidCraft),
    #[error(
        "the command '{command}' moves {actuators} actuators; a control law inverts a command that moves one"
    )]
    Several { command: String, actuators: usize },
    #[error("the order of {actuator} is a sum of commands; a control law inverts an order of one command")]
    Sum { actuator: String },
    #[error("{actuator} {reason}")]
    Actuator { actuator: String, reason: &'static str },
}

impl Craft {
    /// The path of each command to the motion. Each command moves one actuator: a fixed thruster whose force is
    /// proportional to its order, or a rudder that is a yaw moment.
    ///
    /// # Errors
    /// See [`NotAffineCraft`].
    pub fn channels(&self) -> Result<Vec<CraftChannel>, NotAffineCraft> {
        self.validate()?;
        (0..self.commands.len()).map(|command| self.channel(command)).collect()
    }

    fn channel(&self, command: usize) -> Result<CraftChannel, NotAffineCraft> {
        let moved = |servo: &Servo| servo.order.terms.iter().any(|term| term.0 == command);
        let actuators = self.servos().filter(|(_, servo)| moved(servo)).count();
        let Some((actuator, servo)) =
            self.servos().find(|(_, servo)| moved(servo)).filter(|_| actuators == 1)
        else {
            return Err(NotAffineCraft::Several { command: self.commands[command].name.clone(), actuators });
        };
        let &[(_, neutral, gain)] = servo.order.terms.as_slice() else {
            return Err(NotAffineCraft::Sum { actuator });
        };
        let refuse = |reason| Err(NotAffineCraft::Actuator { actuator: actuator.clone(), reason });
        if servo.rate.is_some() {
            return refuse("has a limit of its rate, which a control law does not invert");
        }
        let ends = self.commands[command].limits.map(|limit| gain * (limit - neutral));
        let [low, high] = servo.order.limits;
        if ends.into_iter().any(|end| !(low..=high).contains(&end)) {
            return refuse(
                "has limits of its order inside those of the command: state them as limits of the command",
            );
        }
        let lag = if servo.lag > 0.0 { Lag::of_time_constant(servo.lag) } else { Lag::None };
        let with = |map, effect| Ok(CraftChannel { channel: Channel { lag, map }, neutral, effect });
        for thruster in &self.thrusters {
            if format!("thruster.{}.steering", thruster.name) == actuator {
                return refuse("is a thruster that is steered, whose force is not affine in the command");
            }
            if format!("thruster.{}", thruster.name) != actuator {
                continue;
            }
            if thruster.steering.is_some() {
                return refuse("is steered, so that its force is not affine in the command");
            }
            if thruster.law != ThrustLaw::Linear {
                return refuse("has the quadratic law, which a control law does not invert");
            }
            if thruster.forward != thruster.reverse {
                return refuse(
                    "has another thrust ahead than astern, so that its force is not proportional to the order",
                );
            }
            if thruster.dead_band != 0.0 || thruster.speed_loss != 0.0 {
                return refuse(
                    "has a dead band or a loss of thrust with speed, so that its force is not proportional to the order",
                );
            }
            let (sin, cos) = Float::sin_cos(thruster.angle);
            let [x, y] = thruster.position;
            let force = [cos, sin, x * sin - y * cos].map(|d| d * thruster.forward * gain);
            return with(Map::Identity, Effect::Force(force));
        }
        let law = self.rudders.iter().find(|rudder| format!("rudder.{}", rudder.name) == actuator);
        match law.map(|rudder| &rudder.law) {
            Some(RudderLaw::Linear(k)) => with(Map::Identity, Effect::MomentPerSpeed(k * gain)),
            Some(RudderLaw::Sine(_)) if gain.abs() != 1.0 || neutral != 0.0 => {
                refuse("has an angle that is not the command itself: state the command as the angle")
            }
            Some(RudderLaw::Sine(_)) if ends.into_iter().any(|end| end.abs() > FRAC_PI_2) => {
                refuse("turns by more than a quarter turn, beyond which the moment decreases")
            }
            Some(RudderLaw::Sine(k)) => with(Map::Sine, Effect::MomentPerSpeed(k * gain)),
            Some(RudderLaw::Normal(_)) | None => {
                refuse("is a rudder in the flow, whose force is not affine in the command")
            }
        }
    }
}
