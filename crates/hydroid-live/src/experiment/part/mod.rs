//! Parts of an experiment: what is pushed and turned when.

mod signals;
mod trials;

use rand_chacha::ChaCha8Rng;

use super::explored::Explored;
use super::motion::wrap;
pub(super) use signals::{Hold, Sequence, Sweeps};
use signals::{push_pair, turn_pair};
pub(super) use trials::{Acceleration, Circle, Zigzag};

/// Situation in which a part acts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Situation {
    pub(super) dt: f64,
    pub(super) psi: f64,
    pub(super) r: f64,
    /// Speed through the water \[m/s\].
    pub(super) speed: f64,
    /// Time scale of the speed \[s\].
    pub(super) push_s: f64,
    /// Time scale of the yaw rate \[s\].
    pub(super) turn_s: f64,
    /// Permitted pushes.
    pub(super) push: [f64; 2],
    /// Permitted turn to either side.
    pub(super) turn: f64,
    /// Largest turn that the inputs can make.
    pub(super) full_turn: f64,
    /// Permitted turn that leaves the largest push, and half of it, as it is.
    pub(super) turn_beside: [f64; 2],
    /// Yaw rate per turn at this speed \[rad/s\].
    pub(super) yaw_gain: f64,
}

impl Situation {
    /// Turn that holds a heading.
    ///
    /// Proportional and derivative control of a first-order yaw response: the loop is critically damped, with the boat's own
    /// time scale.
    pub(super) fn hold(&self, heading: f64) -> f64 {
        if self.speed <= 0.0 {
            return 0.0;
        }
        let turn = (wrap(heading - self.psi) / self.turn_s - self.r) / self.yaw_gain.max(1e-6);
        turn.clamp(-self.turn, self.turn)
    }
}

/// A part.
#[derive(Clone, Debug)]
pub(super) enum Part {
    Zigzag(Zigzag),
    Circle(Circle),
    Sweeps(Sweeps),
    Sequences(Box<[Sequence; 2]>),
    Acceleration(Acceleration),
    Steps([Hold; 2]),
}

impl Part {
    /// Push and turn; `None` when the part has finished.
    pub(super) fn demand(
        &mut self,
        now: &Situation,
        explored: &Explored,
        rng: &mut ChaCha8Rng,
    ) -> Option<[f64; 2]> {
        match self {
            Self::Zigzag(zigzag) => zigzag.demand(now),
            Self::Circle(circle) => circle.demand(now),
            Self::Sweeps(sweeps) => Some(sweeps.demand(now, explored, rng)),
            Self::Sequences(sequences) => {
                let [push, turn] = &mut **sequences;
                let push = push.demand(now.dt, now.push_s, rng, |rng| push_pair(now, explored, rng));
                let turn = turn.demand(now.dt, now.turn_s, rng, |rng| turn_pair(now, explored, rng));
                Some([push, turn])
            }
            Self::Acceleration(acceleration) => acceleration.demand(now),
            Self::Steps([push, turn]) => {
                let push = push.demand(now.dt, now.push_s, rng, |rng| {
                    explored.least_explored_push(now.push, |_| false, rng)
                });
                let turn = turn.demand(now.dt, now.turn_s, rng, |rng| {
                    explored.least_explored_turn(now.turn, |_| false, rng)
                });
                Some([push, turn])
            }
        }
    }

    /// The part goes on after a pause.
    pub(super) fn resume(&mut self) {
        match self {
            Self::Zigzag(zigzag) => zigzag.resume(),
            Self::Circle(circle) => circle.resume(),
            Self::Acceleration(acceleration) => acceleration.resume(),
            Self::Sweeps(_) | Self::Sequences(_) | Self::Steps(_) => {}
        }
    }

    /// What the part does, for people.
    pub(super) fn text(&self) -> String {
        match self {
            Self::Zigzag(zigzag) => zigzag.text(),
            Self::Circle(circle) => circle.text(),
            Self::Sweeps(sweeps) => sweeps.text(),
            Self::Sequences(_) => "pseudo-random binary sequences of push and turn".into(),
            Self::Acceleration(acceleration) => acceleration.text(),
            Self::Steps(_) => "steps to the least explored levels of push and turn".into(),
        }
    }
}
