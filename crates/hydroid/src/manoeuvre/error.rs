//! Errors of manoeuvring trials.

use crate::key::key;
use crate::plant::PlantError;

/// Reason why a trial cannot be run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum ManoeuvreError {
    #[error(transparent)]
    Plant(#[from] PlantError),
    #[error(
        "the vessel cannot hold a straight course: at {speed_m_s:.2} m/s it turns by {low_deg_s:.3} deg/s with the steering as far to port as in training, and by {high_deg_s:.3} deg/s as far to starboard. Check the roles of the inputs, state them with {}, name the inputs that turn it with {}, or approach at another speed",
        key("role"),
        key("turn")
    )]
    NoStraightCourse { speed_m_s: f64, low_deg_s: f64, high_deg_s: f64 },
    #[error(
        "{reason}. No trial of this model is valid: identify from logs in which steering and propulsion are changed"
    )]
    NotIdentified { reason: String },
    #[error(
        "the approach is not steady after {t_s:.0} s: speed {speed_m_s:.3} m/s, yaw rate {yaw_deg_s:.4} deg/s. Approach at another {} or {}, or identify from logs with straight runs at constant commands",
        key("speed"),
        key("propulsion")
    )]
    Unsteady { t_s: f64, speed_m_s: f64, yaw_deg_s: f64 },
    #[error(
        "the approach is not valid: {reason}. Approach at another {}, or identify from logs at this one",
        key("speed")
    )]
    NotValid { reason: String },
    #[error(
        "with the steering hard over, the vessel turns by {turned_deg:.0} deg in {t_s:.0} s, and not by 180: name the inputs that turn it with {}",
        key("turn")
    )]
    NoTurn { t_s: f64, turned_deg: f64 },
    #[error(
        "the vessel moves ahead at {speed_m_s:.3} m/s with the propulsion of the approach; a trial needs a positive speed: give a larger {}, or name the inputs that push it with {}",
        key("propulsion"),
        key("push")
    )]
    NotAhead { speed_m_s: f64 },
    #[error(
        "{}: the steady speed of the vessel is {own_m_s:.3} m/s, because {reason}. Leave {} out, identify from logs at the other speed, or state the input that pushes the vessel, as in {}",
        key("speed").is(speed_m_s),
        key("speed"),
        key("role").is("NAME=propulsion")
    )]
    OwnSpeed { speed_m_s: f64, own_m_s: f64, reason: String },
    #[error("{}: the steady speeds of the vessel are {low_m_s:.3} to {high_m_s:.3} m/s", key("speed").is(speed_m_s))]
    Speed { speed_m_s: f64, low_m_s: f64, high_m_s: f64 },
    /// Number out of range.
    #[error("{what} is {value}; {needed}")]
    Option { what: &'static str, value: f64, needed: &'static str },
}
