//! Reasons why a craft is invalid.

use alloc::string::String;
use core::fmt;

use super::MAX_SERVOS;

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

/// The invalid part of a [`Craft`](super::Craft). Numbers are named by their path in the vessel file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum InvalidCraft {
    /// A number is not finite, or out of its range.
    #[error("{path} is {value}; {needed}")]
    Number { path: String, value: f64, needed: &'static str },
    #[error("{path} is at ({}, {}) m, outside the hull, which extends {} m fore and aft and {} m to each side of its middle: correct position, hull.length or hull.beam", .position[0], .position[1], .half[0], .half[1])]
    Outside { path: String, position: [f64; 2], half: [f64; 2] },
    #[error("{what} needs hull.length, hull.beam and hull.draught [m]: add the table [hull]")]
    NoSize { what: &'static str },
    #[error("rigid_body.i_z is {i_z} kg m^2; about the origin it must exceed mass * x_g^2 = {least} kg m^2")]
    YawInertia { i_z: f64, least: f64 },
    #[error(
        "the mass matrix of the {mode} mode is not positive definite: m22 m33 - m23^2 = {determinant}; check added_mass.y_rdot"
    )]
    MassMatrix {
        mode: Mode,
        /// `m22 m33 - m23^2` \[kg^2 m^2\].
        determinant: f64,
    },
    #[error(
        "{path} has the limits [{low}, {high}] and the neutral value {neutral}; the lower limit must be below the upper one, and the neutral value between them"
    )]
    Limits { path: String, low: f64, high: f64, neutral: f64 },
    /// A limit of an angle beyond half a turn: most likely given in degrees.
    #[error(
        "{path} reaches {angle} rad, more than half a turn: state the unit of the command as deg, or correct the gain"
    )]
    Degrees { path: String, angle: f64 },
    #[error(fmt = invalid_name)]
    Name { kind: &'static str, name: String },
    #[error("the vessel has no {what}: add at least one")]
    Nothing { what: &'static str },
    #[error("the command '{name}' moves no actuator: name it in the order of one, or leave it out")]
    Unused { name: String },
    #[error("the vessel has {given} moving parts; at most {MAX_SERVOS} are possible")]
    Servos { given: usize },
    #[error("rudder '{rudder}' is in the race of thruster '{thruster}', which has no diameter: add it")]
    NoDiameter { thruster: String, rudder: String },
}

fn invalid_name(kind: &str, name: &str, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    if name.is_empty() {
        write!(f, "a {kind} has an empty name")
    } else {
        write!(f, "two {kind}s have the name '{name}': rename one")
    }
}

impl InvalidCraft {
    /// Path of the invalid part in the vessel file, if it has one.
    pub fn path(&self) -> Option<&str> {
        match self {
            Self::Number { path, .. }
            | Self::Outside { path, .. }
            | Self::Limits { path, .. }
            | Self::Degrees { path, .. } => Some(path),
            Self::YawInertia { .. } => Some("rigid_body.i_z"),
            _ => None,
        }
    }
}
