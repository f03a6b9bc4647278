//! Paths of lines and arcs.

use hydroid_core::vessel::State;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Port,
    Starboard,
}

impl Side {
    /// Sign of the yaw rate: 1 to starboard, -1 to port.
    pub(super) const fn sign(self) -> f64 {
        match self {
            Self::Port => -1.0,
            Self::Starboard => 1.0,
        }
    }
}

/// A segment of a path, in the north-east frame \[m, rad\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Piece {
    /// Line from `start` along `course` for `length`.
    Line { start: [f64; 2], course: f64, length: f64 },
    /// Arc about `centre`; ends where its tangent is `exit`, or never.
    Arc { centre: [f64; 2], radius: f64, side: Side, exit: Option<f64> },
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Course of the path \[rad\].
    pub(super) course: f64,
    /// Cross-track error \[m\], positive to starboard.
    pub(super) cross_track: f64,
    /// Curvature, positive to starboard \[1/m\].
    pub(super) curvature: f64,
    /// Remaining length \[m\]; negative beyond the end.
    pub(super) remaining: f64,
}

impl Piece {
    pub(super) fn place(&self, state: &State) -> Place {
        match *self {
            Self::Line { start, course, length } => {
                let (north, east) = (state.x - start[0], state.y - start[1]);
                let (sin, cos) = course.sin_cos();
                Place {
                    course,
                    cross_track: east * cos - north * sin,
                    curvature: 0.0,
                    remaining: length - (north * cos + east * sin),
                }
            }
            Self::Arc { centre, radius, side, exit } => {
                let (north, east) = (state.x - centre[0], state.y - centre[1]);
                let sign = side.sign();
                let distance = north.hypot(east);
                Place {
                    course: east.atan2(north) + sign * std::f64::consts::FRAC_PI_2,
                    // Starboard of a circle to starboard is its inside.
                    cross_track: sign * (radius - distance),
                    curvature: sign / radius,
                    remaining: exit.map_or(f64::INFINITY, |exit| {
                        let (sin, cos) = exit.sin_cos();
                        let to_exit = -(north * cos + east * sin);
                        // Entry and exit lie on opposite sides of the centre; the arc ends on the exit side only.
                        let out = -sign * (east * cos - north * sin);
                        if out > 0.0 { to_exit } else { to_exit.abs() + radius }
                    }),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn at(x: f64, y: f64) -> State {
        State { x, y, ..State::REST }
    }

    #[test]
    fn to_starboard_of_a_northern_line_is_east() {
        let line = Piece::Line { start: [0.0, 0.0], course: 0.0, length: 10.0 };
        let place = line.place(&at(3.0, 2.0));
        assert_eq!((place.cross_track, place.remaining, place.curvature), (2.0, 7.0, 0.0));
    }

    #[test]
    fn an_arc_from_north_to_south() {
        let arc = Piece::Arc { centre: [10.0, 5.0], radius: 5.0, side: Side::Starboard, exit: Some(PI) };
        let start = arc.place(&at(10.0, 0.0));
        assert!(start.course.sin().abs() < 1e-12 && start.course.cos() > 0.0, "heads north");
        assert!(start.cross_track.abs() < 1e-12 && start.remaining > 0.0);
        let top = arc.place(&at(16.0, 5.0));
        assert!((top.course - FRAC_PI_2).abs() < 1e-12, "heads east");
        assert!((top.cross_track + 1.0).abs() < 1e-12, "outside is to port");
        assert!(top.remaining > 0.0);
        assert!(arc.place(&at(10.5, 10.0)).remaining > 0.0);
        assert!(arc.place(&at(9.9, 10.0)).remaining < 0.0, "done once past the way out");
        assert!(arc.place(&at(9.9, 0.0)).remaining > 0.0, "not yet on the way in");
    }
}
