//! The way back: towards the middle, and to the end.

use std::f64::consts::FRAC_PI_4;

use super::super::motion::{Motion, wrap};
use super::super::turning_back::{Start, TurningBack, Way};
use super::{Experiment, FIRST_PUSH, Pause, Phase, STEADY_SPEED, Step, TO_END};

/// Distance that is kept on the way back, as a share of the size of the fence.
const KEPT: f64 = 0.05;
/// Around the middle, each heading is good to go on.
const MIDDLE: f64 = 0.75;
/// Caution with the learnt response: factors on yaw rate and time constant.
const CAUTIOUS_RATE: f64 = 0.75;
const CAUTIOUS_TIME: f64 = 1.3;
/// Share of the speed at full push with which the boat returns, and its least multiple of the drift.
const RETURN_SPEED: f64 = 0.5;
const RETURN_DRIFT: f64 = 2.0;
/// Share of the largest push that is always left beside a turn on the way back.
const RETURN_PUSH: f64 = 0.5;
/// Time kept for the end: time scales, and at most this share of the duration.
const END_SCALES: f64 = 3.0;
const END_SHARE: f64 = 0.3;

impl Experiment {
    /// Speed through the water with which the boat returns \[m/s\].
    pub(super) fn return_speed(&self) -> f64 {
        let full = self.full_speed();
        let drift = self.drift.speed();
        let limit = STEADY_SPEED * self.settings.max_speed_m_s - drift;
        (RETURN_SPEED * full).max(RETURN_DRIFT * drift).min(full).min(limit).max(0.0)
    }

    /// Speed at the largest push on the way back \[m/s\].
    pub(super) fn full_speed(&self) -> f64 {
        self.response.speed_at(self.return_push_limit()).unwrap_or(0.0)
    }

    /// Largest push on the way back: a current may need more than what the fence permits otherwise.
    pub(super) fn return_push_limit(&self) -> f64 {
        let [ceiling, _] = self.governor.ceilings();
        self.settings.level.min(ceiling)
    }

    /// Largest turn on the way back: it leaves the push, because a boat that turns on the spot only drifts.
    pub(super) fn return_turn(&self) -> f64 {
        self.allocation.turn_beside(RETURN_PUSH * self.return_push_limit())
    }

    pub(super) fn model(&self, cautious: bool) -> TurningBack<impl Fn(f64, f64) -> f64 + '_> {
        let (rate, [push_s, turn_s]) = if cautious {
            (CAUTIOUS_RATE, self.plausible(self.response.upper_times()).map(|scale| CAUTIOUS_TIME * scale))
        } else {
            (1.0, self.scales())
        };
        let most = self.return_turn();
        // Thrusters that only push ahead push the boat while they turn it.
        let pushed = self.response.speed_at(self.allocation.least_push_beside(most)).unwrap_or(0.0);
        TurningBack {
            yaw_rate: move |side: f64, speed: f64| {
                let limit = most.min(self.largest_turn(speed));
                let [made, other] =
                    [side, -side].map(|side| self.response.yaw_rate(side, speed, limit).unwrap_or(0.0));
                if cautious { rate * made.min(other) } else { made }
            },
            push_s,
            turn_s,
            speed: self.return_speed().max(pushed),
            full_speed: self.full_speed(),
            drift: self.drift.velocity(),
            sideslip: self.drift.sideslip(),
            dt: self.settings.dt_s,
        }
    }

    /// The ways back from here, to starboard and to port.
    pub(super) fn ways_back(&self, motion: &Motion, speed: f64, cautious: bool) -> [Way; 2] {
        let start = Start { north: motion.north, east: motion.east, psi: motion.psi, speed, rate: motion.r };
        self.model(cautious).ways(&self.settings.fence, &start)
    }

    /// The better way back from here.
    pub(super) fn way_back(&self, motion: &Motion, speed: f64, cautious: bool) -> Way {
        Way::better(self.ways_back(motion, speed, cautious), self.kept(motion))
    }

    /// Distance from the fence at which the boat comes to rest without a push, with the slower time constant \[m\].
    pub(super) fn margin_at_rest(&self, motion: &Motion) -> f64 {
        let [push_s, _] = self.plausible(self.response.upper_times());
        let [vn, ve] = motion.velocity();
        let way_s = CAUTIOUS_TIME * push_s;
        self.settings.fence.margin(motion.north + way_s * vn, motion.east + way_s * ve)
    }

    /// Distance from the fence that is kept \[m\]: a share of its size, and the way in two steps.
    pub(super) fn kept(&self, motion: &Motion) -> f64 {
        KEPT * self.settings.fence.size() + 2.0 * motion.dt * motion.speed()
    }

    /// Whether the boat is well inside and headed inward, or in the middle.
    pub(super) fn is_well_inside(&self, motion: &Motion, speed: f64, share: f64) -> bool {
        let fence = &self.settings.fence;
        let size = fence.size();
        let margin = fence.margin(motion.north, motion.east);
        let [dn, de] = fence.inward(motion.north, motion.east);
        let headed = wrap(de.atan2(dn) - motion.psi).abs() < FRAC_PI_4;
        let [vn, ve] = motion.velocity();
        let inward = headed && vn * dn + ve * de >= 0.0;
        (margin >= MIDDLE * size || (margin >= share * size && inward))
            && self.way_back(motion, speed, true).keeps(2.0 * self.kept(motion))
    }

    /// Turns towards the middle and goes there at a moderate speed.
    pub(super) fn go_back(&mut self, motion: &Motion, speed: f64, mut pause: Pause) -> Step {
        pause.elapsed_s += motion.dt;
        let margin = self.settings.fence.margin(motion.north, motion.east);
        let [push_s, turn_s] = self.scales();
        // The boat must always be able to turn back or to stop. If it cannot turn back, it is stopped at the last moment at
        // which it comes to rest inside.
        let at_rest = self.margin_at_rest(motion);
        let kept = self.kept(motion);
        if at_rest < kept && at_rest >= 0.0 && !self.way_back(motion, speed, false).keeps(0.0) {
            return Step::Abort(format!(
                "the boat cannot turn back within the remaining {margin:.0} m: it needs a larger fence, or less speed, \
                 current and wind (drift {:.2} m/s)",
                self.drift.speed()
            ));
        }
        if pause.elapsed_s > 10.0 * (push_s + turn_s) + 4.0 * self.settings.fence.size() / self.made_good() {
            return Step::Abort(format!(
                "the boat has not come back to the middle for {:.0} s: check for current and wind (drift {:.2} m/s), and \
                 whether the push suffices",
                pause.elapsed_s,
                self.drift.speed()
            ));
        }
        let demand = self.return_demand(motion, speed, &mut pause.side);
        if let Some(kept) = &mut self.pause {
            *kept = pause;
        }
        self.send(motion, demand, false)
    }

    /// Push and turn towards the middle.
    pub(super) fn return_demand(&self, motion: &Motion, speed: f64, side: &mut Option<f64>) -> [f64; 2] {
        let mut now = self.situation(motion, speed);
        now.turn = now.turn.min(self.return_turn());
        let aim = self.return_speed();
        // As it is predicted: full turn to the side that was better, then the heading is held.
        let model = self.model(false);
        let heading = model.heading(self.settings.fence.inward(motion.north, motion.east));
        let turns = model.turns(wrap(heading - motion.psi), motion.r, speed);
        let turn = if speed <= 0.0 {
            0.0
        } else if turns {
            let ways = self.ways_back(motion, speed, true);
            let better = Way::better(ways, self.kept(motion));
            // The side is kept as long as it leads back.
            let chosen = *side.get_or_insert(better.side);
            let leads_back = ways.iter().any(|way| way.side == chosen && way.time_s.is_some());
            if !leads_back && better.time_s.is_some() {
                *side = Some(better.side);
            }
            side.unwrap_or(better.side) * now.turn
        } else {
            *side = None;
            now.hold(heading)
        };
        // What the speed needs by what was seen, and proportional control.
        let most = self.return_push_limit();
        let known = self.response.push_below(aim).unwrap_or(FIRST_PUSH * most);
        let push =
            if speed < 0.0 { most } else { (known + most * (aim - speed) / aim.max(1e-3)).clamp(0.0, most) };
        [push, turn]
    }

    /// Least speed over ground on the way back, against the drift \[m/s\].
    pub(super) fn made_good(&self) -> f64 {
        let speed = self.return_speed();
        (speed - self.drift.speed()).max(0.1 * speed).max(1e-3)
    }

    /// Time that is needed to end from here: some time scales, and the way back \[s\].
    pub(super) fn end_s(&self, motion: &Motion) -> f64 {
        let [push_s, turn_s] = self.scales();
        let fence = &self.settings.fence;
        let way = (TO_END * fence.size() - fence.margin(motion.north, motion.east)).max(0.0);
        (END_SCALES * (push_s + turn_s) + way / self.made_good()).min(END_SHARE * self.settings.duration_s)
    }

    /// Returns to where the boat can come to rest, and slows down.
    pub(super) fn end(&mut self, motion: &Motion, speed: f64, slowing: bool) -> Step {
        let [push_s, _] = self.scales();
        let margin = self.settings.fence.margin(motion.north, motion.east);
        let stop = 2.0 * push_s * motion.speed();
        let room = margin > TO_END * self.settings.fence.size() + stop;
        let late = self.remaining_s() < push_s && margin > stop;
        if slowing || room || late || self.is_blind() || self.is_well_inside(motion, speed, TO_END) {
            self.phase = Phase::Ending(true);
            if speed.abs() <= 0.3 * self.return_speed() {
                let cause = if self.parts.is_empty() { "all parts are done" } else { "the time is over" };
                return self.done(cause);
            }
            return self.send(motion, [0.0; 2], false);
        }
        let mut side = self.end_side;
        let demand = self.return_demand(motion, speed, &mut side);
        self.end_side = side;
        self.send(motion, demand, false)
    }
}
