//! A piece of a path: a line or an arc.

use num_traits::Float;

use crate::vessel::kinematics::wrap;

/// A point on a path with its tangent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// `[x, y]`, north and east \[m\].
    pub position: [f64; 2],
    /// Direction of the path, clockwise from north \[rad\]; not wrapped within a piece.
    pub course: f64,
    /// Curvature, positive to starboard \[1/m\].
    pub curvature: f64,
}

impl Pose {
    /// Distance of a point to starboard of the tangent \[m\]: `-(x - x_p) sin(course) + (y - y_p) cos(course)` (Fossen
    /// 2021, section 12.3.2).
    pub fn cross_track(&self, [x, y]: [f64; 2]) -> f64 {
        let (sin, cos) = Float::sin_cos(self.course);
        (y - self.position[1]) * cos - (x - self.position[0]) * sin
    }

    /// Distance of a point ahead, along the tangent \[m\].
    pub fn along_track(&self, [x, y]: [f64; 2]) -> f64 {
        let (sin, cos) = Float::sin_cos(self.course);
        (x - self.position[0]) * cos + (y - self.position[1]) * sin
    }
}

/// A line (curvature 0) or an arc of constant curvature. At `d` metres from its start, with start `p_0`, course
/// `gamma_0` and curvature `kappa` (the chord of a circle, valid also for the line):
///
/// ```text
/// gamma(d) = gamma_0 + kappa d
/// p(d)     = p_0 + d sinc(kappa d / 2) [cos(gamma_0 + kappa d / 2), sin(gamma_0 + kappa d / 2)]
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Start point, `[x, y]` \[m\].
    pub start: [f64; 2],
    /// Course at the start \[rad\].
    pub course: f64,
    /// Curvature, positive to starboard \[1/m\].
    pub curvature: f64,
    /// Length \[m\].
    pub length: f64,
}

impl Piece {
    /// Pose `d` metres from the start; the piece is extended with constant curvature beyond its ends.
    pub fn at(&self, d: f64) -> Pose {
        let half = 0.5 * self.curvature * d;
        let chord = d * sinc(half);
        let (sin, cos) = Float::sin_cos(self.course + half);
        Pose {
            position: [self.start[0] + chord * cos, self.start[1] + chord * sin],
            course: self.course + 2.0 * half,
            curvature: self.curvature,
        }
    }

    /// Distance from the start, between `from` and `to` metres, of the nearest point; arbitrary for the centre of an
    /// arc.
    pub fn nearest(&self, point: [f64; 2], from: f64, to: f64) -> f64 {
        let [x, y] = [point[0] - self.start[0], point[1] - self.start[1]];
        let (sin, cos) = Float::sin_cos(self.course);
        let (ahead, starboard) = (x * cos + y * sin, y * cos - x * sin);
        if self.curvature == 0.0 {
            return ahead.clamp(from, to);
        }
        // Angle on the arc since the start: seen from the centre, the start is at -1 / curvature to starboard.
        let run = Float::atan2(self.curvature * ahead, 1.0 - self.curvature * starboard);
        // Of all turns, the one nearest to the middle of the interval.
        let middle = 0.5 * (from + to);
        let d = middle + wrap(run - self.curvature * middle) / self.curvature;
        if (from..=to).contains(&d) {
            return d;
        }
        let distance = |d: f64| {
            let [x, y] = self.at(d).position;
            Float::hypot(point[0] - x, point[1] - y)
        };
        if distance(from) <= distance(to) { from } else { to }
    }
}

fn sinc(x: f64) -> f64 {
    // Here the next term of the series, x^4 / 120, is less than rounding.
    if x.abs() < 1e-4 { 1.0 - x * x / 6.0 } else { Float::sin(x) / x }
}
