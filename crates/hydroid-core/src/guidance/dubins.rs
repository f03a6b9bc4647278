//! The shortest ways from a pose to a pose with a turning radius.

use alloc::vec::Vec;
use core::f64::consts::{FRAC_PI_2, TAU};

use num_traits::Float;

use super::piece::{Piece, Pose};

/// Angle that counts as none \[rad\]: rounding makes a full circle of it.
const NO_TURN: f64 = 1e-9;

/// The paths from `from` to `to` (positions and courses) with turns of one radius \[m\], the shortest one first: at most three
/// arcs and lines each, none if the poses are equal.
///
/// The shortest one consists of two arcs with a tangent, or of three arcs (L. E. Dubins, *On curves of minimal length with a
/// constraint on average curvature*, 1957). There are at most eight. `radius` is positive, and the poses are finite; otherwise
/// there is none.
pub fn dubins(from: &Pose, to: &Pose, radius: f64) -> Vec<Vec<Piece>> {
    let mut all: Vec<(f64, [(f64, f64); 3])> = Vec::with_capacity(8);
    // Turn, curvature (sign) and length of each part, with the turns in radians and the line in radii.
    let mut consider = |parts: [(f64, f64); 3]| {
        let length = parts.iter().map(|(_, length)| length).sum::<f64>();
        if length.is_finite() {
            all.push((length, parts));
        }
    };
    for side in [1.0, -1.0] {
        let first = centre(from, side * radius);
        // Tangents of circles.
        for other in [side, -side] {
            let last = centre(to, other * radius);
            let (distance, bearing) = polar(first, last);
            let straight = distance / radius;
            let (line, course) = if side != other {
                // NaN if the circles overlap.
                (Float::sqrt(straight * straight - 4.0), bearing + side * Float::asin(2.0 / straight))
            } else if straight > NO_TURN {
                (straight, bearing)
            } else {
                (0.0, to.course)
            };
            consider([
                (side, turn(side, from.course, course)),
                (0.0, line),
                (other, turn(other, course, to.course)),
            ]);
        }
        // A circle that touches both.
        let last = centre(to, side * radius);
        let (distance, bearing) = polar(first, last);
        for angle in [1.0, -1.0].map(|which| which * Float::acos(distance / (4.0 * radius))) {
            let towards = bearing + angle;
            let (sin, cos) = Float::sin_cos(towards);
            let middle = [first[0] + 2.0 * radius * cos, first[1] + 2.0 * radius * sin];
            let (_, from_middle) = polar(middle, last);
            let (on, off) = (towards + side * FRAC_PI_2, from_middle - side * FRAC_PI_2);
            consider([
                (side, turn(side, from.course, on)),
                (-side, turn(-side, on, off)),
                (side, turn(side, off, to.course)),
            ]);
        }
    }
    all.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let path = |(_, parts): (f64, [(f64, f64); 3])| {
        let mut pieces: Vec<Piece> = Vec::with_capacity(3);
        let mut at = Pose { curvature: 0.0, ..*from };
        for (side, length) in parts {
            if length > NO_TURN {
                let piece = Piece {
                    start: at.position,
                    course: at.course,
                    curvature: side / radius,
                    length: length * radius,
                };
                at = piece.at(piece.length);
                pieces.push(piece);
            }
        }
        pieces
    };
    all.into_iter().map(path).collect()
}

/// Centre of the circle through a pose with a radius, positive to starboard.
fn centre(pose: &Pose, radius: f64) -> [f64; 2] {
    let (sin, cos) = Float::sin_cos(pose.course);
    [pose.position[0] - radius * sin, pose.position[1] + radius * cos]
}

/// Distance and bearing of a point.
fn polar(from: [f64; 2], to: [f64; 2]) -> (f64, f64) {
    let [north, east] = [to[0] - from[0], to[1] - from[1]];
    (Float::hypot(north, east), Float::atan2(east, north))
}

/// Angle of a turn to one side from a course to another one, from 0 to a full circle.
fn turn(side: f64, from: f64, to: f64) -> f64 {
    let angle = side * (to - from);
    let angle = angle - TAU * Float::floor(angle / TAU);
    // Not a number stays so.
    let is_near = |whole: f64| (angle - whole).abs() < NO_TURN;
    if is_near(0.0) || is_near(TAU) { 0.0 } else { angle }
}
