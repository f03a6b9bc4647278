//! Errors of an excitation.

/// Wrong input to an excitation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum ExcitationError {
    #[error("an excitation of propeller and rudder: {0}")]
    Actuators(#[from] hydroid_core::craft::NotAffineCraft),
    #[error(
        "an excitation of propeller and rudder needs a vessel with one thruster on the centreline that pushes ahead, and one rudder of the law linear or sine: '{name}' has other actuators"
    )]
    NotPropellerRudder { name: String },
    #[error(
        "the vessel has no surge drag (drag.linear[0][0], drag.quadratic[0][0]): its speed would grow without bound"
    )]
    NoDrag,
    #[error(
        "the command of the propeller ends at {limit}, its neutral value or less: the propeller cannot push forward"
    )]
    NoForwardForce { limit: f64 },
    #[error("{what} is {value}; it must be a number greater than 0")]
    NotPositive { what: &'static str, value: f64 },
    #[error("a speed of {speed} m/s is out of reach: full propeller force makes {top:.2} m/s")]
    OutOfReach { speed: f64, top: f64 },
    #[error("a leg of {leg} m is too short for this duration: give at least {shortest:.3} m")]
    LegTooShort { leg: f64, shortest: f64 },
    #[error("the commands have no rows")]
    NoRows,
    #[error("row {row} of the commands: {what} is not a finite number")]
    NotFinite {
        /// Row, counted from 1.
        row: usize,
        /// `time` or the name of the command.
        what: String,
    },
    #[error("row {row} of the commands: time {time} s does not come after {before} s")]
    TimeNotIncreasing {
        /// Row, counted from 1.
        row: usize,
        time: f64,
        before: f64,
    },
    #[error(
        "row {row} of the commands: {name} = {value} is beyond the vessel's limits [{low}, {high}]; clip it there, or widen the limits in the vessel's file"
    )]
    OutsideLimits {
        /// Row, counted from 1.
        row: usize,
        name: String,
        value: f64,
        low: f64,
        high: f64,
    },
}
