//! Reference tracks: a path and the speed along it.

use hydroid_core::guidance::{Fence, Path, PathError, Piece, Side, SpeedLimits, SpeedProfile};
use serde::Serialize;

use super::error::ClosedLoopError;

/// Geometry of a reference path.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "task", rename_all = "kebab-case")]
pub enum Task {
    /// Circle to starboard about the origin.
    Circle {
        /// Radius \[m\].
        radius: f64,
    },
    /// Parallel legs north and south, first turn to starboard.
    LawnMower {
        /// Length of a leg \[m\].
        leg: f64,
        /// Distance of the legs \[m\].
        spacing: f64,
        /// Number of legs.
        legs: usize,
        /// Turning radius \[m\].
        radius: f64,
    },
    /// Polyline through points.
    Waypoints {
        /// North and east of each \[m\].
        points: Vec<[f64; 2]>,
        /// Turning radius at the corners \[m\]; `None` for sharp corners.
        radius: Option<f64>,
    },
    /// Station keeping (dynamic positioning): a point and a heading.
    Station {
        /// North and east \[m\].
        position: [f64; 2],
        /// Heading, clockwise from north \[rad\].
        heading: f64,
    },
}

impl Task {
    fn path(&self) -> Result<Path, PathError> {
        match self {
            Self::Circle { radius } => Path::circle([0.0, 0.0], *radius, Side::Starboard, 0.0),
            Self::LawnMower { leg, spacing, legs, radius } => {
                Path::lawn_mower([0.0, 0.0], 0.0, *leg, *spacing, *legs, *radius, Side::Starboard)
            }
            Self::Waypoints { points, radius: Some(radius) } => Path::waypoints(points, *radius),
            Self::Waypoints { points, radius: None } => Path::legs(points),
            Self::Station { position: [x, y], heading } => {
                Path::legs(&[[*x, *y], [x + heading.cos(), y + heading.sin()]])
            }
        }
    }

    const fn radius(&self) -> Option<f64> {
        match self {
            Self::Circle { radius } | Self::LawnMower { radius, .. } => Some(*radius),
            Self::Waypoints { radius, .. } => *radius,
            Self::Station { .. } => None,
        }
    }
}

/// Desired speed along a path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SpeedOptions {
    /// Speed on straights \[m/s\].
    pub cruise: f64,
    /// Speed in turns and at corners \[m/s\]; `None` for the cruise speed.
    pub turn: Option<f64>,
    /// Largest acceleration and deceleration \[m/s^2\].
    pub acceleration: f64,
}

impl SpeedOptions {
    /// Constant speed.
    pub const fn cruise(speed: f64) -> Self {
        Self { cruise: speed, turn: None, acceleration: 0.2 }
    }
}

/// A path and the speed along it.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Path.
    pub path: Path,
    /// Speed profile.
    pub profile: SpeedProfile,
    /// Limits of the speed.
    pub limits: SpeedLimits,
    /// Speed on straights \[m/s\].
    pub cruise: f64,
    /// Whether the reference stays at the start of the path, at rest.
    pub is_station: bool,
    /// On board: where the vessel may be.
    pub fence: Fence,
}

impl Track {
    /// Track of a task.
    ///
    /// # Errors
    /// If the path or the speed is invalid.
    pub fn new(task: &Task, speed: &SpeedOptions) -> Result<Self, PathError> {
        let path = task.path()?;
        let mut limits = SpeedLimits {
            acceleration: speed.acceleration,
            deceleration: speed.acceleration,
            ..SpeedLimits::cruise(speed.cruise)
        };
        if let Some(turn) = speed.turn {
            limits.corner = turn;
            if let Some(radius) = task.radius() {
                limits.lateral_acceleration = turn * turn / radius;
            }
        }
        let profile = SpeedProfile::new(&path, &limits)?;
        let is_station = matches!(task, Task::Station { .. });
        Ok(Self { path, profile, limits, cruise: speed.cruise, is_station, fence: Fence::default() })
    }

    /// The track in a fence.
    ///
    /// # Errors
    /// The first point of the path that is outside.
    pub fn within(self, fence: Fence) -> Result<Self, ClosedLoopError> {
        let pieces = self.path.pieces();
        // A station is the first point of its path.
        let pieces = if self.is_station { &[Piece { length: 0.0, ..pieces[0] }] } else { pieces };
        match fence.leaves(pieces) {
            Some([north, east]) => Err(ClosedLoopError::Fence { north, east }),
            None => Ok(Self { fence, ..self }),
        }
    }

    /// Duration at the profile's speed \[s\]; `None` for a closed path and for a station.
    pub fn duration_s(&self) -> Option<f64> {
        (!self.path.is_closed() && !self.is_station).then(|| self.profile.duration())
    }

    /// Speed of the reference at its start \[m/s\].
    pub fn start_speed(&self) -> f64 {
        if self.is_station { 0.0 } else { self.profile.at(0.0).0 }
    }
}
