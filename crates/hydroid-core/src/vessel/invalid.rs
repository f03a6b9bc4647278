//! Reasons why a parameter set is invalid.

use core::fmt;

/// Mode of a hydrofoil.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Hull in the water.
    Normal,
    /// On the foils.
    Flying,
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Normal => "normal",
            Self::Flying => "flying",
        })
    }
}

/// The invalid parameter of a [`VesselParams`](super::VesselParams). Fields are named by their path.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum InvalidParams {
    #[error("{field} is {value}; a finite number is needed")]
    NotFinite { field: &'static str, value: f64 },
    #[error("{field} is {value}; it must be greater than 0")]
    NotPositive { field: &'static str, value: f64 },
    #[error("{field} is {value}; it must not be negative")]
    Negative { field: &'static str, value: f64 },
    #[error(
        "{field} is {value}; as a hydrodynamic derivative (SNAME) it must not be positive: added mass is its negative"
    )]
    PositiveAddedMass { field: &'static str, value: f64 },
    #[error("rigid_body.i_z is {i_z} kg m^2; about CO it must exceed mass * x_g^2 = {least} kg m^2")]
    YawInertia { i_z: f64, least: f64 },
    #[error("the mass matrix of the {mode} mode is not positive definite: m22 m33 - m23^2 = {determinant}")]
    MassMatrix {
        mode: Mode,
        /// `m22 m33 - m23^2` \[kg^2 m^2\].
        determinant: f64,
    },
    #[error("{field} is [{low}, {high}]; the lower limit must be below the upper one")]
    Limits { field: &'static str, low: f64, high: f64 },
    /// A rudder angle limit beyond a quarter turn: most likely given in degrees.
    #[error("commands.rudder.limits has {limit}; with the sine law it is an angle in radians, within pi/2")]
    RudderAngle { limit: f64 },
    #[error("{field} is empty")]
    EmptyName { field: &'static str },
}

impl InvalidParams {
    /// Path of the invalid parameter; entries of a matrix or of limits count as the parameter that holds them.
    pub fn field(&self) -> Option<&'static str> {
        let path = match *self {
            Self::NotFinite { field, .. }
            | Self::NotPositive { field, .. }
            | Self::Negative { field, .. }
            | Self::PositiveAddedMass { field, .. }
            | Self::Limits { field, .. }
            | Self::EmptyName { field } => field,
            Self::YawInertia { .. } => "rigid_body.i_z",
            Self::RudderAngle { .. } => "commands.rudder.limits",
            Self::MassMatrix { .. } => return None,
        };
        path.split('[').next()
    }
}
