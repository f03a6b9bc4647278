//! The parts of each kind of experiment, and the probe before them.

use std::collections::VecDeque;

use super::super::drift::Drift;
use super::super::kind::Kind;
use super::super::motion::{Motion, wrap};
use super::super::part::{Acceleration, Circle, Hold, Part, Sequence, Sweeps, Zigzag};
use super::super::probe::Probed;
use super::{Experiment, Pause, Phase, Step, WELL_INSIDE};

/// A part and the longest time it may take \[s\].
#[derive(Clone, Debug)]
pub(super) struct Planned {
    pub(super) part: Part,
    pub(super) longest_s: f64,
    pub(super) elapsed_s: f64,
}

impl Experiment {
    pub(super) fn resume(&mut self) {
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

    pub(super) fn probe(&mut self, motion: &Motion, speed: f64) -> Step {
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
    pub(super) fn begin_part(&mut self, motion: &Motion, speed: f64) {
        if !self.is_well_inside(motion, speed, WELL_INSIDE) {
            self.pause = Some(Pause { elapsed_s: 0.0, side: None, at_fence: false });
        }
    }

    pub(super) fn run_part(&mut self, motion: &Motion, speed: f64) -> Step {
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
}

/// The parts of an experiment; each may take a share of the duration.
pub(super) fn plan(kind: Kind, duration_s: f64, astern: bool) -> VecDeque<Planned> {
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
