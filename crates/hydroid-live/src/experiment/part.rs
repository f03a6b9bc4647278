//! Parts of an experiment: what is pushed and turned when.

use std::f64::consts::{PI, TAU};

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use super::explored::Explored;
use super::motion::wrap;
use super::response::SMALLEST_SPEED;
use super::settling::Settling;

/// Full rudder in the trials of IMO and ITTC \[deg\]: a zigzag 20/20 uses 20/35 of it.
const FULL_RUDDER_DEG: f64 = 35.0;
/// Executes of a zigzag, as in a simulated trial: it ends after the third overshoot.
const EXECUTES: u32 = 5;
/// Heading that a circle runs through to each side \[rad\].
const CIRCLE: f64 = 3.0 * PI;
/// Frequencies of a sweep, in cycles per time scale.
const SLOWEST: f64 = 1.0 / 16.0;
const FASTEST: f64 = 1.0 / 2.5;
/// Duration of a sweep in time scales: five and a half cycles.
const SWEEP: f64 = 24.0;
/// Holds of a binary sequence, in time scales.
const HOLDS: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Period of the sequence of three bits.
const PERIOD: u32 = 7;
/// Least distance of the two levels of a sequence or a sweep, as a share of the range.
const APART: f64 = 0.2;
/// Time scales after which a speed or yaw rate that does not settle is taken as settled.
const AT_MOST: f64 = 6.0;
/// Time scales of a steady approach to a zigzag.
const APPROACH: f64 = 3.0;

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
            Self::Circle(circle) => circle.before = None,
            Self::Acceleration(acceleration) => acceleration.resume(),
            Self::Sweeps(_) | Self::Sequences(_) | Self::Steps(_) => {}
        }
    }

    /// What the part does, for people.
    pub(super) fn text(&self) -> String {
        match self {
            Self::Zigzag(zigzag) => zigzag.text(),
            Self::Circle(circle) => format!(
                "turning circle to {}: {:.0} of {:.0} degrees",
                side(circle.turn),
                circle.done.to_degrees(),
                CIRCLE.to_degrees()
            ),
            Self::Sweeps(sweeps) => sweeps.text(),
            Self::Sequences(_) => "pseudo-random binary sequences of push and turn".into(),
            Self::Acceleration(acceleration) => acceleration.text(),
            Self::Steps(_) => "steps to the least explored levels of push and turn".into(),
        }
    }
}

fn side(turn: f64) -> &'static str {
    if turn >= 0.0 { "starboard" } else { "port" }
}

/// A zigzag trial.
#[derive(Clone, Debug)]
pub(super) struct Zigzag {
    degrees: f64,
    /// Share of the largest push.
    push: f64,
    side: f64,
    executes: u32,
    base: Option<f64>,
    /// Time of the approach, or since the last execute \[s\].
    elapsed_s: f64,
    running: bool,
    /// Time scales of the approach.
    approach: f64,
}

impl Zigzag {
    /// A trial with a share of the largest push, first to starboard (1) or port (-1).
    pub(super) fn new(degrees: f64, push: f64, side: f64) -> Self {
        Self {
            degrees,
            push,
            side,
            executes: 0,
            base: None,
            elapsed_s: 0.0,
            running: false,
            approach: APPROACH,
        }
    }

    fn demand(&mut self, now: &Situation) -> Option<[f64; 2]> {
        let push = self.push * now.push[1];
        let base = *self.base.get_or_insert(now.psi);
        self.elapsed_s += now.dt;
        if !self.running {
            if self.elapsed_s <= self.approach * now.push_s.max(now.turn_s) {
                return Some([push, now.hold(base)]);
            }
            self.start();
        }
        let level = (self.degrees / FULL_RUDDER_DEG * now.full_turn).min(now.turn);
        let angle = self.degrees.to_radians();
        let turned = wrap(now.psi - base) * self.side;
        // A boat that does not reach the angle must not turn in a circle.
        let longest_s = 4.0 * (2.0 * now.turn_s + 3.0 * angle / (level * now.yaw_gain).max(1e-6));
        if turned >= angle || self.elapsed_s > longest_s {
            if self.executes >= EXECUTES {
                return None;
            }
            self.side = -self.side;
            self.executes += 1;
            self.elapsed_s = 0.0;
        }
        Some([push, self.side * level])
    }

    /// The first execute.
    fn start(&mut self) {
        self.running = true;
        self.elapsed_s = 0.0;
        self.executes += 1;
    }

    fn resume(&mut self) {
        self.base = None;
        self.elapsed_s = 0.0;
        // The interrupted execute is repeated.
        if self.running {
            self.executes = self.executes.saturating_sub(1);
        }
        self.running = false;
        self.approach = 1.0;
    }

    fn text(&self) -> String {
        let degrees = self.degrees;
        if self.running {
            format!(
                "zigzag {degrees}/{degrees} at {:.0} % of the largest push: execute {} of {EXECUTES}, to {}",
                100.0 * self.push,
                self.executes,
                side(self.side)
            )
        } else {
            format!("steady approach to a zigzag {degrees}/{degrees}")
        }
    }
}

/// A turning circle.
#[derive(Clone, Debug)]
pub(super) struct Circle {
    /// Shares of the largest push and turn; the sign of the turn is the side.
    push: f64,
    turn: f64,
    done: f64,
    before: Option<f64>,
    elapsed_s: f64,
}

impl Circle {
    pub(super) fn new(push: f64, turn: f64) -> Self {
        Self { push, turn, done: 0.0, before: None, elapsed_s: 0.0 }
    }

    fn demand(&mut self, now: &Situation) -> Option<[f64; 2]> {
        let turned = self.before.map_or(0.0, |before| wrap(now.psi - before)) * self.turn.signum();
        self.before = Some(now.psi);
        self.done += turned;
        self.elapsed_s += now.dt;
        let [full, half] = now.turn_beside;
        let most = if self.push > 0.75 { full } else { half };
        let rate = now.yaw_gain * most * self.turn.abs();
        let longest_s = 4.0 * (AT_MOST * now.turn_s.max(now.push_s) + CIRCLE / rate.max(1e-6));
        let finished = self.done >= CIRCLE || self.elapsed_s > longest_s;
        (!finished).then(|| [self.push * now.push[1], self.turn * most])
    }
}

/// Frequency sweeps, in turn of steering, pushing and both.
#[derive(Clone, Debug)]
pub(super) struct Sweeps {
    round: usize,
    elapsed_s: f64,
    push: Sweep,
    turn: Sweep,
}

/// Sweep of one command: `centre + amplitude sin(phase)`.
#[derive(Clone, Copy, Debug, Default)]
struct Sweep {
    centre: f64,
    amplitude: f64,
    /// Phase in cycles.
    phase: f64,
    falling: bool,
}

impl Sweep {
    /// Value after `elapsed_s` of a sweep; the frequency changes linearly.
    fn advance(&mut self, dt: f64, elapsed_s: f64, scale_s: f64) -> f64 {
        let done = (elapsed_s / (SWEEP * scale_s)).clamp(0.0, 1.0);
        let done = if self.falling { 1.0 - done } else { done };
        self.phase = (self.phase + dt * (SLOWEST + done * (FASTEST - SLOWEST)) / scale_s).fract();
        self.centre + self.amplitude * (TAU * self.phase).sin()
    }
}

impl Sweeps {
    pub(super) fn new() -> Self {
        Self { round: 0, elapsed_s: f64::INFINITY, push: Sweep::default(), turn: Sweep::default() }
    }

    /// Whether the round sweeps push and turn.
    fn sweeps(&self) -> [bool; 2] {
        match self.round % 3 {
            1 => [false, true],
            2 => [true, false],
            _ => [true, true],
        }
    }

    fn demand(&mut self, now: &Situation, explored: &Explored, rng: &mut ChaCha8Rng) -> [f64; 2] {
        let [pushes, turns] = self.sweeps();
        let scale = |sweeps: bool, scale_s: f64| if sweeps { scale_s } else { 0.0 };
        let duration_s = SWEEP * scale(pushes, now.push_s).max(scale(turns, now.turn_s));
        if self.elapsed_s >= duration_s {
            self.start(now, explored, rng);
        }
        self.elapsed_s += now.dt;
        let push = self.push.advance(now.dt, self.elapsed_s, now.push_s);
        let turn = self.turn.advance(now.dt, self.elapsed_s, now.turn_s);
        [push, turn]
    }

    /// Starts the next round. A sine is longest at its ends, so they are put into the least explored parts.
    fn start(&mut self, now: &Situation, explored: &Explored, rng: &mut ChaCha8Rng) {
        self.round += 1;
        self.elapsed_s = 0.0;
        let [pushes, turns] = self.sweeps();
        let falling: bool = rng.random();
        self.push = if pushes {
            let [low, high] = push_pair(now, explored, rng);
            Sweep { centre: 0.5 * (low + high), amplitude: 0.5 * (high - low).abs(), phase: 0.0, falling }
        } else {
            let centre = explored.least_explored_push(ahead(now), |_| false, rng);
            Sweep { centre, ..Sweep::default() }
        };
        self.turn = if turns {
            let least = APART * now.turn;
            let amplitude = explored.least_explored_turn(now.turn, |turn| turn.abs() < least, rng);
            // With both, one rises while the other falls: equal frequencies would not be told apart.
            Sweep { centre: 0.0, amplitude, phase: 0.0, falling: falling != pushes }
        } else {
            Sweep::default()
        };
    }

    fn text(&self) -> String {
        let what = match self.sweeps() {
            [true, true] => "push and turn",
            [true, false] => "push",
            _ => "turn",
        };
        format!("frequency sweep of {what}")
    }
}

/// The permitted pushes ahead, without the slowest: without speed, steering has no effect to observe.
fn ahead(now: &Situation) -> [f64; 2] {
    [APART * now.push[1], now.push[1]]
}

/// Two pushes in least explored parts of the range, apart from each other.
fn push_pair(now: &Situation, explored: &Explored, rng: &mut ChaCha8Rng) -> [f64; 2] {
    let [low, high] = now.push;
    let apart = APART * (high - low);
    let one = explored.least_explored_push(now.push, |_| false, rng);
    let other = explored.least_explored_push(now.push, |push| (push - one).abs() < apart, rng);
    [one.min(other), one.max(other)]
}

/// Two turns in least explored parts, one to each side, so that the heading changes to and fro.
fn turn_pair(now: &Situation, explored: &Explored, rng: &mut ChaCha8Rng) -> [f64; 2] {
    let port = explored.least_explored_turn(now.turn, |turn| turn >= 0.0, rng);
    let starboard = explored.least_explored_turn(now.turn, |turn| turn <= 0.0, rng);
    [port.min(0.0), starboard.max(0.0)]
}

/// Pseudo-random binary sequence of one command: periods of a maximum-length sequence of seven bits, which contains each
/// pattern of three bits except one; each period has other levels and another hold.
#[derive(Clone, Debug)]
pub(super) struct Sequence {
    levels: [f64; 2],
    hold: usize,
    register: u8,
    inverted: bool,
    left: u32,
    hold_s: f64,
    elapsed_s: f64,
}

impl Sequence {
    /// A sequence that starts with a hold.
    pub(super) fn new(hold: usize) -> Self {
        Self { levels: [0.0; 2], hold, register: 1, inverted: false, left: 0, hold_s: 0.0, elapsed_s: 0.0 }
    }

    fn demand(
        &mut self,
        dt: f64,
        scale_s: f64,
        rng: &mut ChaCha8Rng,
        levels: impl Fn(&mut ChaCha8Rng) -> [f64; 2],
    ) -> f64 {
        if self.elapsed_s >= self.hold_s - 0.5 * dt {
            self.elapsed_s = 0.0;
            if self.left == 0 {
                self.left = PERIOD;
                self.levels = levels(rng);
                self.register = rng.random_range(1..8);
                self.inverted = rng.random();
                self.hold = (self.hold + 1) % HOLDS.len();
                let multiple = HOLDS.get(self.hold).copied().unwrap_or(1.0);
                self.hold_s = (multiple * scale_s).max(2.0 * dt);
            }
            self.left -= 1;
            // x^3 + x^2 + 1
            let bit = ((self.register >> 2) ^ (self.register >> 1)) & 1;
            self.register = ((self.register << 1) | bit) & 7;
        }
        self.elapsed_s += dt;
        let [low, high] = self.levels;
        if (self.register & 1 == 1) == self.inverted { low } else { high }
    }
}

/// Random steps of one command.
#[derive(Clone, Debug, Default)]
pub(super) struct Hold {
    level: f64,
    left_s: f64,
}

impl Hold {
    fn demand(
        &mut self,
        dt: f64,
        scale_s: f64,
        rng: &mut ChaCha8Rng,
        level: impl Fn(&mut ChaCha8Rng) -> f64,
    ) -> f64 {
        if self.left_s <= 0.5 * dt {
            self.level = level(rng);
            // Holds of different lengths excite slow and fast dynamics: half to four time scales.
            self.left_s = (0.5 * scale_s * 8.0_f64.powf(rng.random_range(0.0..1.0))).max(2.0 * dt);
        }
        self.left_s -= dt;
        self.level
    }
}

/// Steps of pushing on a straight course.
#[derive(Clone, Debug)]
pub(super) struct Acceleration {
    /// Shares of the largest push; negative: of the largest push astern.
    steps: Vec<f64>,
    next: usize,
    elapsed_s: f64,
    interrupted: u32,
    course: Option<f64>,
    settling: Option<Settling>,
}

/// Interruptions after which a step is given up.
const INTERRUPTIONS: u32 = 3;

impl Acceleration {
    /// From rest in four steps to full, stop, from rest to full at once, stop; astern in two steps and, from full ahead, a
    /// crash stop, if the boat can go astern.
    pub(super) fn new(astern: bool) -> Self {
        let mut steps = vec![0.0, 0.25, 0.5, 0.75, 1.0, 0.0, 1.0, 0.0];
        if astern {
            steps.extend([-0.5, -1.0, 0.0, 1.0, -1.0, 0.0]);
        }
        Self { steps, next: 0, elapsed_s: 0.0, interrupted: 0, course: None, settling: None }
    }

    fn demand(&mut self, now: &Situation) -> Option<[f64; 2]> {
        let share = *self.steps.get(self.next)?;
        let course = *self.course.get_or_insert(now.psi);
        let settling =
            self.settling.get_or_insert_with(|| Settling::new(now.speed, SMALLEST_SPEED, now.push_s));
        let settled = settling.add(now.dt, now.speed).is_some();
        self.elapsed_s += now.dt;
        if settled || self.elapsed_s >= AT_MOST * now.push_s {
            self.advance();
        }
        let push = if share >= 0.0 { share * now.push[1] } else { share * now.push[0].abs() };
        Some([push, now.hold(course)])
    }

    fn advance(&mut self) {
        self.next += 1;
        self.elapsed_s = 0.0;
        self.interrupted = 0;
        self.settling = None;
    }

    /// The interrupted step begins again.
    fn resume(&mut self) {
        self.interrupted += 1;
        if self.interrupted >= INTERRUPTIONS {
            self.advance();
        }
        self.elapsed_s = 0.0;
        self.course = None;
        self.settling = None;
    }

    fn text(&self) -> String {
        let share = self.steps.get(self.next).copied().unwrap_or(0.0);
        let what = if share == 0.0 {
            "stop".to_owned()
        } else {
            format!(
                "{:.0} % of the largest push {}",
                100.0 * share.abs(),
                if share > 0.0 { "ahead" } else { "astern" }
            )
        };
        format!(
            "acceleration, step {} of {}: {what}",
            (self.next + 1).min(self.steps.len()),
            self.steps.len()
        )
    }
}
