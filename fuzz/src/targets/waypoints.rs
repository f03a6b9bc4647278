//! Way-points.

use hydroid::closed_loop::{Purpose, SpeedOptions, Task, Track, Waypoints};
use hydroid_core::guidance::{PathReference, TimedReference};

/// Way-points are finite, and a reference moves along the tracks through them.
pub fn waypoints(bytes: &[u8]) {
    let Ok(Waypoints { points, .. }) = Waypoints::parse(bytes, "fuzz.gpx", None, Purpose::Route) else {
        return;
    };
    assert!(points.iter().flatten().all(|number| number.is_finite()));
    for radius in [None, Some(2.0)] {
        for turn in [None, Some(0.5)] {
            let speed = SpeedOptions { turn, ..SpeedOptions::cruise(1.5) };
            let task = Task::Waypoints { points: points.clone(), radius };
            if let Ok(track) = Track::new(&task, &speed) {
                follow(&track);
            }
        }
    }
}

fn follow(track: &Track) {
    let Track { path, profile, .. } = track;
    let duration = track.duration_s().expect("an open path");
    assert!(duration.is_finite() && duration > 0.0 && path.length() > 0.0, "{duration} s");
    let mut timed = TimedReference::new(profile);
    let mut follower = PathReference::new(0.0, 6.0);
    for share in [0.0, 0.01, 0.5, 0.6] {
        timed.advance(profile, share * duration);
        let reference = timed.reference(path, profile);
        assert!(reference.is_finite(), "{reference:?}");
        let projection = follower.project(path, [reference.position[0] + 1.0, reference.position[1]]);
        assert!(projection.s.is_finite() && projection.cross_track.is_finite());
    }
    assert!(timed.is_done(profile));
}
