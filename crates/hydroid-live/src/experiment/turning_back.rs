//! Prediction of the way on which the boat turns back.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4, PI};

use super::fence::Fence;
use super::motion::wrap;

/// Longest predicted way, in steps.
const STEPS: u32 = 400;
/// Steps in the sum of both time constants and of the time of half a turn.
const RESOLUTION: f64 = 100.0;

/// Place and motion at the beginning of a turn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    pub(super) north: f64,
    pub(super) east: f64,
    pub(super) psi: f64,
    /// Speed through the water, ahead \[m/s\].
    pub(super) speed: f64,
    pub(super) rate: f64,
}

/// A predicted way back.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    /// Least distance from the fence \[m\], negative outside.
    pub(super) margin: f64,
    /// Time until the course leads to the middle \[s\], if it does.
    pub(super) time_s: Option<f64>,
    /// Side of the turn: 1 starboard, -1 port.
    pub(super) side: f64,
}

impl Way {
    /// Whether the boat returns with a distance from the fence.
    pub(super) fn keeps(&self, margin: f64) -> bool {
        self.time_s.is_some() && self.margin >= margin
    }

    /// The better of two ways: the earlier return if both keep a distance from the fence, and otherwise the larger distance.
    pub(super) fn better([a, b]: [Self; 2], kept: f64) -> Self {
        let is_first = match (a.keeps(kept), b.keeps(kept)) {
            (true, true) => a.time_s <= b.time_s,
            (false, false) => (a.time_s.is_some(), a.margin) >= (b.time_s.is_some(), b.margin),
            (first, _) => first,
        };
        if is_first { a } else { b }
    }
}

/// Model of a boat that turns back: first order in speed and yaw rate, with drift and sideslip.
#[derive(Clone, Copy, Debug)]
pub(super) struct TurningBack<F> {
    /// Yaw rate by side (1 starboard, -1 port) and speed \[rad/s\].
    pub(super) yaw_rate: F,
    pub(super) push_s: f64,
    pub(super) turn_s: f64,
    /// Speed at which the boat returns \[m/s\].
    pub(super) speed: f64,
    /// Speed at the largest push on the way back \[m/s\].
    pub(super) full_speed: f64,
    pub(super) drift: [f64; 2],
    pub(super) sideslip: f64,
    pub(super) dt: f64,
}

/// Whether a velocity leads to the middle: within 45 degrees of its direction.
///
/// The boat can go on from there, because the middle is then ahead. A boat that only moves inward may still pass the middle
/// on a side and need the turn that it no longer can make.
fn leads([vn, ve]: [f64; 2], [dn, de]: [f64; 2]) -> bool {
    vn * dn + ve * de >= FRAC_1_SQRT_2 * vn.hypot(ve)
}

impl<F: Fn(f64, f64) -> f64> TurningBack<F> {
    /// Heading towards the middle, against the drift; `inward` is the direction of the middle.
    pub(super) fn heading(&self, inward: [f64; 2]) -> f64 {
        let [cn, ce] = self.drift;
        (self.speed * inward[1] - ce).atan2(self.speed * inward[0] - cn)
    }

    /// Whether the boat turns fully: stopping the turn leaves more than 45 degrees to a heading. `off` is the angle to it.
    pub(super) fn turns(&self, off: f64, rate: f64, speed: f64) -> bool {
        let left = off - self.stopping_angle(rate, speed);
        off.abs() > FRAC_PI_4 && left.abs() > FRAC_PI_4
    }

    /// The ways back to starboard and to port.
    pub(super) fn ways(&self, fence: &Fence, start: &Start) -> [Way; 2] {
        [1.0, -1.0].map(|side| {
            let mut margin = f64::INFINITY;
            let time_s = self.path(
                start,
                side,
                |n, e| fence.inward(n, e),
                |n, e| {
                    margin = margin.min(fence.margin(n, e));
                    margin >= 0.0
                },
            );
            Way { margin, time_s, side }
        })
    }

    /// Distance that is needed ahead to turn back at a speed, in the direction of the drift \[m\].
    pub(super) fn distance(&self, speed: f64) -> f64 {
        let [cn, ce] = self.drift;
        let psi = ce.atan2(cn);
        let (sin, cos) = psi.sin_cos();
        let start = Start { north: 0.0, east: 0.0, psi, speed, rate: 0.0 };
        let mut farthest = 0.0_f64;
        let time_s = self.path(
            &start,
            1.0,
            |_, _| [-cos, -sin],
            |n, e| {
                farthest = farthest.max(n * cos + e * sin);
                true
            },
        );
        if time_s.is_some() { farthest } else { f64::INFINITY }
    }

    /// Angle by which the boat turns on while a yaw rate is stopped with the turn to the other side.
    fn stopping_angle(&self, rate: f64, speed: f64) -> f64 {
        let against = (self.yaw_rate)(-rate.signum(), speed.max(0.0)).max(1e-6);
        let size = rate.abs();
        rate.signum() * self.turn_s * (size - against * (1.0 + size / against).ln())
    }

    /// Follows the way until the course leads to the middle; returns the time until then. `visit` returns whether to go on.
    fn path(
        &self,
        start: &Start,
        side: f64,
        to_middle: impl Fn(f64, f64) -> [f64; 2],
        mut visit: impl FnMut(f64, f64) -> bool,
    ) -> Option<f64> {
        let Start { mut north, mut east, mut psi, mut speed, mut rate } = *start;
        let half_turn_s = PI / (self.yaw_rate)(side, self.speed).max(1e-3);
        let h = ((self.push_s + self.turn_s + half_turn_s) / RESOLUTION).max(self.dt);
        for step in 0..STEPS {
            let aim = (self.yaw_rate)(side, speed.max(0.0)).max(0.0);
            let (sin, cos) = psi.sin_cos();
            let slip = self.sideslip * rate;
            let vn = speed * cos - slip * sin + self.drift[0];
            let ve = speed * sin + slip * cos + self.drift[1];
            let [dn, de] = to_middle(north, east);
            if !visit(north, east) {
                return None;
            }
            // Full turn, then a heading is held. Going astern, the boat does not turn.
            let off = wrap(self.heading([dn, de]) - psi);
            let turns = self.turns(off, rate, speed);
            if !turns && speed > 0.0 && leads([vn, ve], [dn, de]) {
                return Some(f64::from(step) * h);
            }
            let demand = if speed <= 0.0 {
                0.0
            } else if turns {
                side * aim
            } else {
                (off / (2.0 * self.turn_s).max(4.0 * h)).clamp(-aim, aim)
            };
            north += h * vn;
            east += h * ve;
            let before = rate;
            rate += (demand - rate) * (1.0 - (-h / self.turn_s).exp());
            psi += 0.5 * h * (before + rate);
            // A boat that goes astern is stopped with the largest push.
            let aim = if speed < 0.0 { self.full_speed } else { self.speed };
            speed += (aim - speed) * (1.0 - (-h / self.push_s).exp());
        }
        None
    }
}
