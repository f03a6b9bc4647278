//! Durations and horizons, as numbers or as text with a unit.

use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A duration \[s\]: `90`, `90s`, `5m`, `1.5h`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Duration(pub f64);

impl FromStr for Duration {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let (number, unit) = match text.find(|c: char| c.is_ascii_alphabetic()) {
            // The exponent of 1e3 is not a unit.
            Some(at) if !text[at..].starts_with(['e', 'E']) => text.split_at(at),
            _ => (text, "s"),
        };
        let factor = match unit.trim() {
            "s" | "sec" => Some(1.0),
            "m" | "min" => Some(60.0),
            "h" => Some(3600.0),
            _ => None,
        };
        let seconds = factor.and_then(|factor| Some(factor * number.trim().parse::<f64>().ok()?));
        match seconds.filter(|s| s.is_finite() && *s > 0.0) {
            Some(seconds) => Ok(Self(seconds)),
            None => Err(format!(
                "'{text}' is not a duration: write seconds (90, 90s), minutes (5m) or hours (1h)"
            )),
        }
    }
}

/// A horizon in samples or in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Horizon {
    /// Samples.
    Samples(usize),
    /// Seconds.
    Seconds(f64),
}

impl Horizon {
    /// The horizon in samples of `dt` seconds, rounded.
    pub fn samples(self, dt: f64) -> usize {
        match self {
            Self::Samples(n) => n,
            // Positive by parsing; large values saturate and are refused as too long for the log.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            Self::Seconds(s) => (s / dt).round() as usize,
        }
    }
}

impl FromStr for Horizon {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let bad = || format!("'{text}' is neither a number of samples (100) nor of seconds (10s)");
        match text.strip_suffix('s') {
            Some(seconds) => {
                let seconds: f64 = seconds.trim().parse().map_err(|_| bad())?;
                if seconds.is_finite() && seconds > 0.0 { Ok(Self::Seconds(seconds)) } else { Err(bad()) }
            }
            None => text.parse().map(Self::Samples).map_err(|_| bad()),
        }
    }
}

impl Serialize for Horizon {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Samples(n) => n.serialize(serializer),
            Self::Seconds(s) => serializer.collect_str(&format_args!("{s}s")),
        }
    }
}

impl<'de> Deserialize<'de> for Horizon {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged, expecting = "a number of samples (100) or a time (\"10s\")")]
        enum Written {
            Samples(usize),
            Text(String),
        }
        match Written::deserialize(deserializer)? {
            Written::Samples(n) => Ok(Self::Samples(n)),
            Written::Text(text) => text.parse().map_err(serde::de::Error::custom),
        }
    }
}

impl<'de> Deserialize<'de> for Duration {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged, expecting = "a number of seconds (90) or a time (\"5m\")")]
        enum Written {
            Seconds(f64),
            Text(String),
        }
        match Written::deserialize(deserializer)? {
            Written::Seconds(seconds) => seconds.to_string().parse().map_err(serde::de::Error::custom),
            Written::Text(text) => text.parse().map_err(serde::de::Error::custom),
        }
    }
}
