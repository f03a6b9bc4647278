//! Errors of manoeuvring trials.

use crate::plant::PlantError;

/// Reason why a trial cannot be run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ManoeuvreError {
    /// The model cannot be simulated.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// No steering holds a straight course.
    #[error(
        "the vessel cannot hold a straight course: at {speed_m_s:.2} m/s it turns by {low_deg_s:.3} deg/s with the steering hard to port and by {high_deg_s:.3} deg/s hard to starboard. Name the inputs that turn it with --turn, or approach at another speed"
    )]
    NoStraightCourse {
        /// Speed \[m/s\].
        speed_m_s: f64,
        /// Yaw rate hard to port \[deg/s\].
        low_deg_s: f64,
        /// Yaw rate hard to starboard \[deg/s\].
        high_deg_s: f64,
    },
    /// The approach does not become steady.
    #[error(
        "the approach is not steady after {t_s:.0} s: speed {speed_m_s:.3} m/s, yaw rate {yaw_deg_s:.4} deg/s"
    )]
    Unsteady {
        /// Simulated time \[s\].
        t_s: f64,
        /// Speed \[m/s\].
        speed_m_s: f64,
        /// Yaw rate \[deg/s\].
        yaw_deg_s: f64,
    },
    /// The vessel does not turn round.
    #[error(
        "with the steering hard over, the vessel turns by {turned_deg:.0} deg in {t_s:.0} s, and not by 180: name the inputs that turn it with --turn"
    )]
    NoTurn {
        /// Simulated time \[s\].
        t_s: f64,
        /// Change of heading \[deg\].
        turned_deg: f64,
    },
    /// The vessel does not move ahead.
    #[error(
        "the vessel moves ahead at {speed_m_s:.3} m/s with the propulsion of the approach; a trial needs a positive speed: give a larger --propulsion, or name the inputs that push it with --push"
    )]
    NotAhead {
        /// Speed \[m/s\].
        speed_m_s: f64,
    },
    /// The speed cannot be reached.
    #[error("--speed {speed_m_s}: the steady speeds of the vessel are {low_m_s:.3} to {high_m_s:.3} m/s")]
    Speed {
        /// Given \[m/s\].
        speed_m_s: f64,
        /// Slowest \[m/s\].
        low_m_s: f64,
        /// Fastest \[m/s\].
        high_m_s: f64,
    },
    /// Number out of range.
    #[error("{what} is {value}; {needed}")]
    Option {
        /// Quantity.
        what: &'static str,
        /// Given value.
        value: f64,
        /// Permitted values.
        needed: &'static str,
    },
}
