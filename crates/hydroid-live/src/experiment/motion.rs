//! Motion of the boat from what is reported, and the aborts that follow from it.

use std::f64::consts::{PI, TAU};

use super::settings::{Settings, UNKNOWN_S};

/// What is known of the boat at one time, SI units; NaN where unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Time \[s\].
    pub t: f64,
    /// Position \[m north\].
    pub north: f64,
    /// Position \[m east\].
    pub east: f64,
    /// Heading, clockwise from north \[rad\].
    pub psi: f64,
    /// Velocity ahead, over ground \[m/s\].
    pub u: f64,
    /// Velocity to starboard, over ground \[m/s\].
    pub v: f64,
    /// Yaw rate, clockwise \[rad/s\].
    pub r: f64,
}

/// Time for which a limit may be exceeded \[s\].
const EXCESS_S: f64 = 1.0;
/// Time constants of the derivatives \[s\]: of the position, where no velocity is reported, and of speed and yaw rate.
const POSITION_S: f64 = 1.0;
const RATE_S: f64 = 0.4;

/// Motion of the boat.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Motion {
    pub(super) dt: f64,
    pub(super) north: f64,
    pub(super) east: f64,
    pub(super) psi: f64,
    /// Velocity over ground in the body frame \[m/s\].
    pub(super) u: f64,
    pub(super) v: f64,
    pub(super) r: f64,
    /// Rate of the speed over ground \[m/s²\].
    pub(super) speed_rate: f64,
    /// Rate of the yaw rate \[rad/s²\].
    pub(super) yaw_acceleration: f64,
    /// Time for which position or heading has been unknown \[s\].
    pub(super) unknown_s: f64,
}

impl Motion {
    /// Speed over ground \[m/s\].
    pub(super) fn speed(&self) -> f64 {
        self.u.hypot(self.v)
    }

    /// Velocity over ground, north and east \[m/s\].
    pub(super) fn velocity(&self) -> [f64; 2] {
        let (sin, cos) = self.psi.sin_cos();
        [self.u * cos - self.v * sin, self.u * sin + self.v * cos]
    }
}

/// Angle in \[-pi, pi\].
pub(super) fn wrap(angle: f64) -> f64 {
    let turned = angle - TAU * (angle / TAU).round();
    turned.clamp(-PI, PI)
}

/// State of the observation.
#[derive(Clone, Debug)]
pub(super) struct Observer {
    max_speed: f64,
    max_yaw_rate: f64,
    /// A position farther than this from the expected one is considered unknown \[m\].
    jump: f64,
    dt_s: f64,
    last_t: Option<f64>,
    motion: Option<Motion>,
    waited_s: f64,
    too_fast_s: f64,
    too_quick_s: f64,
}

/// Result of a sample.
pub(super) enum Observed {
    /// A new sample; position and heading may be predicted for up to [`UNKNOWN_S`].
    Motion(Motion),
    /// Nothing new, or nothing known yet.
    Waiting,
    /// The experiment must be aborted.
    Abort(String),
}

impl Observer {
    pub(super) fn new(settings: &Settings) -> Self {
        Self {
            max_speed: settings.max_speed_m_s,
            max_yaw_rate: settings.max_yaw_rate_rad_s,
            jump: 0.1 * settings.fence.size(),
            dt_s: settings.dt_s,
            last_t: None,
            motion: None,
            waited_s: 0.0,
            too_fast_s: 0.0,
            too_quick_s: 0.0,
        }
    }

    pub(super) fn add(&mut self, seen: &Seen) -> Observed {
        if !seen.t.is_finite() {
            return Observed::Abort(format!(
                "the time of a sample is {}: check the clock of the source",
                seen.t
            ));
        }
        let dt = match self.last_t {
            None => self.dt_s,
            Some(last) if seen.t < last => {
                return Observed::Abort(format!(
                    "the time went back from {last:.3} s to {:.3} s: check the clock of the source",
                    seen.t
                ));
            }
            Some(last) if seen.t == last => return Observed::Waiting,
            Some(last) => seen.t - last,
        };
        self.last_t = Some(seen.t);
        if dt > UNKNOWN_S {
            return Observed::Abort(format!("no sample arrived for {dt:.1} s: check the link to the boat"));
        }
        let known = seen.north.is_finite() && seen.east.is_finite() && seen.psi.is_finite();
        let Some(before) = self.motion else {
            if known {
                let finite = |value: f64| if value.is_finite() { value } else { 0.0 };
                let motion = Motion {
                    dt,
                    north: seen.north,
                    east: seen.east,
                    psi: wrap(seen.psi),
                    u: finite(seen.u),
                    v: finite(seen.v),
                    r: finite(seen.r),
                    ..Motion::default()
                };
                self.motion = Some(motion);
                return Observed::Motion(motion);
            }
            self.waited_s += dt;
            if self.waited_s > UNKNOWN_S {
                return Observed::Abort(unknown(self.waited_s, false));
            }
            return Observed::Waiting;
        };
        let motion = self.advance(&before, seen, dt, known);
        self.motion = Some(motion);
        if motion.unknown_s > UNKNOWN_S {
            return Observed::Abort(unknown(motion.unknown_s, known));
        }
        self.too_fast_s = if motion.speed() > self.max_speed { self.too_fast_s + dt } else { 0.0 };
        self.too_quick_s = if motion.r.abs() > self.max_yaw_rate { self.too_quick_s + dt } else { 0.0 };
        if self.too_fast_s > EXCESS_S {
            return Observed::Abort(format!(
                "the boat moved at {:.2} m/s, above the limit of {:.2} m/s, for longer than {EXCESS_S} s: narrow \
                 the limits of the inputs that push, or raise the limit",
                motion.speed(),
                self.max_speed
            ));
        }
        if self.too_quick_s > EXCESS_S {
            return Observed::Abort(format!(
                "the boat turned at {:.2} rad/s, above the limit of {:.2} rad/s, for longer than {EXCESS_S} s: narrow \
                 the limits of the inputs that turn, or raise the limit",
                motion.r.abs(),
                self.max_yaw_rate
            ));
        }
        Observed::Motion(motion)
    }

    /// The motion of the next sample; unknown quantities are predicted from the motion before.
    fn advance(&self, before: &Motion, seen: &Seen, dt: f64, known: bool) -> Motion {
        let [vn, ve] = before.velocity();
        let expected = [before.north + vn * dt, before.east + ve * dt];
        let mut motion = *before;
        motion.dt = dt;
        let off = (seen.north - expected[0]).hypot(seen.east - expected[1]);
        let is_jump = known && off > self.jump + 3.0 * self.max_speed * (before.unknown_s + dt);
        if known && !is_jump {
            (motion.north, motion.east, motion.psi) = (seen.north, seen.east, wrap(seen.psi));
            motion.unknown_s = 0.0;
        } else {
            [motion.north, motion.east] = expected;
            motion.psi = if seen.psi.is_finite() { wrap(seen.psi) } else { wrap(before.psi + before.r * dt) };
            motion.unknown_s += dt;
        }
        if seen.u.is_finite() && seen.v.is_finite() {
            (motion.u, motion.v) = (seen.u, seen.v);
        } else if motion.unknown_s == 0.0 && before.unknown_s == 0.0 {
            let share = dt / (dt + POSITION_S);
            let n = vn + share * ((motion.north - before.north) / dt - vn);
            let e = ve + share * ((motion.east - before.east) / dt - ve);
            let (sin, cos) = motion.psi.sin_cos();
            (motion.u, motion.v) = (n * cos + e * sin, e * cos - n * sin);
        }
        let share = dt / (dt + RATE_S);
        if seen.r.is_finite() {
            motion.r = seen.r;
        } else if motion.unknown_s == 0.0 && before.unknown_s == 0.0 {
            motion.r += share * (wrap(motion.psi - before.psi) / dt - motion.r);
        }
        motion.speed_rate += share * ((motion.speed() - before.speed()) / dt - motion.speed_rate);
        motion.yaw_acceleration += share * ((motion.r - before.r) / dt - motion.yaw_acceleration);
        motion
    }
}

fn unknown(seconds: f64, is_jump: bool) -> String {
    if is_jump {
        format!("the position has jumped and not come back for {seconds:.1} s: check the position source")
    } else {
        format!("position or heading have been unknown for {seconds:.1} s: check GNSS and compass")
    }
}
