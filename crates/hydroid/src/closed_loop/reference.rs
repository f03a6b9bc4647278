//! Generation of the reference and of its preview.

use hydroid_core::guidance::{PathReference, Reference, TimedReference};
use hydroid_core::memory::Memory;
use serde::{Deserialize, Serialize};

use super::track::Track;

/// Parameter that moves the reference along its path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "arguments", derive(clap::ValueEnum))]
pub enum Timing {
    /// Trajectory tracking: a position for each time
    #[serde(rename(deserialize = "time"))]
    #[cfg_attr(feature = "arguments", value(name = "time"))]
    Clock,
    /// Path following: the nearest point of the path, with the speed required there
    Path,
}

/// Least search range for the projection \[m\]: less than the distance of two legs of a boat.
const LEAST_RANGE_M: f64 = 6.0;

/// Search range relative to the distance that the reference covers in a sample.
const RANGE: f64 = 4.0;

pub(super) struct ReferenceGenerator {
    track: Track,
    timing: Timing,
    walker: TimedReference,
    follower: PathReference,
    /// Search range of the projection \[m\].
    range: f64,
    /// Arc length of the vessel's projection on the path \[m\].
    s: f64,
}

impl ReferenceGenerator {
    pub(super) fn new(track: Track, timing: Timing, dt_s: f64) -> Self {
        let range = (RANGE * dt_s * track.cruise).max(LEAST_RANGE_M);
        let (walker, follower) = (TimedReference::new(&track.profile), PathReference::new(0.0, range));
        Self { track, timing, walker, follower, range, s: 0.0 }
    }

    /// Reference for a controlled point at `point`, and the cross-track error \[m\], positive to starboard.
    pub(super) fn update(&mut self, point: [f64; 2]) -> (Reference, f64) {
        let Track { path, profile, .. } = &self.track;
        if self.track.is_station {
            let reference = Reference::new(0.0, &path.at(0.0), 0.0, 0.0);
            let [north, east] = [point[0] - reference.position[0], point[1] - reference.position[1]];
            let (sin, cos) = reference.course.sin_cos();
            return (reference, east * cos - north * sin);
        }
        let foot = self.follower.project(path, point);
        self.s = foot.s;
        let reference = match self.timing {
            Timing::Clock => self.walker.reference(path, profile),
            Timing::Path => {
                let (speed, rate) = profile.at(foot.s);
                Reference::new(foot.s, &foot.pose, speed, rate)
            }
        };
        (reference, foot.cross_track)
    }

    /// References `step`, `2 step`, .. samples after the last update.
    pub(super) fn preview(&self, dt_s: f64, step: usize, into: &mut [Reference]) {
        let Track { path, profile, .. } = &self.track;
        if self.track.is_station {
            into.fill(Reference::new(0.0, &path.at(0.0), 0.0, 0.0));
            return;
        }
        match self.timing {
            Timing::Clock => {
                let mut walker = self.walker;
                for reference in into {
                    (0..step).for_each(|_| walker.advance(profile, dt_s));
                    *reference = walker.reference(path, profile);
                }
            }
            Timing::Path => {
                let mut s = self.s;
                for reference in into {
                    for _ in 0..step {
                        let (speed, rate) = profile.at(s);
                        s += dt_s * (speed + 0.5 * dt_s * rate);
                    }
                    let (speed, rate) = profile.at(s);
                    *reference = Reference::new(s, &path.at(s), speed, rate);
                }
            }
        }
    }

    pub(super) fn advance(&mut self, dt_s: f64) {
        if !self.track.is_station {
            self.walker.advance(&self.track.profile, dt_s);
        }
    }

    pub(super) const fn track(&self) -> &Track {
        &self.track
    }

    pub(super) fn resume(&mut self, gap_s: f64, position: [f64; 2]) {
        if self.track.is_station {
            return;
        }
        let Track { path, profile, cruise, .. } = &self.track;
        let mut wide = PathReference::new(self.s, (RANGE * gap_s * cruise).max(LEAST_RANGE_M));
        self.s = wide.project(path, position).s;
        self.follower = PathReference::new(self.s, self.range);
        self.walker = TimedReference::at(profile, self.s);
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.walker.visit_state(&self.track.profile, memory);
        memory.number(&mut self.s);
        self.follower = PathReference::new(self.s, self.range);
    }

    pub(super) fn is_done(&self) -> bool {
        let open = !self.track.path.is_closed() && !self.track.is_station;
        open && match self.timing {
            Timing::Clock => self.walker.is_done(&self.track.profile),
            Timing::Path => self.s >= self.track.path.length(),
        }
    }
}
