//! Where a vessel is sent, and how fast.

use hydroid_core::guidance::{Path, PathError, Side, SpeedLimits, SpeedProfile};
use serde::Serialize;

/// A task.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "task", rename_all = "kebab-case")]
pub enum Task {
    /// Round and round, to starboard, about the origin.
    Circle {
        /// Radius \[m\].
        radius: f64,
    },
    /// Parallel legs to the north and back, the first turn to starboard.
    LawnMower {
        /// Length of a leg \[m\].
        leg: f64,
        /// Distance of the legs \[m\].
        spacing: f64,
        /// How many.
        legs: usize,
        /// Turning radius \[m\].
        radius: f64,
    },
    /// From point to point.
    Waypoints {
        /// North and east of each \[m\].
        points: Vec<[f64; 2]>,
        /// Turning radius that cuts the corners \[m\]; none for straight legs with corners.
        radius: Option<f64>,
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
        }
    }

    /// Turning radius \[m\], where there is one.
    const fn radius(&self) -> Option<f64> {
        match self {
            Self::Circle { radius } | Self::LawnMower { radius, .. } => Some(*radius),
            Self::Waypoints { radius, .. } => *radius,
        }
    }
}

/// How fast.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pace {
    /// Speed on straights \[m/s\].
    pub cruise: f64,
    /// Speed in turns and over corners \[m/s\]; none for the same everywhere.
    pub turn: Option<f64>,
    /// Largest rate of the speed, up and down \[m/s^2\].
    pub acceleration: f64,
}

impl Pace {
    /// One speed everywhere.
    pub const fn cruise(speed: f64) -> Self {
        Self { cruise: speed, turn: None, acceleration: 0.2 }
    }
}

/// A path and the speed along it.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    /// Where.
    pub path: Path,
    /// How fast.
    pub profile: SpeedProfile,
}

impl Course {
    /// The course of a task.
    ///
    /// # Errors
    /// If there is no such path or speed.
    pub fn new(task: &Task, pace: &Pace) -> Result<Self, PathError> {
        let path = task.path()?;
        let mut limits = SpeedLimits {
            acceleration: pace.acceleration,
            deceleration: pace.acceleration,
            ..SpeedLimits::cruise(pace.cruise)
        };
        if let Some(turn) = pace.turn {
            limits.corner = turn;
            if let Some(radius) = task.radius() {
                // The speed at which a turn of this radius is as tight as allowed.
                limits.lateral_acceleration = turn * turn / radius;
            }
        }
        let profile = SpeedProfile::new(&path, &limits)?;
        Ok(Self { path, profile })
    }

    /// How long it takes at the speeds asked for \[s\]; none for one without an end.
    pub fn duration_s(&self) -> Option<f64> {
        (!self.path.is_closed()).then(|| self.profile.duration())
    }
}
