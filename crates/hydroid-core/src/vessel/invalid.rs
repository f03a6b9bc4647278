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
pub enum InvalidParams {
    /// Not a finite number.
    #[error("{field} is {value}; a finite number is needed")]
    NotFinite {
        /// Path of the parameter.
        field: &'static str,
        /// The invalid value.
        value: f64,
    },
    /// Must be greater than zero.
    #[error("{field} is {value}; it must be greater than 0")]
    NotPositive {
        /// Path of the parameter.
        field: &'static str,
        /// The invalid value.
        value: f64,
    },
    /// Must not be less than zero.
    #[error("{field} is {value}; it must not be negative")]
    Negative {
        /// Path of the parameter.
        field: &'static str,
        /// The invalid value.
        value: f64,
    },
    /// An added-mass derivative is greater than zero, which is a negative added mass.
    #[error(
        "{field} is {value}; as a hydrodynamic derivative (SNAME) it must not be positive: added mass is its negative"
    )]
    PositiveAddedMass {
        /// Path of the parameter.
        field: &'static str,
        /// The invalid value.
        value: f64,
    },
    /// The yaw inertia about CO is not greater than `m x_g^2`.
    #[error("rigid_body.i_z is {i_z} kg m^2; about CO it must exceed mass * x_g^2 = {least} kg m^2")]
    YawInertia {
        /// `i_z` \[kg m^2\].
        i_z: f64,
        /// `m x_g^2` \[kg m^2\].
        least: f64,
    },
    /// The mass matrix is singular or not positive definite.
    #[error("the mass matrix of the {mode} mode is not positive definite: m22 m33 - m23^2 = {determinant}")]
    MassMatrix {
        /// Mode of the mass matrix.
        mode: Mode,
        /// `m22 m33 - m23^2` \[kg^2 m^2\].
        determinant: f64,
    },
    /// The lower limit of a command is not below the upper one.
    #[error("{field} is [{low}, {high}]; the lower limit must be below the upper one")]
    Limits {
        /// Path of the parameter.
        field: &'static str,
        /// Lower limit.
        low: f64,
        /// Upper limit.
        high: f64,
    },
    /// A rudder angle limit beyond a quarter turn: most likely given in degrees.
    #[error("commands.rudder.limits has {limit}; with the sine law it is an angle in radians, within pi/2")]
    RudderAngle {
        /// The limit.
        limit: f64,
    },
    /// A command without a name.
    #[error("{field} is empty")]
    EmptyName {
        /// Path of the parameter.
        field: &'static str,
    },
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
