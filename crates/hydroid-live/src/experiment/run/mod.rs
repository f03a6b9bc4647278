//! An experiment that is running.

mod limits;
mod parts;
mod way_back;

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
use super::probe::Probe;
use super::response::Response;
use super::settings::Settings;
use parts::{Planned, plan};

/// Distances from the fence, as shares of its size: at the start, at a start with the heading inward, and while nothing is
/// known of the turning.
const START: f64 = 0.45;
const START_INWARD: f64 = 0.25;
const BLIND: f64 = 1.0 / 6.0;
/// Distance from the fence at which the experiment goes on, and at which it ends.
const WELL_INSIDE: f64 = 0.4;
const TO_END: f64 = 0.5;
/// Share of the speed limit that a steady push may reach.
const STEADY_SPEED: f64 = 0.9;
/// Shares of the largest push and turn while nothing is known.
const FIRST_PUSH: f64 = 0.5;
const FIRST_TURN: f64 = 0.5;
/// Time for which commands go on while the position is unknown \[s\].
const BLIND_S: f64 = 0.5;
/// Memory of the drift, in time scales and at least \[s\].
const DRIFT_SCALES: f64 = 10.0;
const DRIFT_S: f64 = 120.0;

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
