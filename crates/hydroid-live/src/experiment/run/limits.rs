//! Speeds, pushes and turns that fence and limits permit.

use super::super::motion::Motion;
use super::super::part::Situation;
use super::{Experiment, FIRST_PUSH, FIRST_TURN, Phase, STEADY_SPEED};

/// Share of the size of the fence that turning back may need: it limits the speed.
const TO_TURN_BACK: f64 = 0.5;
/// Share of the size of the fence above which it is too small for the boat.
const MOST_TO_TURN_BACK: f64 = 0.75;
/// Time after which a fence or limits that do not fit the boat are believed \[s\].
const UNFIT_S: f64 = 5.0;
/// Speeds for which the distance is computed.
const SPEEDS: u32 = 16;
/// Share of the yaw rate limit that a steady turn may reach.
const STEADY_RATE: f64 = 0.85;
/// Push below which the fence is considered too small.
const TOO_WEAK: f64 = 0.05;
/// Time between two computations of the permitted speed \[s\].
const SPEED_LIMIT_S: f64 = 1.0;

impl Experiment {
    /// Computes the permitted speed from time to time; returns a cause to abort.
    pub(super) fn limit_speed(&mut self, dt: f64) -> Option<String> {
        self.since_limit_s += dt;
        if self.since_limit_s < SPEED_LIMIT_S || self.is_blind() {
            return None;
        }
        self.since_limit_s = 0.0;
        let drift = self.drift.speed();
        let by_limit = STEADY_SPEED * self.settings.max_speed_m_s - drift;
        if matches!(self.phase, Phase::Probe(_)) {
            // The turning at full push and turn is not known yet.
            self.speed_limit = by_limit.max(0.0);
            return None;
        }
        let size = self.settings.fence.size();
        let model = self.model(true);
        let speeds = (1..=SPEEDS).map(|k| self.settings.max_speed_m_s * f64::from(k) / f64::from(SPEEDS));
        // A drifting boat may need some speed to turn back at all: the shortest distance is not always at the lowest speed.
        let mut permitted = None;
        let mut best = [0.0, f64::INFINITY];
        for speed in speeds {
            let distance = model.distance(speed);
            if distance <= TO_TURN_BACK * size {
                permitted = Some(speed);
            }
            if distance < best[1] {
                best = [speed, distance];
            }
        }
        drop(model);
        let [best, distance] = best;
        self.speed_limit = permitted.unwrap_or(best.max(self.return_speed())).min(by_limit);
        let cause = if by_limit <= drift {
            format!(
                "the boat drifts at {drift:.2} m/s, too fast for a speed limit of {:.2} m/s: raise the limit to at least \
                 {:.2} m/s, or wait for less current and wind",
                self.settings.max_speed_m_s,
                2.5 * drift
            )
        } else if distance.is_infinite() {
            format!(
                "the boat cannot return against its drift of {drift:.2} m/s: wait for less current and wind"
            )
        } else if distance > MOST_TO_TURN_BACK * size {
            format!(
                "the fence is too small: to turn back at {best:.2} m/s, with a drift of {drift:.2} m/s, the boat needs \
                 {distance:.0} m; widen the fence from {size:.0} m to at least {:.0} m",
                distance / TO_TURN_BACK
            )
        } else if self.largest_push() < TOO_WEAK {
            format!(
                "the fence or the speed limit is too small for the boat: {:.2} m/s are permitted, which needs less than \
                 {:.0} % of its push; widen the fence, or raise the limit",
                self.speed_limit,
                100.0 * TOO_WEAK
            )
        } else {
            self.unfit_s = 0.0;
            return None;
        };
        // The estimates must agree for some time.
        self.unfit_s += SPEED_LIMIT_S;
        (self.unfit_s > UNFIT_S).then_some(cause)
    }

    pub(super) fn largest_push(&self) -> f64 {
        let [ceiling, _] = self.governor.ceilings();
        let known = self.response.push_below(self.speed_limit).unwrap_or(FIRST_PUSH * self.settings.level);
        self.settings.level.min(ceiling).min(known)
    }

    pub(super) fn largest_turn(&self, speed: f64) -> f64 {
        let [_, ceiling] = self.governor.ceilings();
        let known =
            self.response.yaw_gain(speed.max(0.0)).map_or(FIRST_TURN * self.allocation.turn, |gain| {
                STEADY_RATE * self.settings.max_yaw_rate_rad_s / gain.max(f64::MIN_POSITIVE)
            });
        self.allocation.turn.min(ceiling).min(known)
    }

    pub(super) fn situation(&self, motion: &Motion, speed: f64) -> Situation {
        let push = self.largest_push();
        let turn = self.largest_turn(speed);
        let [push_s, turn_s] = self.scales();
        let astern = if self.allocation.astern < 0.0 { -push } else { 0.0 };
        Situation {
            dt: motion.dt,
            psi: motion.psi,
            r: motion.r,
            speed,
            push_s,
            turn_s,
            push: [astern, push],
            turn,
            full_turn: self.allocation.turn,
            turn_beside: [1.0, 0.5].map(|share| turn.min(self.allocation.turn_beside(share * push))),
            yaw_gain: self.response.yaw_gain(speed.max(0.0)).unwrap_or(self.settings.max_yaw_rate_rad_s),
        }
    }
}
