//! Types of option values.

use clap::ValueEnum;

/// Outputs that the model observes before the origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Origin {
    /// The measurements
    Measured,
    /// The true outputs of a simulated log
    True,
}

/// Reference of the errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Against {
    /// The measurements
    Measurement,
    /// The true outputs of a simulated log
    Truth,
}
