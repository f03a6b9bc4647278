//! The area within which a vessel may move.

use alloc::vec::Vec;
use core::fmt;

use num_traits::Float;

use super::piece::Piece;

/// A border in the north-east frame \[m\].
#[derive(Clone, Debug, PartialEq)]
pub enum Border {
    /// A circle.
    Circle {
        /// Centre, north and east \[m\].
        centre: [f64; 2],
        /// Radius \[m\].
        radius: f64,
    },
    /// A polygon, with the north and east of each corner \[m\]; the last one is joined to the first one.
    Polygon(Vec<[f64; 2]>),
}

/// Areas within which a vessel may move, and areas that it must keep out of. Without any, it may move anywhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fence {
    /// Borders, and whether the vessel belongs inside.
    areas: Vec<(Border, bool)>,
}

/// Reason why a border encloses no area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoArea {
    /// A number is not finite, or a radius is not positive.
    Number,
    /// Fewer than three corners, or all of them on a line.
    Corners,
}

impl fmt::Display for NoArea {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Number => "all numbers must be finite, and the radius greater than 0",
            Self::Corners => "a polygon needs at least three corners that are not on a line",
        })
    }
}

impl core::error::Error for NoArea {}

/// Shortest step along a path that is checked \[m\].
const STEP_M: f64 = 0.01;

impl Border {
    fn check(&self) -> Result<(), NoArea> {
        match self {
            Self::Circle { centre: [north, east], radius } => {
                let is_finite = [north, east, radius].into_iter().all(|x| x.is_finite());
                if is_finite && *radius > 0.0 { Ok(()) } else { Err(NoArea::Number) }
            }
            Self::Polygon(corners) if corners.iter().flatten().any(|x| !x.is_finite()) => Err(NoArea::Number),
            Self::Polygon(corners) => {
                let Some([n, e]) = corners.first() else { return Err(NoArea::Corners) };
                let twice = |[a, b]: [&[f64; 2]; 2]| (a[0] - n) * (b[1] - e) - (b[0] - n) * (a[1] - e);
                let is_flat = corners.windows(2).all(|pair| twice([&pair[0], &pair[1]]) == 0.0);
                if is_flat { Err(NoArea::Corners) } else { Ok(()) }
            }
        }
    }

    /// Distance of a point from the border \[m\], negative outside.
    fn margin(&self, [north, east]: [f64; 2]) -> f64 {
        match self {
            Self::Circle { centre, radius } => radius - Float::hypot(north - centre[0], east - centre[1]),
            Self::Polygon(corners) => {
                let (mut is_inside, mut nearest) = (false, f64::INFINITY);
                let last = corners.last().copied().unwrap_or_default();
                let mut from = last;
                for &to in corners {
                    let ([dn, de], [n, e]) =
                        ([to[0] - from[0], to[1] - from[1]], [north - from[0], east - from[1]]);
                    let share = ((n * dn + e * de) / (dn * dn + de * de)).clamp(0.0, 1.0);
                    // Equal corners have no direction.
                    let share = if share.is_nan() { 0.0 } else { share };
                    nearest = nearest.min(Float::hypot(n - share * dn, e - share * de));
                    // A ray to the north crosses the side.
                    if (from[1] > east) != (to[1] > east) && n < e * dn / de {
                        is_inside = !is_inside;
                    }
                    from = to;
                }
                if is_inside { nearest } else { -nearest }
            }
        }
    }
}

impl Fence {
    /// Adds an area in which the vessel must stay.
    ///
    /// # Errors
    /// If the border encloses no area.
    pub fn keep_in(&mut self, border: Border) -> Result<(), NoArea> {
        self.add(border, true)
    }

    /// Adds an area that the vessel must keep out of.
    ///
    /// # Errors
    /// If the border encloses no area.
    pub fn keep_out(&mut self, border: Border) -> Result<(), NoArea> {
        self.add(border, false)
    }

    fn add(&mut self, border: Border, is_inside: bool) -> Result<(), NoArea> {
        border.check()?;
        self.areas.push((border, is_inside));
        Ok(())
    }

    /// Distance of a point, north and east, from the nearest border \[m\]: negative where the vessel must not be, infinite
    /// without areas, not a number for a point that is none.
    pub fn margin(&self, point: [f64; 2]) -> f64 {
        if point.iter().any(|x| x.is_nan()) {
            return f64::NAN;
        }
        let margins = self.areas.iter().map(|(border, is_inside)| {
            let margin = border.margin(point);
            if *is_inside { margin } else { -margin }
        });
        margins.fold(f64::INFINITY, f64::min)
    }

    /// The first point of the pieces of a path at which it leaves the permitted area.
    ///
    /// A margin changes by at most the length of the way, so that a step as long as the margin crosses no border (J. C. Hart,
    /// *Sphere tracing*, The Visual Computer 12 (1996) 527); the shortest step is 1 cm.
    pub fn leaves(&self, pieces: &[Piece]) -> Option<[f64; 2]> {
        if self.areas.is_empty() {
            return None;
        }
        pieces.iter().find_map(|piece| {
            let mut along = 0.0;
            loop {
                let point = piece.at(along).position;
                let margin = self.margin(point);
                if margin.is_nan() || margin < 0.0 {
                    return Some(point);
                }
                if along >= piece.length {
                    return None;
                }
                along = (along + margin.max(STEP_M)).min(piece.length);
            }
        })
    }
}
