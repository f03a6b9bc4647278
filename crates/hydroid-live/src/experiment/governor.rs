//! Reduction of push and turn before a limit of speed or yaw rate is exceeded.

use super::motion::Motion;
use super::settings::Settings;

/// Share of a limit at which the governor acts.
const ACTS: f64 = 0.95;
/// Share of a limit above which a reaction lowers the ceiling of the command.
const CLOSE: f64 = 0.8;
/// Times by which speed and yaw rate are extrapolated \[s\].
const SPEED_AHEAD_S: f64 = 1.0;
const RATE_AHEAD_S: f64 = 0.5;
/// Time in which the governor takes a command back to nothing \[s\].
const BACK_S: f64 = 0.4;
/// Factor on a ceiling at each reaction, its growth per time scale, and its least value.
const LOWER: f64 = 0.85;
const GROWTH: f64 = 0.01;
const LEAST: f64 = 0.05;

/// One governed command.
#[derive(Clone, Copy, Debug)]
struct Governed {
    factor: f64,
    ceiling: f64,
    tripped: bool,
}

impl Governed {
    /// Factor on the command. `excess`: the extrapolated value exceeds the limit; `close`: the present value is close to it.
    fn advance(&mut self, dt: f64, excess: bool, close: bool, command: f64, scale_s: f64) {
        if excess {
            self.factor = (self.factor - dt / BACK_S).max(0.0);
            if !self.tripped && close {
                self.ceiling = (LOWER * command.abs().min(self.ceiling)).max(LEAST);
                self.tripped = true;
            }
        } else {
            self.factor = (self.factor + dt / scale_s).min(1.0);
            self.ceiling = (self.ceiling * (1.0 + GROWTH * dt / scale_s)).min(1.0);
            if self.factor >= 1.0 {
                self.tripped = false;
            }
        }
    }
}

/// Governor of speed and yaw rate.
///
/// A command is reduced while the value, extrapolated linearly, exceeds 95 % of its limit. Each reaction lowers a ceiling of
/// the command, so that the parts of an experiment stay below the limit by themselves afterwards.
#[derive(Clone, Debug)]
pub(super) struct Governor {
    max_speed: f64,
    max_yaw_rate: f64,
    push: Governed,
    turn: Governed,
}

impl Governor {
    pub(super) fn new(settings: &Settings) -> Self {
        let free = Governed { factor: 1.0, ceiling: 1.0, tripped: false };
        Self {
            max_speed: settings.max_speed_m_s,
            max_yaw_rate: settings.max_yaw_rate_rad_s,
            push: free,
            turn: free,
        }
    }

    /// Largest push and turn.
    pub(super) fn ceilings(&self) -> [f64; 2] {
        [self.push.ceiling, self.turn.ceiling]
    }

    /// The governed push and turn; `scales` are the time scales of speed and yaw rate \[s\].
    pub(super) fn apply(&mut self, motion: &Motion, [push, turn]: [f64; 2], scales: [f64; 2]) -> [f64; 2] {
        let dt = motion.dt;
        let speed = motion.speed() + SPEED_AHEAD_S * motion.speed_rate.max(0.0);
        self.push.advance(
            dt,
            speed > ACTS * self.max_speed,
            motion.speed() > CLOSE * self.max_speed,
            push,
            scales[0],
        );
        let rate = motion.r + RATE_AHEAD_S * motion.yaw_acceleration;
        self.turn.advance(
            dt,
            rate.abs() > ACTS * self.max_yaw_rate && rate * turn > 0.0,
            motion.r.abs() > CLOSE * self.max_yaw_rate,
            turn,
            scales[1],
        );
        [push * self.push.factor, turn * self.turn.factor]
    }
}
