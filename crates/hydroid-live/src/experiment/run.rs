//! An experiment that is running.

use std::collections::VecDeque;
use std::f64::consts::FRAC_PI_4;

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::allocation::Allocation;
use super::drift::Drift;
use super::explored::Explored;
use super::governor::Governor;
use super::kind::Kind;
use super::motion::{Motion, Observed, Observer, Seen, wrap};
use super::part::{Acceleration, Circle, Hold, Part, Sequence, Situation, Sweeps, Zigzag};
use super::probe::{Probe, Probed};
use super::response::Response;
use super::settings::Settings;
use super::turning_back::{Start, TurningBack, Way};

/// Distances from the fence, as shares of its size: at the start, at a start with the heading inward, and while nothing is
/// known of the turning.
const START: f64 = 0.45;
const START_INWARD: f64 = 0.25;
const BLIND: f64 = 1.0 / 6.0;
/// Distance that is kept on the way back, as a share of the size of the fence.
const KEPT: f64 = 0.05;
/// Share of the size of the fence that turning back may need: it limits the speed.
const TO_TURN_BACK: f64 = 0.5;
/// Share of the size of the fence above which it is too small for the boat.
const MOST_TO_TURN_BACK: f64 = 0.75;
/// Time after which a fence or limits that do not fit the boat are believed \[s\].
const UNFIT_S: f64 = 5.0;
/// Speeds for which the distance is computed.
const SPEEDS: u32 = 16;
/// Distance from the fence at which the experiment goes on, and at which it ends.
const WELL_INSIDE: f64 = 0.4;
const TO_END: f64 = 0.5;
/// Around the middle, each heading is good to go on.
const MIDDLE: f64 = 0.75;
/// Caution with the learnt response: factors on yaw rate and time constant.
const CAUTIOUS_RATE: f64 = 0.75;
const CAUTIOUS_TIME: f64 = 1.3;
/// Share of the speed limit that a steady push may reach.
const STEADY_SPEED: f64 = 0.9;
/// Share of the yaw rate limit that a steady turn may reach.
const STEADY_RATE: f64 = 0.85;
/// Shares of the largest push and turn while nothing is known.
const FIRST_PUSH: f64 = 0.5;
const FIRST_TURN: f64 = 0.5;
/// Share of the speed at full push with which the boat returns, and its least multiple of the drift.
const RETURN_SPEED: f64 = 0.5;
const RETURN_DRIFT: f64 = 2.0;
/// Share of the largest push that is always left beside a turn on the way back.
const RETURN_PUSH: f64 = 0.5;
/// Push below which the fence is considered too small.
const TOO_WEAK: f64 = 0.05;
/// Time for which commands go on while the position is unknown \[s\].
const BLIND_S: f64 = 0.5;
/// Memory of the drift, in time scales and at least \[s\].
const DRIFT_SCALES: f64 = 10.0;
const DRIFT_S: f64 = 120.0;
/// Time between two computations of the permitted speed \[s\].
const SPEED_LIMIT_S: f64 = 1.0;
/// Time kept for the end: time scales, and at most this share of the duration.
const END_SCALES: f64 = 3.0;
const END_SHARE: f64 = 0.3;

/// What to do now.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Send these commands, one for each input.
    Command(Vec<f64>),
    /// The experiment has ended as planned: stop sending commands.
    Done(String),
    /// The experiment must end at once: stop sending commands. The text contains cause and remedy.
    Abort(String),
}

#[derive(Clone, Debug)]
enum Phase {
    Probe(Box<Probe>),
    Parts,
    /// The boat returns and slows down; whether it slows down already.
    Ending(bool),
}

/// The boat returns to the middle.
#[derive(Clone, Copy, Debug)]
struct Pause {
    elapsed_s: f64,
    /// Side of a turn by more than a right angle.
    side: Option<f64>,
    /// Because of the fence, not only to start the next part well.
    at_fence: bool,
}

/// A part and the longest time it may take \[s\].
#[derive(Clone, Debug)]
struct Planned {
    part: Part,
    longest_s: f64,
    elapsed_s: f64,
}

/// An experiment. See the documentation of the [module](super).
#[derive(Clone, Debug)]
pub struct Experiment {
    kind: Kind,
    settings: Settings,
    allocation: Allocation,
    explored: Explored,
    rng: ChaCha8Rng,
    observer: Observer,
    response: Response,
    drift: Drift,
    governor: Governor,
    phase: Phase,
    pause: Option<Pause>,
    parts: VecDeque<Planned>,
    part_count: usize,
    motion: Option<Motion>,
    elapsed_s: f64,
    active_s: f64,
    pauses: u32,
    /// Push and turn that were sent last, the commands, and whether they belong to the experiment.
    sent: [f64; 2],
    commands: Vec<f64>,
    was_active: bool,
    /// Permitted speed through the water \[m/s\], and the time since its computation.
    speed_limit: f64,
    since_limit_s: f64,
    /// Time for which fence or limits have been unfit for the boat \[s\].
    unfit_s: f64,
    /// Side of the turn at the end.
    end_side: Option<f64>,
    over: Option<Step>,
}

impl Experiment {
    /// Plans an experiment; `explored` is what is known so far.
    ///
    /// # Errors
    /// If the settings are wrong, with the remedy.
    pub fn new(kind: Kind, settings: Settings, explored: &Explored) -> Result<Self, String> {
        kind.check()?;
        let allocation = settings.check()?;
        if !explored.fits(&allocation) {
            return Err(
                "what is explored belongs to other inputs than those of the settings: start with an empty \
                        `Explored`"
                    .into(),
            );
        }
        let parts = plan(kind, settings.duration_s, allocation.astern < 0.0);
        Ok(Self {
            kind,
            explored: explored.clone(),
            rng: ChaCha8Rng::seed_from_u64(settings.seed),
            observer: Observer::new(&settings),
            response: Response::new(settings.max_speed_m_s),
            drift: Drift::default(),
            governor: Governor::new(&settings),
            phase: Phase::Probe(Box::new(Probe::new(settings.duration_s, settings.max_speed_m_s))),
            pause: None,
            part_count: parts.len(),
            parts,
            motion: None,
            elapsed_s: 0.0,
            active_s: 0.0,
            pauses: 0,
            sent: [0.0; 2],
            commands: allocation.commands(0.0, 0.0),
            was_active: false,
            speed_limit: STEADY_SPEED * settings.max_speed_m_s,
            since_limit_s: f64::INFINITY,
            unfit_s: 0.0,
            end_side: None,
            over: None,
            allocation,
            settings,
        })
    }

    /// Takes a sample, and returns the commands until the next one.
    pub fn step(&mut self, seen: &Seen) -> Step {
        if let Some(over) = &self.over {
            return over.clone();
        }
        let step = match self.observer.add(seen) {
            Observed::Abort(cause) => Step::Abort(cause),
            Observed::Waiting => Step::Command(self.commands.clone()),
            Observed::Motion(motion) => self.advance(&motion),
        };
        if !matches!(step, Step::Command(_)) {
            self.over = Some(step.clone());
        }
        step
    }

    /// Share of the experiment that is done.
    pub fn progress(&self) -> f64 {
        if self.over.is_some() {
            return 1.0;
        }
        let time = self.elapsed_s / self.settings.duration_s;
        let is_finite = !matches!(self.kind, Kind::Chirp | Kind::Prbs | Kind::Auto);
        let parts = if is_finite && self.part_count > 0 {
            1.0 - self.parts.len() as f64 / self.part_count as f64
        } else {
            0.0
        };
        time.max(parts).clamp(0.0, 1.0)
    }

    /// Longest time until the end \[s\].
    pub fn remaining_s(&self) -> f64 {
        if self.over.is_some() { 0.0 } else { (self.settings.duration_s - self.elapsed_s).max(0.0) }
    }

    /// Time in which the experiment excited the boat, without pauses \[s\].
    pub fn active_s(&self) -> f64 {
        self.active_s
    }

    /// What is explored, including this experiment without its pauses.
    pub fn explored(&self) -> &Explored {
        &self.explored
    }

    /// Time constants of speed and yaw rate \[s\], once they are known.
    pub fn time_scales(&self) -> Option<[f64; 2]> {
        Some([self.response.push_s()?, self.response.turn_s()?])
    }

    /// What the experiment does now, for people.
    pub fn text(&self) -> String {
        match &self.over {
            Some(Step::Done(text)) => return text.clone(),
            Some(Step::Abort(text)) => return format!("aborted: {text}"),
            _ => {}
        }
        if self.motion.is_some_and(|motion| motion.unknown_s > BLIND_S) {
            return "position or heading are unknown: the boat slows down".into();
        }
        if let Some(pause) = self.pause {
            return if pause.at_fence {
                "the fence is near: the boat returns towards the middle".into()
            } else {
                "the boat goes to the middle for the next part".into()
            };
        }
        match &self.phase {
            Phase::Probe(probe) => probe.text(),
            Phase::Parts => self.parts.front().map_or_else(String::new, |planned| planned.part.text()),
            Phase::Ending(false) => "returns towards the middle to end".into(),
            Phase::Ending(true) => "slows down to end".into(),
        }
    }

    fn advance(&mut self, motion: &Motion) -> Step {
        if let Some(cause) = self.check_place(motion) {
            return Step::Abort(cause);
        }
        let dt = motion.dt;
        if self.motion.is_some() {
            self.elapsed_s += dt;
            self.learn(motion);
        }
        self.motion = Some(*motion);
        if self.elapsed_s >= self.settings.duration_s {
            return self.done("the time is over");
        }
        let speed = self.speed(motion);
        if motion.unknown_s > BLIND_S {
            return self.send(motion, [0.0; 2], false);
        }
        if let Some(cause) = self.limit_speed(dt) {
            return Step::Abort(cause);
        }
        if !matches!(self.phase, Phase::Ending(_)) && self.remaining_s() <= self.end_s(motion) {
            self.phase = Phase::Ending(false);
            self.pause = None;
        }
        if let Phase::Ending(slowing) = self.phase {
            return self.end(motion, speed, slowing);
        }
        if let Some(pause) = self.pause {
            if self.is_well_inside(motion, speed, WELL_INSIDE) {
                self.pause = None;
                self.resume();
            } else {
                return self.go_back(motion, speed, pause);
            }
        } else if self.is_blind() {
            let size = self.settings.fence.size();
            let stop = match &self.phase {
                Phase::Probe(probe) => probe.time_so_far() * motion.speed(),
                _ => 0.0,
            };
            if self.settings.fence.margin(motion.north, motion.east) < BLIND * size + stop {
                return Step::Abort(format!(
                    "the boat came near the fence before its turning was known: start in the middle of the fence; a \
                     boat that turns wider needs a fence larger than {size:.0} m"
                ));
            }
        } else {
            let cautious = self.response.is_turn_known();
            let way = self.way_back(motion, speed, cautious);
            if !way.keeps(self.kept(motion)) {
                let pause = Pause { elapsed_s: 0.0, side: Some(way.side), at_fence: true };
                self.pauses += 1;
                self.pause = Some(pause);
                return self.go_back(motion, speed, pause);
            }
        }
        match self.phase {
            Phase::Probe(_) => self.probe(motion, speed),
            _ => self.run_part(motion, speed),
        }
    }

    /// Checks the place, and at the first sample the room.
    fn check_place(&self, motion: &Motion) -> Option<String> {
        let fence = &self.settings.fence;
        let margin = fence.margin(motion.north, motion.east);
        if margin < 0.0 {
            return Some(if self.motion.is_none() {
                format!(
                    "the boat is {:.0} m outside of the fence: take it inside, or move the fence",
                    -margin
                )
            } else {
                format!("the boat has left the fence by {:.1} m: take over and bring it back", -margin)
            });
        }
        if self.motion.is_some() {
            return None;
        }
        let [dn, de] = fence.inward(motion.north, motion.east);
        let off = wrap(de.atan2(dn) - motion.psi).abs();
        let needed = if off < FRAC_PI_4 { START_INWARD } else { START } * fence.size();
        (margin < needed).then(|| {
            format!(
                "the boat is {margin:.0} m from the fence; it must be at least {needed:.0} m away, because its turning is \
                 not known yet: take it closer to the middle, or widen the fence"
            )
        })
    }

    /// Learns from the last commands and their effect.
    fn learn(&mut self, motion: &Motion) {
        if self.was_active {
            self.explored.see(motion.dt, &self.commands);
        }
        if motion.unknown_s > 0.0 {
            return;
        }
        let memory_s = (DRIFT_SCALES * self.scales()[0].max(self.scales()[1])).max(DRIFT_S);
        self.drift.add(motion.dt, motion.psi, motion.v, motion.r, memory_s);
        let speed = self.speed(motion);
        self.response.add(motion.dt, self.sent[0], self.sent[1], speed, motion.r);
        if let Some([push_s, turn_s]) = self.time_scales() {
            self.explored.set_time_scales(push_s, turn_s);
        }
    }

    /// Speed ahead through the water \[m/s\].
    fn speed(&self, motion: &Motion) -> f64 {
        motion.u - self.drift.along(motion.psi)
    }

    /// Time scales of speed and yaw rate, within what the samples and the duration can show \[s\].
    fn scales(&self) -> [f64; 2] {
        self.plausible([self.response.push_s(), self.response.turn_s()])
    }

    fn plausible(&self, scales: [Option<f64>; 2]) -> [f64; 2] {
        let [least, most] = [3.0 * self.settings.dt_s, 0.1 * self.settings.duration_s];
        scales.map(|scale| scale.unwrap_or(1.0).clamp(least, most.max(least)))
    }

    fn is_blind(&self) -> bool {
        matches!(&self.phase, Phase::Probe(probe) if probe.is_blind())
    }

    /// Speed through the water with which the boat returns \[m/s\].
    fn return_speed(&self) -> f64 {
        let full = self.full_speed();
        let drift = self.drift.speed();
        let limit = STEADY_SPEED * self.settings.max_speed_m_s - drift;
        (RETURN_SPEED * full).max(RETURN_DRIFT * drift).min(full).min(limit).max(0.0)
    }

    /// Speed at the largest push on the way back \[m/s\].
    fn full_speed(&self) -> f64 {
        self.response.speed_at(self.return_push_limit()).unwrap_or(0.0)
    }

    /// Largest push on the way back: a current may need more than what the fence permits otherwise.
    fn return_push_limit(&self) -> f64 {
        let [ceiling, _] = self.governor.ceilings();
        self.settings.level.min(ceiling)
    }

    /// Largest turn on the way back: it leaves the push, because a boat that turns on the spot only drifts.
    fn return_turn(&self) -> f64 {
        self.allocation.turn_beside(RETURN_PUSH * self.return_push_limit())
    }

    fn model(&self, cautious: bool) -> TurningBack<impl Fn(f64, f64) -> f64 + '_> {
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
    fn ways_back(&self, motion: &Motion, speed: f64, cautious: bool) -> [Way; 2] {
        let start = Start { north: motion.north, east: motion.east, psi: motion.psi, speed, rate: motion.r };
        self.model(cautious).ways(&self.settings.fence, &start)
    }

    /// The better way back from here.
    fn way_back(&self, motion: &Motion, speed: f64, cautious: bool) -> Way {
        Way::better(self.ways_back(motion, speed, cautious), self.kept(motion))
    }

    /// Distance from the fence at which the boat comes to rest without a push, with the slower time constant \[m\].
    fn margin_at_rest(&self, motion: &Motion) -> f64 {
        let [push_s, _] = self.plausible(self.response.upper_times());
        let [vn, ve] = motion.velocity();
        let way_s = CAUTIOUS_TIME * push_s;
        self.settings.fence.margin(motion.north + way_s * vn, motion.east + way_s * ve)
    }

    /// Distance from the fence that is kept \[m\]: a share of its size, and the way in two steps.
    fn kept(&self, motion: &Motion) -> f64 {
        KEPT * self.settings.fence.size() + 2.0 * motion.dt * motion.speed()
    }

    /// Computes the permitted speed from time to time; returns a cause to abort.
    fn limit_speed(&mut self, dt: f64) -> Option<String> {
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
                "the boat cannot return against its drift of {drift:.2} m/s: wait for less current and wind, or raise the \
                 level of {:.2}",
                self.settings.level
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

    fn largest_push(&self) -> f64 {
        let [ceiling, _] = self.governor.ceilings();
        let known = self.response.push_below(self.speed_limit).unwrap_or(FIRST_PUSH * self.settings.level);
        self.settings.level.min(ceiling).min(known)
    }

    fn largest_turn(&self, speed: f64) -> f64 {
        let [_, ceiling] = self.governor.ceilings();
        let known =
            self.response.yaw_gain(speed.max(0.0)).map_or(FIRST_TURN * self.allocation.turn, |gain| {
                STEADY_RATE * self.settings.max_yaw_rate_rad_s / gain.max(f64::MIN_POSITIVE)
            });
        self.allocation.turn.min(ceiling).min(known)
    }

    fn situation(&self, motion: &Motion, speed: f64) -> Situation {
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

    /// Whether the boat is well inside and headed inward, or in the middle.
    fn is_well_inside(&self, motion: &Motion, speed: f64, share: f64) -> bool {
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
    fn go_back(&mut self, motion: &Motion, speed: f64, mut pause: Pause) -> Step {
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
    fn return_demand(&self, motion: &Motion, speed: f64, side: &mut Option<f64>) -> [f64; 2] {
        let mut now = self.situation(motion, speed);
        now.turn = now.turn.min(self.return_turn());
        let aim = self.return_speed();
        let [dn, de] = self.settings.fence.inward(motion.north, motion.east);
        let [cn, ce] = self.drift.velocity();
        let heading = (aim * de - ce).atan2(aim * dn - cn);
        // Full turn to the side that was predicted to be the better one, until stopping the turn leaves less than 45 degrees.
        let off = wrap(heading - motion.psi);
        let left = off - self.model(false).stopping_angle(motion.r, speed);
        let turn = if speed <= 0.0 {
            0.0
        } else if off.abs() > FRAC_PI_4 && left.abs() > FRAC_PI_4 {
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

    fn resume(&mut self) {
        match &mut self.phase {
            Phase::Probe(probe) => probe.resume(),
            Phase::Parts => {
                if let Some(planned) = self.parts.front_mut() {
                    planned.part.resume();
                }
            }
            Phase::Ending(_) => {}
        }
    }

    fn probe(&mut self, motion: &Motion, speed: f64) -> Step {
        let [dn, de] = self.settings.fence.inward(motion.north, motion.east);
        let inner = if wrap(de.atan2(dn) - motion.psi) >= 0.0 { 1.0 } else { -1.0 };
        let Phase::Probe(probe) = &mut self.phase else { return self.run_part(motion, speed) };
        match probe.step(motion, speed, inner, &mut self.response) {
            Probed::Demand([push, turn]) => {
                let blind = probe.is_blind();
                let now = self.situation(motion, speed);
                let most = if blind { self.settings.level } else { now.push[1] };
                // Two thrusters cannot turn at full push.
                let turning = self.allocation.push_beside(0.5 * self.allocation.turn);
                let push = (push * self.settings.level).min(most).min(turning);
                let beside = self.allocation.turn_beside(push);
                let turn = turn * if blind { beside } else { now.turn.min(beside) };
                self.send(motion, [push, turn], true)
            }
            Probed::AtRest(velocity) => {
                self.drift = Drift::new(velocity);
                self.response.start(self.speed(motion), motion.r);
                self.send(motion, [0.0; 2], true)
            }
            Probed::Finished => {
                self.phase = Phase::Parts;
                self.begin_part(motion, speed);
                self.send(motion, self.sent, true)
            }
            Probed::Abort(cause) => Step::Abort(cause),
        }
    }

    /// Goes to the middle first if the boat is not well inside.
    fn begin_part(&mut self, motion: &Motion, speed: f64) {
        if !self.is_well_inside(motion, speed, WELL_INSIDE) {
            self.pause = Some(Pause { elapsed_s: 0.0, side: None, at_fence: false });
        }
    }

    fn run_part(&mut self, motion: &Motion, speed: f64) -> Step {
        let now = self.situation(motion, speed);
        let sufficient = self.since_limit_s == 0.0
            && self.kind == Kind::Auto
            && self.explored.missing_within(now.push, now.turn).is_empty();
        let Some(planned) = self.parts.front_mut() else {
            self.phase = Phase::Ending(false);
            return self.end(motion, speed, false);
        };
        planned.elapsed_s += motion.dt;
        let ends =
            planned.elapsed_s > planned.longest_s || (sufficient && matches!(planned.part, Part::Steps(_)));
        let demand = if ends { None } else { planned.part.demand(&now, &self.explored, &mut self.rng) };
        if let Some(demand) = demand {
            return self.send(motion, demand, true);
        }
        self.parts.pop_front();
        if self.parts.is_empty() {
            self.phase = Phase::Ending(false);
            return self.end(motion, speed, false);
        }
        self.begin_part(motion, speed);
        self.send(motion, self.sent, false)
    }

    /// Time that is needed to end from here: some time scales, and the way back \[s\].
    fn end_s(&self, motion: &Motion) -> f64 {
        let [push_s, turn_s] = self.scales();
        let fence = &self.settings.fence;
        let way = (TO_END * fence.size() - fence.margin(motion.north, motion.east)).max(0.0);
        (END_SCALES * (push_s + turn_s) + way / self.made_good()).min(END_SHARE * self.settings.duration_s)
    }

    /// Least speed over ground on the way back, against the drift \[m/s\].
    fn made_good(&self) -> f64 {
        let speed = self.return_speed();
        (speed - self.drift.speed()).max(0.1 * speed).max(1e-3)
    }

    /// Returns to where the boat can come to rest, and slows down.
    fn end(&mut self, motion: &Motion, speed: f64, slowing: bool) -> Step {
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

    fn done(&self, cause: &str) -> Step {
        let scales = self.time_scales().map_or_else(String::new, |[push_s, turn_s]| {
            format!("; time scales: {push_s:.1} s for speed, {turn_s:.1} s for yaw rate")
        });
        Step::Done(format!(
            "{} ended after {:.0} s, {cause}: {:.0} s of excitation, {} pauses at the fence{scales}; {}",
            self.kind,
            self.elapsed_s,
            self.active_s,
            self.pauses,
            self.explored.text()
        ))
    }

    /// Sends a push and a turn; `active`: they belong to the experiment.
    fn send(&mut self, motion: &Motion, demand: [f64; 2], active: bool) -> Step {
        let scales = self.scales();
        let [push, turn] = self.governor.apply(motion, demand, scales);
        self.commands = self.allocation.commands(push, turn);
        self.sent = self.allocation.demand(&self.commands);
        if active {
            self.active_s += motion.dt;
        } else if self.was_active {
            // A pause separates what was before from what comes after.
            self.explored.see(0.0, &[]);
        }
        self.was_active = active;
        Step::Command(self.commands.clone())
    }
}

/// The parts of an experiment; each may take a share of the duration.
fn plan(kind: Kind, duration_s: f64, astern: bool) -> VecDeque<Planned> {
    let free = f64::INFINITY;
    let zigzags = |degrees: f64| {
        [(1.0, 1.0), (1.0, -1.0), (0.5, 1.0), (0.5, -1.0)]
            .map(|(push, side)| (Part::Zigzag(Zigzag::new(degrees, push, side)), free))
    };
    let steps = || (Part::Steps([Hold::default(), Hold::default()]), free);
    let parts: Vec<(Part, f64)> = match kind {
        Kind::Zigzag(degrees) => zigzags(degrees).into(),
        Kind::Circle => [(1.0, 1.0), (0.5, 1.0), (1.0, 0.5)]
            .into_iter()
            .flat_map(|(push, turn)| [turn, -turn].map(|turn| (Part::Circle(Circle::new(push, turn)), free)))
            .collect(),
        Kind::Chirp => vec![(Part::Sweeps(Sweeps::new()), free)],
        // The sequences of push and turn start with different holds.
        Kind::Prbs => vec![(Part::Sequences(Box::new([Sequence::new(0), Sequence::new(2)])), free)],
        Kind::Acceleration => vec![(Part::Acceleration(Acceleration::new(astern)), free)],
        Kind::Auto => vec![
            (Part::Acceleration(Acceleration::new(astern)), 0.3),
            (Part::Zigzag(Zigzag::new(20.0, 1.0, 1.0)), 0.15),
            (Part::Zigzag(Zigzag::new(20.0, 0.5, -1.0)), 0.15),
            steps(),
        ],
    };
    parts
        .into_iter()
        .map(|(part, share)| Planned { part, longest_s: share * duration_s, elapsed_s: 0.0 })
        .collect()
}
