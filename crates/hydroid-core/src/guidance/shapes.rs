//! Shapes of paths.

use alloc::vec::Vec;
use core::f64::consts::{FRAC_PI_2, PI, TAU};

use num_traits::Float;

use super::error::{PathError, finite, positive};
use super::path::Path;
use super::piece::Piece;
use crate::vessel::kinematics::wrap;

/// Side to which a path turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Left.
    Port,
    /// Right.
    Starboard,
}

impl Side {
    /// 1 to starboard, -1 to port: the sign of curvature and yaw rate.
    pub const fn sign(self) -> f64 {
        match self {
            Self::Port => -1.0,
            Self::Starboard => 1.0,
        }
    }

    /// The opposite side.
    pub const fn other(self) -> Self {
        match self {
            Self::Port => Self::Starboard,
            Self::Starboard => Self::Port,
        }
    }
}

struct Pen {
    pieces: Vec<Piece>,
    position: [f64; 2],
    course: f64,
}

impl Pen {
    fn at(position: [f64; 2], course: f64) -> Self {
        Self { pieces: Vec::new(), position, course }
    }

    /// Adds a piece of `length` metres, unless the length is within rounding of zero.
    fn go(&mut self, length: f64, curvature: f64) {
        if length > 1e-9 {
            let piece = Piece { start: self.position, course: self.course, curvature, length };
            let end = piece.at(length);
            (self.position, self.course) = (end.position, end.course);
            self.pieces.push(piece);
        }
    }

    fn turn(&mut self, angle: f64, radius: f64) {
        self.go(radius * angle.abs(), Float::signum(angle) / radius);
    }
}

impl Path {
    /// A closed circle. `bearing` is the direction from the centre to the start \[rad, clockwise from north\].
    ///
    /// # Errors
    /// If the radius is not positive, or a number not finite.
    pub fn circle(centre: [f64; 2], radius: f64, side: Side, bearing: f64) -> Result<Self, PathError> {
        positive("the radius of the circle", radius)?;
        finite("the centre of the circle", centre)?;
        finite("the bearing of the start", [bearing])?;
        let (sin, cos) = Float::sin_cos(bearing);
        let start = [centre[0] + radius * cos, centre[1] + radius * sin];
        let mut pen = Pen::at(start, bearing + side.sign() * FRAC_PI_2);
        pen.turn(side.sign() * TAU, radius);
        Self::new(pen.pieces, true)
    }

    /// Straight legs with corners, for a vessel that is slow in corners, or for line-of-sight guidance.
    ///
    /// # Errors
    /// If there are fewer than two points, or two consecutive ones coincide.
    pub fn legs(points: &[[f64; 2]]) -> Result<Self, PathError> {
        let legs = legs(points)?;
        let mut pen = Pen::at(points[0], 0.0);
        for &(course, length) in &legs {
            pen.course = course;
            pen.go(length, 0.0);
        }
        Self::new(pen.pieces, false)
    }

    /// Straight legs whose corners are cut by arcs tangent to both legs: at a corner of `theta` radians the arc begins
    /// `R tan(|theta| / 2)` before the way-point and ends at the same distance behind it.
    ///
    /// # Errors
    /// As [`legs`](Self::legs); if the radius is not positive, or the arcs of two corners would overlap.
    pub fn waypoints(points: &[[f64; 2]], radius: f64) -> Result<Self, PathError> {
        positive("the turning radius", radius)?;
        let legs = legs(points)?;
        let angle = |k: usize| wrap(legs[k].0 - legs[k - 1].0);
        // Cut per radius at way-point k, at the end of leg k - 1.
        let unit_cut = |k: usize| {
            if k == 0 || k == legs.len() { 0.0 } else { Float::tan(0.5 * angle(k).abs()) }
        };
        for (k, &(_, length)) in legs.iter().enumerate() {
            let cut = unit_cut(k) + unit_cut(k + 1);
            if cut * radius > length * (1.0 + 1e-12) {
                let point = if unit_cut(k) > unit_cut(k + 1) { k } else { k + 1 };
                // A reversal has a tangent of infinity, or of 1e16.
                let fits = if cut < 1e12 { length / cut } else { 0.0 };
                return Err(PathError::CornerTooSharp { point, fits });
            }
        }
        let mut pen = Pen::at(points[0], legs[0].0);
        for (k, &(course, length)) in legs.iter().enumerate() {
            if k > 0 {
                pen.turn(angle(k), radius);
                // Rounding does not add up over corners.
                pen.course = course;
            }
            pen.go(length - radius * (unit_cut(k) + unit_cut(k + 1)), 0.0);
        }
        Self::new(pen.pieces, false)
    }

    /// Parallel legs of `leg` metres, `spacing` metres apart, beginning at `start` along `course`, with alternate
    /// turns, the first to `side`. A turn is two quarter circles of `radius`, joined by a straight for
    /// `spacing > 2 radius`.
    ///
    /// # Errors
    /// If a length is not positive, there are no legs, or they are closer than two radii.
    pub fn lawn_mower(
        start: [f64; 2],
        course: f64,
        leg: f64,
        spacing: f64,
        legs: usize,
        radius: f64,
        side: Side,
    ) -> Result<Self, PathError> {
        finite("the start of the lawn-mower", [start[0], start[1], course])?;
        positive("the length of a leg", leg)?;
        positive("the distance of the legs", spacing)?;
        positive("the turning radius", radius)?;
        if legs == 0 {
            return Err(PathError::TooFew { what: "legs of a lawn-mower", needed: 1 });
        }
        if 2.0 * radius > spacing * (1.0 + 1e-12) {
            return Err(PathError::LegsTooClose { spacing, radius });
        }
        let mut pen = Pen::at(start, course);
        let mut side = side;
        for k in 0..legs {
            pen.go(leg, 0.0);
            if k + 1 < legs {
                for straight in [spacing - 2.0 * radius, 0.0] {
                    pen.turn(side.sign() * FRAC_PI_2, radius);
                    pen.go(straight, 0.0);
                }
                pen.course = if k % 2 == 0 { course + side.sign() * PI } else { course };
                side = side.other();
            }
        }
        Self::new(pen.pieces, false)
    }
}

fn legs(points: &[[f64; 2]]) -> Result<Vec<(f64, f64)>, PathError> {
    if points.len() < 2 {
        return Err(PathError::TooFew { what: "way-points", needed: 2 });
    }
    let mut legs = Vec::with_capacity(points.len() - 1);
    for (pair, point) in points.windows(2).zip(1..) {
        finite("a way-point", pair[0])?;
        finite("a way-point", pair[1])?;
        let [x, y] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
        let length = Float::hypot(x, y);
        if length <= 1e-9 {
            return Err(PathError::Coincide { point });
        }
        legs.push((Float::atan2(y, x), length));
    }
    Ok(legs)
}
