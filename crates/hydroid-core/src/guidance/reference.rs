//! The point that a controller follows.

use num_traits::Float;

use super::path::{Path, Projection};
use super::piece::Pose;
use super::speed::SpeedProfile;

/// A point on a path with its motion, in the north-east frame.
///
/// ```text
/// velocity     = U t               t = [cos(course), sin(course)]
/// acceleration = dU/dt t + U^2 kappa n,    n = [-sin(course), cos(course)] to starboard
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Arc length \[m\]; on a closed path it counts on from lap to lap.
    pub s: f64,
    /// `[x, y]` \[m\].
    pub position: [f64; 2],
    /// `[dx/dt, dy/dt]` \[m/s\].
    pub velocity: [f64; 2],
    /// `[d2x/dt2, d2y/dt2]` \[m/s^2\].
    pub acceleration: [f64; 2],
    /// Direction of the path, clockwise from north \[rad\].
    pub course: f64,
    /// Curvature of the path, positive to starboard \[1/m\].
    pub curvature: f64,
    /// Speed along the path `U` \[m/s\].
    pub speed: f64,
}

impl Reference {
    /// At a place that is passed with a speed \[m/s\] and its rate \[m/s^2\].
    pub fn new(s: f64, pose: &Pose, speed: f64, rate: f64) -> Self {
        let (sin, cos) = Float::sin_cos(pose.course);
        let towards = speed * speed * pose.curvature;
        Self {
            s,
            position: pose.position,
            velocity: [speed * cos, speed * sin],
            acceleration: [rate * cos - towards * sin, rate * sin + towards * cos],
            course: pose.course,
            curvature: pose.curvature,
            speed,
        }
    }

    /// Whether position, velocity and acceleration are numbers.
    pub fn is_finite(&self) -> bool {
        let numbers = self.position.iter().chain(&self.velocity).chain(&self.acceleration);
        numbers.chain([&self.course]).all(|x| x.is_finite())
    }

    /// Where it is, without how fast.
    pub const fn pose(&self) -> Pose {
        Pose { position: self.position, course: self.course, curvature: self.curvature }
    }
}

/// A point that moves along a path with time, whatever the vessel does: what is to be *tracked*.
///
/// It moves exactly as the profile says, in closed form: its place does not depend on the steps in which time passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedReference {
    /// Arc length at which the present lap began \[m\].
    lap: f64,
    phase: usize,
    /// Metres into the phase.
    into: f64,
    speed: f64,
}

impl TimedReference {
    /// At the start of a path.
    pub fn new(profile: &SpeedProfile) -> Self {
        Self {
            lap: 0.0,
            phase: 0,
            into: 0.0,
            speed: profile.phases().first().map_or(0.0, |phase| phase.speed),
        }
    }

    /// Moves on for `dt` seconds.
    pub fn advance(&mut self, profile: &SpeedProfile, dt: f64) {
        if !dt.is_finite() {
            return;
        }
        let mut left = dt;
        loop {
            let Some(phase) = profile.phases().get(self.phase) else {
                self.into += self.speed * left;
                return;
            };
            let until = if phase.acceleration == 0.0 {
                (phase.length - self.into) / self.speed
            } else {
                (phase.end - self.speed) / phase.acceleration
            };
            // A NaN, of no way at no speed, goes on to the next phase.
            if until > left {
                self.into += (self.speed + 0.5 * phase.acceleration * left) * left;
                self.speed += phase.acceleration * left;
                return;
            }
            left -= until.max(0.0);
            self.phase += 1;
            self.into = 0.0;
            if profile.is_closed() && self.phase == profile.phases().len() {
                self.phase = 0;
                self.lap += profile.length();
            }
            self.speed = profile.phases().get(self.phase).map_or(phase.end, |next| next.speed);
        }
    }

    /// Whether the end of an open path has been passed; from there the point goes straight on at the speed of the end.
    pub fn is_done(&self, profile: &SpeedProfile) -> bool {
        self.phase >= profile.phases().len()
    }

    /// Arc length \[m\].
    pub fn s(&self, profile: &SpeedProfile) -> f64 {
        self.lap + profile.phases().get(self.phase).map_or(profile.length(), |phase| phase.s) + self.into
    }

    /// The point of the moment.
    pub fn reference(&self, path: &Path, profile: &SpeedProfile) -> Reference {
        let s = self.s(profile);
        let rate = profile.phases().get(self.phase).map_or(0.0, |phase| phase.acceleration);
        Reference::new(s, &path.at(s), self.speed, rate)
    }
}

/// The point of a path that is nearest to a vessel: what is to be *followed*, at the profile's speed but by no clock.
///
/// A profile that starts at rest asks for no speed at its start, and a follower would stay there: give
/// [`SpeedLimits::start`](super::SpeedLimits::start) a speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathReference {
    s: f64,
    reach: f64,
}

impl PathReference {
    /// From arc length `s` on; the vessel is looked for up to `reach` metres along the path from where it was last: more
    /// than it moves between two samples, less than what lies between two passes at the same place.
    pub const fn new(s: f64, reach: f64) -> Self {
        Self { s, reach }
    }

    /// The foot of a position \[m\], which the next one is looked for around. A position that is no number changes
    /// nothing.
    pub fn project(&mut self, path: &Path, position: [f64; 2]) -> Projection {
        if position.iter().all(|x| x.is_finite()) {
            let foot = path.project(position, self.s, self.reach);
            self.s = foot.s;
            return foot;
        }
        Projection { s: self.s, pose: path.at(self.s), cross_track: f64::NAN }
    }

    /// The foot of a position with the motion that the profile has there.
    pub fn reference(&mut self, path: &Path, profile: &SpeedProfile, position: [f64; 2]) -> Reference {
        let foot = self.project(path, position);
        let (speed, rate) = profile.at(foot.s);
        Reference::new(foot.s, &foot.pose, speed, rate)
    }
}
