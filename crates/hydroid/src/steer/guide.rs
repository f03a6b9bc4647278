//! The reference from sample to sample, and those of the samples to come.

use hydroid_core::guidance::{Follower, Reference, Walker};
use serde::Serialize;

use super::course::Course;

/// What moves the reference along its path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Timing {
    /// The clock: the vessel is to be at a place at a time (trajectory tracking).
    Clock,
    /// The vessel: the place of the path that is nearest to it, at the speed asked for there (path following).
    Foot,
}

/// How far along the path a vessel is looked for from where it was last \[m\]: more than it moves in a sample, less than
/// what lies between two legs.
const REACH_M: f64 = 6.0;

/// A reference that moves.
pub(super) struct Guide<'a> {
    course: &'a Course,
    timing: Timing,
    walker: Walker,
    follower: Follower,
    /// Of the vessel, for the cross-track error; of the reference too, where it follows.
    at: f64,
}

impl<'a> Guide<'a> {
    pub(super) fn new(course: &'a Course, timing: Timing) -> Self {
        let (walker, follower) = (Walker::new(&course.profile), Follower::new(0.0, REACH_M));
        Self { course, timing, walker, follower, at: 0.0 }
    }

    /// The reference for a vessel whose point is here, and how far the point is to starboard of the path \[m\].
    pub(super) fn see(&mut self, point: [f64; 2]) -> (Reference, f64) {
        let Course { path, profile } = self.course;
        let foot = self.follower.foot(path, point);
        self.at = foot.s;
        let reference = match self.timing {
            Timing::Clock => self.walker.reference(path, profile),
            Timing::Foot => {
                let (speed, rate) = profile.at(foot.s);
                Reference::new(foot.s, &foot.pose, speed, rate)
            }
        };
        (reference, foot.cross_track)
    }

    /// References after 1, 2, .. samples from the one that was seen last.
    pub(super) fn ahead(&self, dt_s: f64, into: &mut [Reference]) {
        let Course { path, profile } = self.course;
        match self.timing {
            Timing::Clock => {
                let mut walker = self.walker;
                for reference in into {
                    walker.advance(profile, dt_s);
                    *reference = walker.reference(path, profile);
                }
            }
            Timing::Foot => {
                let mut s = self.at;
                for reference in into {
                    let (speed, rate) = profile.at(s);
                    s += dt_s * (speed + 0.5 * dt_s * rate);
                    let (speed, rate) = profile.at(s);
                    *reference = Reference::new(s, &path.at(s), speed, rate);
                }
            }
        }
    }

    pub(super) fn advance(&mut self, dt_s: f64) {
        self.walker.advance(&self.course.profile, dt_s);
    }

    /// Whether the end of an open path is reached.
    pub(super) fn is_done(&self) -> bool {
        let open = !self.course.path.is_closed();
        open && match self.timing {
            Timing::Clock => self.walker.is_done(&self.course.profile),
            Timing::Foot => self.at >= self.course.path.length(),
        }
    }
}
