//! Guidance: paths, speed profiles, reference points and heading references.
//!
//! - [`Path`]: straight legs and arcs in the north-east frame, by arc length: circles, legs with corners, way-points
//!   with turning circles, lawn-mowers.
//! - [`dubins`]: the shortest ways from a pose to a pose with a turning radius.
//! - [`Fence`]: areas within which a vessel may move.
//! - [`SpeedProfile`]: the speed along a path within the limits of a vessel ([`SpeedLimits`]).
//! - [`Reference`]: the reference point of a controller, with velocity and acceleration. A [`TimedReference`] moves
//!   with time, a [`PathReference`] with the vessel.
//! - [`LineOfSight`]: the heading reference towards the path, with look-ahead and integral action against drift.
//!
//! Frames and signs: `x` north, `y` east, courses clockwise from north, curvature and cross-track error positive to
//! starboard. Metres, radians, seconds.
//!
//! ```
//! use hydroid_core::guidance::{Path, Side, SpeedLimits, SpeedProfile, TimedReference};
//!
//! let path = Path::lawn_mower([0.0, 0.0], 0.0, 100.0, 40.0, 4, 15.0, Side::Starboard)?;
//! let limits = SpeedLimits { lateral_acceleration: 0.2, ..SpeedLimits::cruise(4.0) };
//! let profile = SpeedProfile::new(&path, &limits)?;
//! let mut point = TimedReference::new(&profile);
//! let mut slowest = f64::INFINITY;
//! while !point.is_done(&profile) {
//!     slowest = slowest.min(point.reference(&path, &profile).speed);
//!     point.advance(&profile, 0.1);
//! }
//! // sqrt(0.2 * 15) in the turns
//! assert!((slowest - 1.732).abs() < 0.01);
//! # Ok::<(), hydroid_core::guidance::PathError>(())
//! ```

mod dubins;
mod error;
mod fence;
mod line_of_sight;
mod path;
mod piece;
mod reference;
mod shapes;
mod speed;

pub use dubins::dubins;
pub use error::PathError;
pub use fence::{Border, Fence, NoArea};
pub use line_of_sight::{HeadingReference, LineOfSight, LineOfSightOptions};
pub use path::{Path, Projection};
pub use piece::{Piece, Pose};
pub use reference::{PathReference, Reference, TimedReference};
pub use shapes::Side;
pub use speed::{SpeedLimits, SpeedProfile};
