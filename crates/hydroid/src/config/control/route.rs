//! Reference path and speed of a task.

use hydroid_core::guidance::{Border, Fence};

use super::error::{SetupError, ensure};
use super::options::{ClosedLoopOptions, TaskKind};
use crate::closed_loop::{Purpose, Scale, SpeedOptions, Task, Waypoints};
use crate::key::key;
use crate::manoeuvre::Response;

/// Path, speed, and origin of way-points that are latitudes and longitudes \[deg\].
pub(super) struct Route {
    pub(super) task: Task,
    pub(super) pace: SpeedOptions,
    pub(super) origin_deg: Option<[f64; 2]>,
}

impl Route {
    pub(super) fn of(
        given: &ClosedLoopOptions,
        scale: Scale,
        response: Option<&Response>,
    ) -> Result<Self, SetupError> {
        let radius = given.radius.unwrap_or(15.0 * scale.radius);
        let cruise = given.speed.or(response.map(|response| response.speed_m_s)).unwrap_or(1.5);
        if let Some(Response { turning_radius_m, speed_m_s, .. }) =
            response.filter(|_| given.task != TaskKind::Station)
        {
            ensure(
                radius > *turning_radius_m || given.turn_speed.is_some_and(|turn| turn < *speed_m_s),
                || {
                    format!(
                        "{}: at {speed_m_s:.2} m/s, the model turns with a radius of {turning_radius_m:.1} m with the steering hard over: give a larger {}, or a {} below {speed_m_s:.2}",
                        key("radius").is(radius),
                        key("radius"),
                        key("turn_speed")
                    )
                },
            )?;
        }
        let mut origin_deg = None;
        let mut points = || match (&given.points, &given.waypoints) {
            (Some(points), _) => Ok(points.clone()),
            (None, Some(file)) => {
                let waypoints = Waypoints::read(file)?;
                origin_deg = waypoints.origin_deg;
                Ok(waypoints.points)
            }
            (None, None) => Err(SetupError::option(format!(
                "waypoints are missing: give them as {} (north,east in metres), or as a file with {}",
                key("points").is("0,0;60,0;60,40"),
                key("waypoints")
            ))),
        };
        let task = match given.task {
            TaskKind::Circle => Task::Circle { radius },
            TaskKind::LawnMower => Task::LawnMower {
                leg: given.leg.unwrap_or(60.0 * scale.radius),
                spacing: given.spacing.unwrap_or(2.0 * radius),
                legs: given.legs.unwrap_or(4),
                radius,
            },
            TaskKind::Waypoints => Task::Waypoints { points: points()?, radius: Some(radius) },
            TaskKind::Legs => Task::Waypoints { points: points()?, radius: None },
            TaskKind::Station => station(given)?,
        };
        let acceleration = given.acceleration.unwrap_or_else(|| match response {
            // A tenth of the acceleration at full ahead.
            Some(Response { surge: Some(surge), .. }) => 0.1 * surge.gain_m_s / surge.time_s,
            // The speed is that of the vessel: the reference begins with it.
            Some(response) => response.speed_m_s,
            None => 0.2,
        });
        ensure(acceleration > 0.0 || given.acceleration.is_some(), || {
            format!(
                "the model does not gain speed ahead with its propulsion: identify it from logs in which every input that pushes varies, correct the roles with {}, or state {}",
                key("role"),
                key("acceleration")
            )
        })?;
        let pace = SpeedOptions { cruise, turn: given.turn_speed, acceleration };
        Ok(Self { task, pace, origin_deg })
    }
}

impl ClosedLoopOptions {
    /// The fence, in the frame of the path; `origin_deg` is that of its way-points.
    pub(super) fn fence(&self, origin_deg: Option<[f64; 2]>) -> Result<Fence, SetupError> {
        let mut fence = Fence::default();
        let keep_in = self.fence.iter().map(|file| ("fence", file, Purpose::KeepIn));
        let keep_out = self.keep_out.iter().map(|file| ("keep_out", file, Purpose::KeepOut));
        if let Some(file) = self.fence.as_ref().filter(|file| !self.keep_out.contains(file)) {
            ensure(!Waypoints::has_keep_out(file)?, || {
                format!(
                    "{} has an area to keep out of as well: state it with {}",
                    key("fence").is(file.display()),
                    key("keep_out").is(file.display())
                )
            })?;
        }
        for (option, file, purpose) in keep_in.chain(keep_out) {
            let corners = Waypoints::read_about(file, origin_deg, purpose)?;
            let stated = || key(option).is(file.display());
            ensure(origin_deg.is_some() || corners.origin_deg.is_none(), || {
                format!(
                    "{} has latitudes and longitudes, and the path is in metres: give the path by {} with latitudes and longitudes, or the polygon in metres",
                    stated(),
                    key("waypoints")
                )
            })?;
            let border = Border::Polygon(corners.points);
            let added =
                if purpose == Purpose::KeepIn { fence.keep_in(border) } else { fence.keep_out(border) };
            added.map_err(|error| SetupError::option(format!("{}: {error}", stated())))?;
        }
        Ok(fence)
    }
}

fn station(given: &ClosedLoopOptions) -> Result<Task, SetupError> {
    let position = match given.points.as_deref() {
        None => [0.0; 2],
        Some([point]) => *point,
        Some(points) => {
            return Err(SetupError::option(format!(
                "{} has {} points: a station is one point, as in {} (north,east in metres)",
                key("points"),
                points.len(),
                key("points").is("20,-5")
            )));
        }
    };
    Ok(Task::Station { position, heading: given.heading.unwrap_or(0.0).to_radians() })
}
