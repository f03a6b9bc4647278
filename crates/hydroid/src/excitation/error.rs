//! Errors of an excitation.

/// Wrong input to an excitation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExcitationError {
    /// The vessel has no surge drag.
    #[error(
        "the vessel has no surge drag (drag.linear[0][0], drag.quadratic[0][0]): its speed would grow without bound"
    )]
    NoDrag,
    /// The propeller cannot push forward.
    #[error("commands.propeller.limits end at {limit}: the propeller cannot push forward")]
    NoForwardForce {
        /// Upper limit of the propeller command.
        limit: f64,
    },
    /// Quantity that must be positive.
    #[error("{what} is {value}; it must be a number greater than 0")]
    NotPositive {
        /// Quantity.
        what: &'static str,
        /// Given value.
        value: f64,
    },
    /// Speed above the top speed.
    #[error("a speed of {speed} m/s is out of reach: full propeller force makes {top:.2} m/s")]
    OutOfReach {
        /// Given speed \[m/s\].
        speed: f64,
        /// Top speed \[m/s\].
        top: f64,
    },
    /// Legs that are too short.
    #[error("a leg of {leg} m is too short for this duration: give at least {shortest:.3} m")]
    LegTooShort {
        /// Given length \[m\].
        leg: f64,
        /// Shortest length \[m\].
        shortest: f64,
    },
    /// No commands given.
    #[error("the commands have no rows")]
    NoRows,
    /// Non-finite time or command.
    #[error("row {row} of the commands: {what} is not a finite number")]
    NotFinite {
        /// Row, counted from 1.
        row: usize,
        /// `time` or the name of the command.
        what: String,
    },
    /// Time does not increase.
    #[error("row {row} of the commands: time {time} s does not come after {before} s")]
    TimeNotIncreasing {
        /// Row, counted from 1.
        row: usize,
        /// Its time \[s\].
        time: f64,
        /// Time of the row before \[s\].
        before: f64,
    },
    /// Command beyond the vessel's limits.
    #[error(
        "row {row} of the commands: {name} = {value} is beyond the vessel's limits [{low}, {high}]; clip it there, or widen the limits in the vessel's file"
    )]
    OutsideLimits {
        /// Row, counted from 1.
        row: usize,
        /// Name of the command.
        name: String,
        /// The command.
        value: f64,
        /// Lower limit.
        low: f64,
        /// Upper limit.
        high: f64,
    },
}
