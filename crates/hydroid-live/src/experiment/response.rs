//! The boat's response, learnt from what it does.

use super::settling::{Settled, Settling};

/// Parts of the speed range in which yaw rates are kept.
const SPEEDS: usize = 10;
/// Parts of the push range in which speeds are kept.
const PUSHES: usize = 10;
/// Estimates of a time constant of which the median is used.
const ESTIMATES: usize = 7;
/// Difference of two commands that are considered equal.
const SAME: f64 = 0.05;
/// Smallest step of a command from which a time constant is estimated.
const STEP: f64 = 0.2;
/// Smallest change of speed \[m/s\] and yaw rate \[rad/s\] that counts as a response.
pub(super) const SMALLEST_SPEED: f64 = 0.1;
pub(super) const SMALLEST_YAW_RATE: f64 = 0.005;
/// Smallest turn of which the yaw rate is kept.
const SMALLEST_TURN: f64 = 0.15;
/// Share of the largest turn below which yaw rates are not kept: gusts matter more there, and the rate is not proportional.
const WEAK_TURN: f64 = 0.5;
/// Share of a change of the speed or yaw rate with respect to the largest one from which a time constant is estimated.
const LARGE: f64 = 0.25;
/// Time constant of the low-pass filters, in time constants of the yaw rate.
const FILTER: f64 = 0.1;
/// Time constants after which a response is considered settled.
const COMPLETE: f64 = 2.5;

/// A yaw rate that was held.
#[derive(Clone, Copy, Debug)]
struct Turning {
    turn: f64,
    /// Yaw rate to the side of the turn \[rad/s\].
    rate: f64,
    /// Speed through the water \[m/s\].
    speed: f64,
}

/// A command that is held, and the response to it.
#[derive(Clone, Debug)]
struct Held {
    value: f64,
    step: f64,
    since_s: f64,
    settling: Option<Settling>,
}

impl Held {
    /// Follows the command; returns a settled response.
    fn add(&mut self, dt: f64, value: f64, response: f64, smallest: f64) -> Option<Settled> {
        if (value - self.value).abs() > SAME {
            let step = value - self.value;
            let settling =
                (step.abs() >= STEP).then(|| Settling::new(response, smallest, (10.0 * dt).max(0.5)));
            *self = Self { value, step, since_s: 0.0, settling };
            return None;
        }
        self.since_s += dt;
        let settled = self.settling.as_mut()?.add(dt, response)?;
        self.settling = None;
        Some(settled)
    }
}

/// Time scales, speeds and yaw rates of the boat.
///
/// Time constants are medians over the steps of the commands that were held until the response had settled. Speeds are
/// kept by push, and yaw rates by side and speed, once a command has been held for 2.5 time constants.
#[derive(Clone, Debug)]
pub(super) struct Response {
    max_speed: f64,
    push_times: Vec<f64>,
    turn_times: Vec<f64>,
    turn_bound_s: Option<f64>,
    speeds: [Option<(f64, f64)>; PUSHES],
    turnings: [[Option<Turning>; SPEEDS]; 2],
    push: Held,
    turn: Held,
    largest_speed: f64,
    largest_rate: f64,
    /// Largest turn of which the yaw rate was kept.
    largest_turn: f64,
    /// Low-passed yaw rate \[rad/s\] and speed \[m/s\].
    rate: f64,
    speed: f64,
}

/// Number of the side of a turn.
fn side(turn: f64) -> usize {
    usize::from(turn < 0.0)
}

impl Response {
    pub(super) fn new(max_speed: f64) -> Self {
        let held = Held { value: 0.0, step: 0.0, since_s: 0.0, settling: None };
        Self {
            max_speed,
            push_times: Vec::new(),
            turn_times: Vec::new(),
            turn_bound_s: None,
            speeds: [None; PUSHES],
            turnings: [[None; SPEEDS]; 2],
            push: held.clone(),
            turn: held,
            largest_speed: 0.0,
            largest_rate: 0.0,
            largest_turn: 0.0,
            rate: 0.0,
            speed: 0.0,
        }
    }

    /// Adds a sample: the commands that acted, the speed through the water \[m/s\] and the yaw rate \[rad/s\].
    pub(super) fn add(&mut self, dt: f64, push: f64, turn: f64, speed: f64, rate: f64) {
        let scale = self.turn_s().unwrap_or(1.0);
        let share = dt / (dt + (FILTER * scale).max(2.0 * dt));
        self.rate += share * (rate - self.rate);
        self.speed += share * (speed - self.speed);
        if let Some(settled) = self.push.add(dt, push, speed, SMALLEST_SPEED) {
            self.largest_speed = self.largest_speed.max(settled.change.abs());
            if settled.change * self.push.step > 0.0 && settled.change.abs() >= LARGE * self.largest_speed {
                remember(&mut self.push_times, settled.time_s);
            }
        }
        if let Some(settled) = self.turn.add(dt, turn, rate, SMALLEST_YAW_RATE) {
            self.largest_rate = self.largest_rate.max(settled.change.abs());
            if settled.change * self.turn.step > 0.0 && settled.change.abs() >= LARGE * self.largest_rate {
                remember(&mut self.turn_times, settled.time_s);
            }
        }
        if self.push_s().is_some_and(|scale| self.push.since_s > COMPLETE * scale) {
            self.keep_speed(dt, push);
        }
        if self.turn_s().is_some_and(|scale| self.turn.since_s > COMPLETE * scale) {
            self.keep_turning(dt, turn);
        }
    }

    /// Keeps the present speed and yaw rate as those of the present commands, which have settled.
    pub(super) fn keep(&mut self, dt: f64) {
        self.keep_speed(dt, self.push.value);
        self.keep_turning(dt, self.turn.value);
    }

    /// Starts with the speed and yaw rate of the resting boat.
    pub(super) fn start(&mut self, speed: f64, rate: f64) {
        self.speed = speed;
        self.rate = rate;
    }

    fn keep_speed(&mut self, dt: f64, push: f64) {
        if push > SAME {
            let place = (push * PUSHES as f64).ceil() - 1.0;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` saturates
            if let Some(kept) = self.speeds.get_mut((place as usize).min(PUSHES - 1)) {
                // The largest speed counts: a turn slows the boat.
                let (p, before) = kept.unwrap_or((push, self.speed));
                let share = if self.speed > before { 0.2 } else { 0.01 };
                let share = (share * dt).min(1.0);
                *kept = Some((p + share * (push - p), before + share * (self.speed - before)));
            }
        }
    }

    /// Keeps the present yaw rate if it belongs to the turn.
    fn keep_turning(&mut self, dt: f64, turn: f64) {
        let rate = self.rate * turn.signum();
        if turn.abs() < SMALLEST_TURN.max(WEAK_TURN * self.largest_turn) || rate <= 0.0 || self.speed <= 0.0 {
            return;
        }
        self.largest_turn = self.largest_turn.max(turn.abs());
        let place = self.speed / self.max_speed * SPEEDS as f64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` saturates
        let Some(kept) = self
            .turnings
            .get_mut(side(turn))
            .and_then(|speeds| speeds.get_mut((place as usize).min(SPEEDS - 1)))
        else {
            return;
        };
        let now = Turning { turn: turn.abs(), rate, speed: self.speed };
        // The largest turn counts; equal ones are averaged over ten seconds or time scales.
        *kept = Some(match *kept {
            Some(before) if before.turn > now.turn + SAME => return,
            Some(before) if before.turn >= now.turn - SAME => {
                let share = dt / (dt + 10.0 * self.turn_times.first().copied().unwrap_or(1.0).max(1.0));
                let mix = |a: f64, b: f64| a + share * (b - a);
                Turning {
                    turn: mix(before.turn, now.turn),
                    rate: mix(before.rate, now.rate),
                    speed: mix(before.speed, now.speed),
                }
            }
            _ => now,
        });
    }

    /// Time constant of the speed \[s\].
    pub(super) fn push_s(&self) -> Option<f64> {
        quantile(&self.push_times, 1, 2)
    }

    /// Time constant of the yaw rate \[s\].
    pub(super) fn turn_s(&self) -> Option<f64> {
        quantile(&self.turn_times, 1, 2).or(self.turn_bound_s)
    }

    /// Whether the time constant of the yaw rate has been estimated, and not only an upper bound.
    pub(super) fn is_turn_known(&self) -> bool {
        !self.turn_times.is_empty()
    }

    /// Upper quartiles of the estimates of both time constants \[s\].
    pub(super) fn upper_times(&self) -> [Option<f64>; 2] {
        [quantile(&self.push_times, 3, 4), quantile(&self.turn_times, 3, 4).or(self.turn_bound_s)]
    }

    /// Adds an estimate of the time constant of the speed \[s\].
    pub(super) fn add_push_s(&mut self, time_s: f64) {
        remember(&mut self.push_times, time_s);
    }

    /// Adds an estimate of the time constant of the yaw rate \[s\].
    pub(super) fn add_turn_s(&mut self, time_s: f64) {
        remember(&mut self.turn_times, time_s);
    }

    /// Sets an upper bound of the time constant of the yaw rate \[s\], which is used until there is an estimate.
    pub(super) fn bound_turn_s(&mut self, time_s: f64) {
        self.turn_bound_s = Some(time_s);
    }

    /// Low-passed speed through the water \[m/s\].
    pub(super) fn speed(&self) -> f64 {
        self.speed
    }

    /// Low-passed yaw rate \[rad/s\].
    pub(super) fn rate(&self) -> f64 {
        self.rate
    }

    /// Yaw rate that the boat can make to a side with a turn of at most `limit` at a speed \[rad/s\], from the rates that it
    /// has made.
    ///
    /// Between two speeds it is interpolated. Below the lowest one it is proportional to the speed, as with a rudder, and
    /// above the highest one it is constant, as with thrusters: both are the smaller of what can be expected.
    pub(super) fn yaw_rate(&self, side: f64, speed: f64, limit: f64) -> Option<f64> {
        let rate = |turning: &Turning| turning.rate * (limit / turning.turn).min(1.0);
        self.interpolate(side, speed, rate, false).or_else(|| self.interpolate(-side, speed, rate, false))
    }

    /// Yaw rate per turn at a speed \[rad/s\], not less than what can be expected.
    pub(super) fn yaw_gain(&self, speed: f64) -> Option<f64> {
        let [a, b] = [1.0, -1.0]
            .map(|turn| self.interpolate(turn, speed, |turning| turning.rate / turning.turn.max(SAME), true));
        match (a, b) {
            (Some(a), Some(b)) => Some(a.max(b)),
            _ => a.or(b),
        }
    }

    fn interpolate(&self, turn: f64, speed: f64, of: impl Fn(&Turning) -> f64, upper: bool) -> Option<f64> {
        let least = WEAK_TURN * self.largest_turn;
        let kept = self.turnings.get(side(turn))?.iter().flatten().filter(|turning| turning.turn >= least);
        let mut below: Option<(f64, f64)> = None;
        let mut above: Option<(f64, f64)> = None;
        for turning in kept {
            let point = (turning.speed, of(turning));
            if turning.speed <= speed {
                below = Some(point);
            } else if above.is_none() {
                above = Some(point);
            }
        }
        let proportional = |(at, value): (f64, f64)| value * (speed / at.max(f64::MIN_POSITIVE)).max(0.0);
        Some(match (below, above) {
            (Some((v0, r0)), Some((v1, r1))) => {
                r0 + (r1 - r0) * (speed - v0) / (v1 - v0).max(f64::MIN_POSITIVE)
            }
            (Some(last), None) => {
                if upper {
                    proportional(last)
                } else {
                    last.1
                }
            }
            (None, Some(first)) => {
                if upper {
                    first.1
                } else {
                    proportional(first)
                }
            }
            (None, None) => return None,
        })
    }

    /// Largest push that keeps the speed through the water below a limit.
    ///
    /// Beyond the pushes that were held, the speed is assumed to be proportional to the push, which is more than what most
    /// hulls make of it; the limit then rises with each push that was held.
    pub(super) fn push_below(&self, limit: f64) -> Option<f64> {
        let mut before = (0.0, 0.0);
        for &(push, speed) in self.speeds.iter().flatten() {
            if speed > limit {
                let share = (limit - before.1) / (speed - before.1).max(f64::MIN_POSITIVE);
                return Some((before.0 + share * (push - before.0)).max(0.0));
            }
            before = (push, speed.max(before.1));
        }
        (before.1 > 0.0).then(|| before.0 * (limit / before.1).max(0.0))
    }

    /// Largest speed that a push ahead was seen to make, by interpolation \[m/s\].
    pub(super) fn speed_at(&self, push: f64) -> Option<f64> {
        let mut before = (0.0, 0.0);
        for &(at, speed) in self.speeds.iter().flatten() {
            if at >= push {
                let share = (push - before.0) / (at - before.0).max(f64::MIN_POSITIVE);
                return Some(before.1 + share * (speed - before.1));
            }
            before = (at, speed);
        }
        (before.0 > 0.0).then(|| before.1 * push / before.0)
    }
}

fn remember(times: &mut Vec<f64>, time_s: f64) {
    if time_s > 0.0 {
        if times.len() >= ESTIMATES {
            times.remove(0);
        }
        times.push(time_s);
    }
}

/// The estimate that a share `part / whole` of the estimates does not exceed.
fn quantile(times: &[f64], part: usize, whole: usize) -> Option<f64> {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() * part / whole).copied()
}
