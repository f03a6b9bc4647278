//! Trials: zigzag, turning circle, acceleration.

use std::f64::consts::PI;

use super::super::motion::wrap;
use super::super::response::SMALLEST_SPEED;
use super::super::settling::Settling;
use super::Situation;

/// Full rudder in the trials of IMO and ITTC \[deg\]: a zigzag 20/20 uses 20/35 of it.
const FULL_RUDDER_DEG: f64 = 35.0;
/// Executes of a zigzag, as in a simulated trial: it ends after the third overshoot.
const EXECUTES: u32 = 5;
/// Heading that a circle runs through to each side \[rad\].
const CIRCLE: f64 = 3.0 * PI;
/// Time scales after which a speed or yaw rate that does not settle is taken as settled.
const AT_MOST: f64 = 6.0;
/// Time scales of a steady approach to a zigzag.
const APPROACH: f64 = 3.0;

fn side(turn: f64) -> &'static str {
    if turn >= 0.0 { "starboard" } else { "port" }
}

/// A zigzag trial.
#[derive(Clone, Debug)]
pub(crate) struct Zigzag {
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
    pub(crate) fn new(degrees: f64, push: f64, side: f64) -> Self {
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

    pub(super) fn demand(&mut self, now: &Situation) -> Option<[f64; 2]> {
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

    pub(super) fn resume(&mut self) {
        self.base = None;
        self.elapsed_s = 0.0;
        // The interrupted execute is repeated.
        if self.running {
            self.executes = self.executes.saturating_sub(1);
        }
        self.running = false;
        self.approach = 1.0;
    }

    pub(super) fn text(&self) -> String {
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
pub(crate) struct Circle {
    /// Shares of the largest push and turn; the sign of the turn is the side.
    push: f64,
    turn: f64,
    done: f64,
    before: Option<f64>,
    elapsed_s: f64,
}

impl Circle {
    pub(crate) fn new(push: f64, turn: f64) -> Self {
        Self { push, turn, done: 0.0, before: None, elapsed_s: 0.0 }
    }

    pub(super) fn demand(&mut self, now: &Situation) -> Option<[f64; 2]> {
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

    pub(super) fn resume(&mut self) {
        self.before = None;
    }

    pub(super) fn text(&self) -> String {
        format!(
            "turning circle to {}: {:.0} of {:.0} degrees",
            side(self.turn),
            self.done.to_degrees(),
            CIRCLE.to_degrees()
        )
    }
}

/// Steps of pushing on a straight course.
#[derive(Clone, Debug)]
pub(crate) struct Acceleration {
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
    pub(crate) fn new(astern: bool) -> Self {
        let mut steps = vec![0.0, 0.25, 0.5, 0.75, 1.0, 0.0, 1.0, 0.0];
        if astern {
            steps.extend([-0.5, -1.0, 0.0, 1.0, -1.0, 0.0]);
        }
        Self { steps, next: 0, elapsed_s: 0.0, interrupted: 0, course: None, settling: None }
    }

    pub(super) fn demand(&mut self, now: &Situation) -> Option<[f64; 2]> {
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
    pub(super) fn resume(&mut self) {
        self.interrupted += 1;
        if self.interrupted >= INTERRUPTIONS {
            self.advance();
        }
        self.elapsed_s = 0.0;
        self.course = None;
        self.settling = None;
    }

    pub(super) fn text(&self) -> String {
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
