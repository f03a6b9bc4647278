//! Signals: frequency sweeps, pseudo-random binary sequences, random steps.

use std::f64::consts::TAU;

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use super::super::explored::Explored;
use super::Situation;

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

/// Frequency sweeps of steering, of pushing, and of both, one after the other.
#[derive(Clone, Debug)]
pub(crate) struct Sweeps {
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
    pub(crate) fn new() -> Self {
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

    pub(super) fn demand(&mut self, now: &Situation, explored: &Explored, rng: &mut ChaCha8Rng) -> [f64; 2] {
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

    pub(super) fn text(&self) -> String {
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
pub(super) fn push_pair(now: &Situation, explored: &Explored, rng: &mut ChaCha8Rng) -> [f64; 2] {
    let [low, high] = now.push;
    let apart = APART * (high - low);
    let one = explored.least_explored_push(now.push, |_| false, rng);
    let other = explored.least_explored_push(now.push, |push| (push - one).abs() < apart, rng);
    [one.min(other), one.max(other)]
}

/// Two turns in least explored parts, one to each side, so that the heading changes to and fro.
pub(super) fn turn_pair(now: &Situation, explored: &Explored, rng: &mut ChaCha8Rng) -> [f64; 2] {
    let port = explored.least_explored_turn(now.turn, |turn| turn >= 0.0, rng);
    let starboard = explored.least_explored_turn(now.turn, |turn| turn <= 0.0, rng);
    [port.min(0.0), starboard.max(0.0)]
}

/// Pseudo-random binary sequence of one command: periods of a maximum-length sequence of seven bits, which contains each
/// pattern of three bits except one; each period has other levels and another hold.
#[derive(Clone, Debug)]
pub(crate) struct Sequence {
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
    pub(crate) fn new(hold: usize) -> Self {
        Self { levels: [0.0; 2], hold, register: 1, inverted: false, left: 0, hold_s: 0.0, elapsed_s: 0.0 }
    }

    pub(super) fn demand(
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
pub(crate) struct Hold {
    level: f64,
    left_s: f64,
}

impl Hold {
    pub(in crate::experiment) fn demand(
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
