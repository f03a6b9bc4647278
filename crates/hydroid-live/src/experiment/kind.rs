//! Kinds of experiment and their names.

use std::fmt;
use std::str::FromStr;

/// Kind of an experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Kind {
    /// Zigzag trials to both sides at two speeds; the steering is reversed at this change of heading \[deg\].
    Zigzag(f64),
    /// Turning circles of 540 degrees to both sides at two speeds and two steering levels.
    Circle,
    /// Frequency sweeps of pushing, of steering, and of both.
    Chirp,
    /// Pseudo-random binary sequences of pushing and steering, with holds at several time scales.
    Prbs,
    /// Steps of pushing from rest to full, stops, and astern where the inputs permit it.
    Acceleration,
    /// Acceleration, zigzags at two speeds, then steps to the least explored levels until the data suffice.
    Auto,
}

/// Largest change of heading of a zigzag \[deg\].
const LARGEST_DEG: f64 = 90.0;
/// The names, for an error message.
const CHOICES: &str =
    "zigzag-20, zigzag-10 (or another angle from 1 to 90 degrees), circle, chirp, prbs, acceleration, auto";

impl Kind {
    pub(super) fn check(self) -> Result<(), String> {
        match self {
            Self::Zigzag(degrees) if !(1.0..=LARGEST_DEG).contains(&degrees) => {
                Err(format!("a zigzag of {degrees} degrees: choose an angle from 1 to {LARGEST_DEG} degrees"))
            }
            _ => Ok(()),
        }
    }
}

impl FromStr for Kind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let name = text.trim();
        let kind = match name {
            "circle" => Self::Circle,
            "chirp" => Self::Chirp,
            "prbs" => Self::Prbs,
            "acceleration" => Self::Acceleration,
            "auto" => Self::Auto,
            _ => name
                .strip_prefix("zigzag-")
                .and_then(|angle| angle.parse().ok())
                .map(Self::Zigzag)
                .ok_or_else(|| format!("there is no experiment `{name}`; the choices are {CHOICES}"))?,
        };
        kind.check()?;
        Ok(kind)
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Zigzag(degrees) => write!(f, "zigzag-{degrees}"),
            Self::Circle => f.write_str("circle"),
            Self::Chirp => f.write_str("chirp"),
            Self::Prbs => f.write_str("prbs"),
            Self::Acceleration => f.write_str("acceleration"),
            Self::Auto => f.write_str("auto"),
        }
    }
}
