//! Reference points on a path: by time, and by projection of the vessel.

use num_traits::Float;

use super::path::{Path, Projection};
use super::piece::Pose;
use super::speed::SpeedProfile;
use crate::memory::Memory;

/// A point on a path with its motion, in the north-east frame.
///
/// ```text
/// velocity     = U t               t = [cos(course), sin(course)]
/// acceleration = dU/dt t + U^2 kappa n,    n = [-sin(course), cos(course)] to starboard
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Arc length \[m\]; it increases over the laps of a closed path.
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
    /// The reference at arc length `s` with a speed \[m/s\] and its rate \[m/s^2\].
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

    /// Whether position, velocity and acceleration are finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        let numbers = self.position.iter().chain(&self.velocity).chain(&self.acceleration);
        numbers.chain([&self.course]).all(|x| x.is_finite())
    }

    /// Pose of the path at the reference.
    pub const fn pose(&self) -> Pose {
        Pose { position: self.position, course: self.course, curvature: self.curvature }
    }
}

/// A reference that moves along a path by time (trajectory tracking), in closed form: independent of the time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedReference {
    /// Arc length at the start of the present lap \[m\].
    lap: f64,
    phase: usize,
    into: f64,
    speed: f64,
}

impl TimedReference {
    /// A reference at the start of a path.
    pub fn new(profile: &SpeedProfile) -> Self {
        Self {
            lap: 0.0,
            phase: 0,
            into: 0.0,
            speed: profile.phases().first().map_or(0.0, |phase| phase.speed),
        }
    }

    /// A reference at arc length `s` \[m\], with the speed of the profile there; beyond the end of an open path it moves
    /// straight on.
    pub fn at(profile: &SpeedProfile, s: f64) -> Self {
        let length = profile.length();
        let laps = if profile.is_closed() && length > 0.0 { Float::floor(s / length) } else { 0.0 };
        let lap = laps * length;
        let along = (s - lap).max(0.0);
        let phases = profile.phases();
        let mut next = 0;
        while phases.get(next + 1).is_some_and(|phase| phase.s <= along) {
            next += 1;
        }
        let Some(phase) = phases.get(next).filter(|_| profile.is_closed() || along < length) else {
            let speed = phases.last().map_or(0.0, |phase| phase.end);
            return Self { lap, phase: phases.len(), into: (along - length).max(0.0), speed };
        };
        let into = along - phase.s;
        Self { lap, phase: next, into, speed: phase.speed_at(into) }
    }

    /// Visits the numbers of the state.
    pub fn visit_state(&mut self, profile: &SpeedProfile, memory: &mut Memory<'_>) {
        memory.count(&mut self.phase, profile.phases().len());
        for number in [&mut self.lap, &mut self.into, &mut self.speed] {
            memory.number(number);
        }
    }

    /// Advances the reference by `dt` seconds.
    pub fn advance(&mut self, profile: &SpeedProfile, dt: f64) {
        if !dt.is_finite() {
            return;
        }
        let mut left = dt;
        let lap_time = profile.duration();
        if profile.is_closed() && (lap_time <= left || lap_time.is_nan()) {
            // Whole laps at once: their number has no bound at absurd speeds. Where a lap takes no time, the reference is
            // not finite.
            let laps = Float::floor(left / lap_time);
            self.lap += laps * profile.length();
            left = (left - laps * lap_time).max(0.0).min(lap_time);
        }
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
            // NaN (no distance at zero speed) ends the phase.
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
                if left <= 0.0 {
                    self.speed = profile.phases()[0].speed;
                    return;
                }
            }
            self.speed = profile.phases().get(self.phase).map_or(phase.end, |next| next.speed);
        }
    }

    /// Whether the end of an open path has been passed. The reference then moves straight on at the final speed.
    pub fn is_done(&self, profile: &SpeedProfile) -> bool {
        self.phase >= profile.phases().len()
    }

    /// Arc length \[m\].
    pub fn s(&self, profile: &SpeedProfile) -> f64 {
        self.lap + profile.phases().get(self.phase).map_or(profile.length(), |phase| phase.s) + self.into
    }

    /// The present reference.
    pub fn reference(&self, path: &Path, profile: &SpeedProfile) -> Reference {
        let s = self.s(profile);
        let rate = profile.phases().get(self.phase).map_or(0.0, |phase| phase.acceleration);
        Reference::new(s, &path.at(s), self.speed, rate)
    }
}

/// A reference at the projection of the vessel onto a path (path following), with the speed of the profile. A profile
/// that starts at rest would hold the vessel there: set [`SpeedLimits::start`](super::SpeedLimits::start).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathReference {
    s: f64,
    reach: f64,
}

impl PathReference {
    /// A reference from arc length `s` on. The projection is searched within `reach` metres of the last one along the
    /// path: more than the motion in a sample, less than the distance between two passes of the same point.
    pub const fn new(s: f64, reach: f64) -> Self {
        Self { s, reach }
    }

    /// Projects a position \[m\] onto the path. A position that is not finite is ignored.
    pub fn project(&mut self, path: &Path, position: [f64; 2]) -> Projection {
        if position.iter().all(|x| x.is_finite()) {
            let projection = path.project(position, self.s, self.reach);
            self.s = projection.s;
            return projection;
        }
        Projection { s: self.s, pose: path.at(self.s), cross_track: f64::NAN }
    }

    /// The projection of a position with the speed of the profile.
    pub fn reference(&mut self, path: &Path, profile: &SpeedProfile, position: [f64; 2]) -> Reference {
        let projection = self.project(path, position);
        let (speed, rate) = profile.at(projection.s);
        Reference::new(projection.s, &projection.pose, speed, rate)
    }
}
