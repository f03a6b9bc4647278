//! Prediction of the way on which the boat turns back.

use super::fence::Fence;

/// Longest predicted way, in steps.
const STEPS: usize = 400;
/// Steps per time constant and radian of turning.
const RESOLUTION: f64 = 15.0;

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
    /// Whether the boat moves inward at the end.
    pub(super) returns: bool,
    /// Side of the turn: 1 starboard, -1 port.
    pub(super) side: f64,
}

impl Way {
    /// Whether the boat returns with a distance from the fence.
    pub(super) fn keeps(&self, margin: f64) -> bool {
        self.returns && self.margin >= margin
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
    pub(super) drift: [f64; 2],
    pub(super) sideslip: f64,
    pub(super) dt: f64,
}

impl<F: Fn(f64, f64) -> f64> TurningBack<F> {
    /// The way back to the better side.
    pub(super) fn way(&self, fence: &Fence, start: &Start) -> Way {
        let way = |side: f64| {
            let mut margin = f64::INFINITY;
            let returns = self.path(
                start,
                side,
                |n, e| fence.inward(n, e),
                |n, e| {
                    margin = margin.min(fence.margin(n, e));
                    margin >= 0.0
                },
            );
            Way { margin, returns, side }
        };
        let (starboard, port) = (way(1.0), way(-1.0));
        if (starboard.returns, starboard.margin) >= (port.returns, port.margin) { starboard } else { port }
    }

    /// Distance that is needed ahead to turn back at a speed, in the direction of the drift \[m\].
    pub(super) fn distance(&self, speed: f64) -> f64 {
        let [cn, ce] = self.drift;
        let psi = ce.atan2(cn);
        let (sin, cos) = psi.sin_cos();
        let start = Start { north: 0.0, east: 0.0, psi, speed, rate: 0.0 };
        let mut farthest = 0.0_f64;
        let returned = self.path(
            &start,
            1.0,
            |_, _| [-cos, -sin],
            |n, e| {
                farthest = farthest.max(n * cos + e * sin);
                true
            },
        );
        if returned { farthest } else { f64::INFINITY }
    }

    /// Follows the way until the boat moves inward over ground; returns whether it does. `visit` returns whether to go on.
    fn path(
        &self,
        start: &Start,
        side: f64,
        inward: impl Fn(f64, f64) -> [f64; 2],
        mut visit: impl FnMut(f64, f64) -> bool,
    ) -> bool {
        let Start { mut north, mut east, mut psi, mut speed, mut rate } = *start;
        for _ in 0..STEPS {
            let aim = (self.yaw_rate)(side, speed.max(0.0)).max(0.0);
            let h = (self.turn_s.min(1.0 / aim.max(1e-3)) / RESOLUTION).max(self.dt);
            let (sin, cos) = psi.sin_cos();
            let slip = self.sideslip * rate;
            let vn = speed * cos - slip * sin + self.drift[0];
            let ve = speed * sin + slip * cos + self.drift[1];
            let [dn, de] = inward(north, east);
            if !visit(north, east) {
                return false;
            }
            // The heading must be inward as well: a turn away from there would go on outward.
            if vn * dn + ve * de >= 0.0 && (cos * dn + sin * de >= 0.0) && speed > 0.0 {
                return true;
            }
            north += h * vn;
            east += h * ve;
            psi += h * rate;
            rate += (side * aim - rate) * (1.0 - (-h / self.turn_s).exp());
            speed += (self.speed - speed) * (1.0 - (-h / self.push_s).exp());
        }
        false
    }
}
