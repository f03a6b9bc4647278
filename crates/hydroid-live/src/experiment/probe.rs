//! First steps, from which the time scales and the turning ability are estimated.

use super::motion::{Motion, wrap};
use super::response::{Response, SMALLEST_SPEED, SMALLEST_YAW_RATE};
use super::settling::Settling;

/// Shares of the largest push and turn in the first step.
const PUSH: f64 = 0.5;
const TURN: f64 = 0.5;
/// Time at rest: at least, and as a share of the duration and absolutely at most \[s\].
const REST_S: f64 = 2.0;
const REST_SHARE: f64 = 0.05;
const LONGEST_REST_S: f64 = 30.0;
/// Share of the speed limit below which a boat is considered at rest, and of the deceleration to it in a second.
const SLOW: f64 = 0.1;
/// Time without a response: as a share of the duration, and at most \[s\].
const WAIT_SHARE: f64 = 0.125;
const LONGEST_WAIT_S: f64 = 120.0;
/// Time scales after which a later step ends in any case.
const AT_MOST: f64 = 6.0;
/// Change of heading to the wrong side that shows a reversed input \[rad\].
const REVERSED: f64 = 0.8;
/// Change of heading before a yaw rate is taken as settled \[rad\]: a gust does not make it.
const LEAST_TURNED: f64 = 0.35;
/// Change of heading at which the responses are taken as settled in any case, since the drift of a boat that circles says
/// more than its speed \[rad\]: half a circle.
const TURNED: f64 = std::f64::consts::PI;
/// Number of the last turn.
const LAST_TURN: u32 = 2;
/// Interruptions of a turn by the fence after which it is left out.
const INTERRUPTIONS: u32 = 3;
/// A response that has settled has lasted this many time constants.
const SETTLED: f64 = 4.0;

/// Steps of the probe.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// No command: the drift is measured.
    Rest,
    /// Number of the turn, from 0.
    Turn(u32),
}

/// What the probe demands.
pub(super) enum Probed {
    /// Push and turn, as shares of the largest ones.
    Demand([f64; 2]),
    /// The velocity of the resting boat, north and east \[m/s\].
    AtRest([f64; 2]),
    Finished,
    Abort(String),
}

/// The probe: rest; half a turn command to the inner side until speed and yaw rate have settled; full turn to the other side at
/// the same push; full turn at full push to the inner side.
///
/// The boat turns from the beginning, so that it stays near its start until its turning is known.
#[derive(Clone, Debug)]
pub(super) struct Probe {
    stage: Stage,
    side: f64,
    elapsed_s: f64,
    rest_s: f64,
    wait_s: f64,
    max_speed: f64,
    turned: f64,
    psi: Option<f64>,
    raised: bool,
    interrupted: u32,
    speed: Option<Settling>,
    yaw: Option<Settling>,
    settled: [bool; 2],
}

impl Probe {
    pub(super) fn new(duration_s: f64, max_speed: f64) -> Self {
        Self {
            stage: Stage::Rest,
            side: 1.0,
            elapsed_s: 0.0,
            rest_s: (REST_SHARE * duration_s).min(LONGEST_REST_S),
            wait_s: (WAIT_SHARE * duration_s).min(LONGEST_WAIT_S),
            max_speed,
            turned: 0.0,
            psi: None,
            raised: false,
            interrupted: 0,
            speed: None,
            yaw: None,
            settled: [false; 2],
        }
    }

    /// Whether nothing is known of the turning yet.
    pub(super) fn is_blind(&self) -> bool {
        matches!(self.stage, Stage::Rest | Stage::Turn(0))
    }

    /// Time constant of the speed by the response so far \[s\].
    pub(super) fn time_so_far(&self) -> f64 {
        self.speed.as_ref().map_or(0.0, |speed| speed.so_far().time_s)
    }

    /// The current step begins again after a pause, or is left out if it was interrupted too often.
    pub(super) fn resume(&mut self) {
        let Stage::Turn(turn) = self.stage else { return };
        self.interrupted += 1;
        let skip = self.interrupted >= INTERRUPTIONS;
        self.begin(if skip { Stage::Turn(turn + 1) } else { self.stage });
    }

    fn begin(&mut self, stage: Stage) {
        if stage != self.stage {
            self.interrupted = 0;
        }
        self.stage = stage;
        self.elapsed_s = 0.0;
        self.turned = 0.0;
        self.psi = None;
        self.speed = None;
        self.yaw = None;
        self.settled = [false; 2];
    }

    /// `speed` is the one through the water; `inner` the side on which the middle of the fence lies.
    pub(super) fn step(
        &mut self,
        motion: &Motion,
        speed: f64,
        inner: f64,
        response: &mut Response,
    ) -> Probed {
        self.elapsed_s += motion.dt;
        let Stage::Turn(turn) = self.stage else {
            let slow =
                motion.speed() < SLOW * self.max_speed || motion.speed_rate.abs() < SLOW * motion.speed();
            let waited = self.elapsed_s >= self.rest_s;
            if waited || (self.elapsed_s >= REST_S && slow) {
                self.side = inner;
                self.begin(Stage::Turn(0));
                let at_rest = motion.speed() < 3.0 * SLOW * self.max_speed;
                return Probed::AtRest(if at_rest { motion.velocity() } else { [0.0; 2] });
            }
            return Probed::Demand([0.0; 2]);
        };
        if turn > LAST_TURN {
            return Probed::Finished;
        }
        let side = if turn % 2 == 0 { self.side } else { -self.side };
        self.turned += self.psi.map_or(0.0, |before| wrap(motion.psi - before)) * side;
        self.psi = Some(motion.psi);
        let shortest_s = (10.0 * motion.dt).max(1.0);
        let yaw =
            self.yaw.get_or_insert_with(|| Settling::new(response.rate(), SMALLEST_YAW_RATE, shortest_s));
        let rate_change = yaw.change() * side;
        let turned_enough = self.turned.abs() >= LEAST_TURNED;
        let circled = self.turned.abs() >= TURNED;
        let settled_yaw =
            yaw.add(motion.dt, motion.r).filter(|_| turned_enough).or_else(|| circled.then(|| yaw.so_far()));
        let speeds =
            self.speed.get_or_insert_with(|| Settling::new(response.speed(), SMALLEST_SPEED, shortest_s));
        let speed_change = speeds.change();
        let settled_speed =
            speeds.add(motion.dt, speed).or_else(|| (circled && turn == 0).then(|| speeds.so_far()));
        if let Some(settled) = settled_yaw.filter(|_| !self.settled[0]) {
            self.settled[0] = true;
            if settled.change * side > 0.0 {
                let time_s = settled.time_s.max(motion.dt);
                // The speed still rises in turns 0 and 2.
                if turn == 1 {
                    response.add_turn_s(time_s);
                } else if turn == 0 {
                    response.bound_turn_s(time_s);
                }
            }
        }
        if let Some(settled) = settled_speed.filter(|_| !self.settled[1]) {
            self.settled[1] = true;
            if turn == 0 && settled.change > 0.0 {
                response.add_push_s(settled.time_s.max(motion.dt));
            }
        }
        if turn == 0 {
            if let Some(end) = self.first_turn(motion.dt, rate_change, speed_change, response) {
                return end;
            }
            let raise = if self.raised { 2.0 } else { 1.0 };
            return Probed::Demand([PUSH * raise, side * TURN * raise]);
        }
        let [push_s, turn_s] =
            [response.push_s(), response.turn_s()].map(|scale| scale.unwrap_or(self.wait_s / AT_MOST));
        let full = turn >= LAST_TURN;
        let done = if full { self.settled == [true; 2] } else { self.settled[0] };
        let longest_s = AT_MOST * if full { push_s.max(turn_s) } else { turn_s };
        // The yaw rate of a turn is kept after some time constants.
        if (done && self.elapsed_s >= SETTLED * turn_s) || self.elapsed_s >= longest_s {
            if full {
                return Probed::Finished;
            }
            self.begin(Stage::Turn(turn + 1));
        }
        Probed::Demand(match turn {
            1 => [PUSH * if self.raised { 2.0 } else { 1.0 }, side],
            _ => [1.0, side],
        })
    }

    /// End of the first turn, or an abort if the boat does not do what it should.
    fn first_turn(
        &mut self,
        dt: f64,
        rate_change: f64,
        speed_change: f64,
        response: &mut Response,
    ) -> Option<Probed> {
        if self.turned < -REVERSED && rate_change < -SMALLEST_YAW_RATE {
            return Some(Probed::Abort(
                "the boat turned to the other side than commanded: reverse each input in `turn`, or check \
                 the order of the inputs"
                    .into(),
            ));
        }
        if self.settled[1] && speed_change < -SMALLEST_SPEED {
            return Some(Probed::Abort(
                "the boat went astern when it was pushed ahead: reverse each input in `push`, or check the \
                 order of the inputs"
                    .into(),
            ));
        }
        if self.settled == [true; 2] {
            response.keep(dt);
            self.begin(Stage::Turn(1));
            return None;
        }
        let responded = [rate_change > SMALLEST_YAW_RATE, speed_change > SMALLEST_SPEED];
        if !self.raised && self.elapsed_s > 0.5 * self.wait_s && responded != [true; 2] {
            self.raised = true;
        }
        if self.elapsed_s < self.wait_s {
            return None;
        }
        if responded == [true; 2] {
            // Gusts kept the response from settling.
            if response.push_s().is_none() {
                response.add_push_s((self.elapsed_s / SETTLED).max(dt));
            }
            if response.turn_s().is_none() {
                response.bound_turn_s((self.elapsed_s / SETTLED).max(dt));
            }
            response.keep(dt);
            self.begin(Stage::Turn(1));
            return None;
        }
        let [turned, pushed] = responded;
        let what = match (pushed, turned) {
            (false, false) => "neither pushing nor turning had an effect",
            (false, true) => "pushing had no effect",
            _ => "turning had no effect",
        };
        Some(Probed::Abort(format!(
            "{what} within {:.0} s: check that the boat is armed, in a mode that takes commands, and that the inputs are \
             the right ones; a boat that is slower needs a longer duration",
            self.elapsed_s
        )))
    }

    /// What the probe does, for people.
    pub(super) fn text(&self) -> String {
        match self.stage {
            Stage::Rest => "rests, to measure the drift".into(),
            Stage::Turn(turn) => {
                format!("measures how the boat responds: turn {} of {}", turn + 1, LAST_TURN + 1)
            }
        }
    }
}
