//! Generation of the reference and of its preview.

use hydroid_core::guidance::{Path, PathReference, Piece, Pose, Reference, SpeedProfile, TimedReference};
use hydroid_core::memory::Memory;
use serde::{Deserialize, Serialize};

use super::track::Track;
use super::way::{NoWay, Start, Way};

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
    /// The way to the task, as long as the vessel follows it.
    way: Option<Way>,
    walker: TimedReference,
    follower: PathReference,
    /// Search range of the projection \[m\].
    range: f64,
    /// Arc length of the vessel's projection on the way, or on the path of the task \[m\].
    s: f64,
    /// Speed of the reference relative to that of its profile: 0 while it stands and waits for the vessel.
    pace: f64,
}

impl ReferenceGenerator {
    pub(super) fn new(track: Track, timing: Timing, dt_s: f64) -> Self {
        let range = (RANGE * dt_s * track.cruise).max(LEAST_RANGE_M);
        let (walker, follower) = (TimedReference::new(&track.profile), PathReference::new(0.0, range));
        Self { track, timing, way: None, walker, follower, range, s: 0.0, pace: 1.0 }
    }

    /// Reference for a controlled point at `point`, and the cross-track error \[m\], positive to starboard.
    pub(super) fn update(&mut self, point: [f64; 2]) -> (Reference, f64) {
        if self.track.is_station {
            let Track { path, .. } = &self.track;
            let reference = Reference::new(0.0, &path.at(0.0), 0.0, 0.0);
            let [north, east] = [point[0] - reference.position[0], point[1] - reference.position[1]];
            let (sin, cos) = reference.course.sin_cos();
            return (reference, east * cos - north * sin);
        }
        let (path, profile) = along(self.way.as_ref(), &self.track);
        let foot = self.follower.project(path, point);
        self.s = foot.s;
        let reference = match self.timing {
            Timing::Clock => paced(self.walker.reference(path, profile), self.pace),
            Timing::Path => {
                // Who drifts back from the start of an open path leaves it.
                let (s, pose) =
                    if foot.s < 0.0 && !path.is_closed() { (0.0, path.at(0.0)) } else { (foot.s, foot.pose) };
                let (speed, rate) = profile.at(s);
                Reference::new(s, &pose, speed, rate)
            }
        };
        (Reference { s: self.of_task(reference.s), ..reference }, foot.cross_track)
    }

    /// References `step`, `2 step`, .. samples after the last update.
    pub(super) fn preview(&self, dt_s: f64, step: usize, into: &mut [Reference]) {
        let (path, profile) = along(self.way.as_ref(), &self.track);
        if self.track.is_station {
            into.fill(Reference::new(0.0, &path.at(0.0), 0.0, 0.0));
            return;
        }
        match self.timing {
            Timing::Clock => {
                let mut walker = self.walker;
                for reference in into {
                    (0..step).for_each(|_| walker.advance(profile, self.pace * dt_s));
                    *reference = paced(walker.reference(path, profile), self.pace);
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
        if self.track.is_station {
            return;
        }
        let (_, profile) = along(self.way.as_ref(), &self.track);
        self.walker.advance(profile, self.pace * dt_s);
        // The first lap of a closed path belongs to the way.
        let ended = |way: &Way| self.track.path.is_closed() && self.place(&way.profile) >= way.path.length();
        if self.way.as_ref().is_some_and(ended) {
            let s = self.of_task(self.place(along(self.way.as_ref(), &self.track).1));
            self.way = None;
            self.begin_at(s);
        }
    }

    /// The reference moves with a part of the speed of its profile: the trajectory is scaled in time.
    pub(super) const fn pace(&mut self, pace: f64) {
        self.pace = pace;
    }

    /// Plans a way from a pose to the task, with turns of a radius \[m\]; the reference begins there with the speed \[m/s\] of
    /// the vessel. Returns the length of the way without the part of the task that is done \[m\], and its time \[s\]. The vessel
    /// joins the task where it left it, or up to four radii later. `None` if all ways leave the fence.
    pub(super) fn plan(&mut self, from: Pose, speed: f64, radius: f64) -> Option<[f64; 2]> {
        let Track { path, cruise, is_station, fence, .. } = &self.track;
        if *is_station {
            let [north, east] = [0, 1].map(|axis| path.at(0.0).position[axis] - from.position[axis]);
            let distance = north.hypot(east);
            let straight =
                Piece { start: from.position, course: east.atan2(north), curvature: 0.0, length: distance };
            return fence.leaves(&[straight]).is_none().then(|| [distance, 2.0 * distance / cruise]);
        }
        let s = self.of_task(self.place(along(self.way.as_ref(), &self.track).1).min(self.s));
        let from_m = match &self.way {
            Some(way) if s < way.join_m => way.start.from_m,
            _ => s,
        };
        // Path following needs a speed to begin with.
        let speed_m_s = match self.timing {
            Timing::Clock => speed.max(0.0),
            Timing::Path => f64::INFINITY,
        };
        let start = Start { from, speed_m_s, radius, from_m };
        let way = match Way::plan(&self.track, start) {
            Ok(way) => way,
            Err(NoWay::End) => {
                self.way = None;
                self.begin_at(from_m);
                return Some([-from_m, 0.0]);
            }
            Err(NoWay::Fence) => return None,
        };
        let planned = [way.approach_m - way.join_m, way.duration_s];
        self.way = Some(way);
        self.begin_at(0.0);
        Some(planned)
    }

    /// What is left of the way to the task \[m\]; 0 on the task.
    pub(super) fn approach_m(&self) -> f64 {
        self.way.as_ref().map_or(0.0, |way| (way.approach_m - self.place(&way.profile)).max(0.0))
    }

    /// The reference begins at an arc length of the way, or of the path of the task.
    fn begin_at(&mut self, s: f64) {
        let (_, profile) = along(self.way.as_ref(), &self.track);
        (self.walker, self.s) = (TimedReference::at(profile, s), s);
        self.follower = PathReference::new(s, self.range);
    }

    /// Arc length of the reference on the way, or on the path of the task.
    fn place(&self, profile: &SpeedProfile) -> f64 {
        match self.timing {
            Timing::Clock => self.walker.s(profile),
            Timing::Path => self.s,
        }
    }

    /// An arc length of the way as one of the task; negative in the approach.
    fn of_task(&self, s: f64) -> f64 {
        self.way.as_ref().map_or(s, |way| s - way.approach_m + way.join_m)
    }

    pub(super) const fn track(&self) -> &Track {
        &self.track
    }

    pub(super) fn resume(&mut self, gap_s: f64, position: [f64; 2]) {
        if self.track.is_station {
            return;
        }
        let (path, _) = along(self.way.as_ref(), &self.track);
        let mut wide = PathReference::new(self.s, (RANGE * gap_s * self.track.cruise).max(LEAST_RANGE_M));
        let s = wide.project(path, position).s;
        self.begin_at(s);
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        let mut is_under_way = self.way.is_some();
        memory.flag(&mut is_under_way);
        let mut start = self.way.as_ref().map_or(Start::NONE, |way| way.start);
        start.visit_state(memory);
        if memory.is_loading() {
            self.way = is_under_way.then(|| Way::plan(&self.track, start).ok()).flatten();
        }
        memory.number(&mut self.pace);
        self.walker.visit_state(along(self.way.as_ref(), &self.track).1, memory);
        memory.number(&mut self.s);
        self.follower = PathReference::new(self.s, self.range);
    }

    pub(super) fn is_done(&self) -> bool {
        let open = !self.track.path.is_closed() && !self.track.is_station;
        let (path, profile) = along(self.way.as_ref(), &self.track);
        open && match self.timing {
            Timing::Clock => self.walker.is_done(profile),
            Timing::Path => self.s >= path.length(),
        }
    }
}

/// A reference of a trajectory that is scaled in time.
fn paced(reference: Reference, pace: f64) -> Reference {
    Reference {
        speed: pace * reference.speed,
        velocity: reference.velocity.map(|velocity| pace * velocity),
        acceleration: reference.acceleration.map(|acceleration| pace * pace * acceleration),
        ..reference
    }
}

/// What the reference moves along: the way to the task and the task, or the task alone.
fn along<'a>(way: Option<&'a Way>, track: &'a Track) -> (&'a Path, &'a SpeedProfile) {
    way.map_or((&track.path, &track.profile), |way| (&way.path, &way.profile))
}
