//! Timing of commands: hold and shift.
//!
//! In hydroid the command in row `k` acts on `[t_k, t_{k+1})`. In a log the row may hold the command that acted until
//! its measurement ([`CommandTiming::After`]), or commands are logged earlier or later than they act (input delay).

use std::fmt;
use std::str::FromStr;

use super::error::LogError;

/// The interval on which the command in a row acts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
#[cfg_attr(feature = "arguments", derive(clap::ValueEnum))]
pub enum CommandTiming {
    /// Row k holds the command that acts from row k to k+1
    #[default]
    Before,
    /// Row k holds the command that acted from row k-1 to k
    After,
}

/// Input delay `d`: the command logged at row `k - d` acts at row `k`. Negative if commands are logged after they act.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "Written", into = "String")]
pub enum InputDelay {
    /// In samples of the log.
    Samples(i64),
    /// In seconds; rounded to samples where the clock is regular.
    Seconds(f64),
}

impl Default for InputDelay {
    fn default() -> Self {
        Self::Samples(0)
    }
}

impl fmt::Display for InputDelay {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Samples(n) => write!(f, "{n}"),
            Self::Seconds(s) => write!(f, "{s}s"),
        }
    }
}

impl FromStr for InputDelay {
    type Err = LogError;

    /// `3` is samples, `0.3s` is seconds.
    fn from_str(text: &str) -> Result<Self, LogError> {
        let text = text.trim();
        let bad = |reason: &str| LogError::BadOption {
            what: "an input delay",
            value: text.to_owned(),
            reason: reason.to_owned(),
        };
        let delay = match text.strip_suffix('s') {
            Some(seconds) => seconds.trim().parse().ok().map(Self::Seconds),
            None => text.parse().ok().map(Self::Samples),
        };
        let delay = delay.ok_or_else(|| bad("write a number of samples (3) or seconds (0.3s)"))?;
        delay.check()?;
        Ok(delay)
    }
}

/// Form in a file: a number of samples, or a text.
#[derive(serde::Deserialize)]
#[serde(untagged, expecting = "a number of samples (3) or a time (\"0.3s\")")]
enum Written {
    Samples(i64),
    Text(String),
}

impl TryFrom<Written> for InputDelay {
    type Error = LogError;

    fn try_from(written: Written) -> Result<Self, LogError> {
        match written {
            Written::Samples(n) => Self::Samples(n).check().map(|()| Self::Samples(n)),
            Written::Text(text) => text.parse(),
        }
    }
}

impl From<InputDelay> for String {
    fn from(delay: InputDelay) -> Self {
        delay.to_string()
    }
}

impl InputDelay {
    /// Checks that the delay is a number and not beyond any log.
    ///
    /// # Errors
    /// If it is not.
    pub fn check(self) -> Result<(), LogError> {
        let sane = match self {
            Self::Samples(n) => n.unsigned_abs() < 1_000_000_000,
            Self::Seconds(s) => s.abs() < 1e9,
        };
        let reason = || "it is longer than any log, or no number".to_owned();
        if sane {
            Ok(())
        } else {
            Err(LogError::BadOption { what: "an input delay", value: self.to_string(), reason: reason() })
        }
    }

    /// The delay in seconds for a log with this step \[s\], before any resampling.
    pub fn seconds_at(self, step: f64) -> f64 {
        match self {
            Self::Samples(n) => n as f64 * step,
            Self::Seconds(s) => s,
        }
    }

    /// The delay in whole samples on a clock with this step.
    #[allow(clippy::cast_possible_truncation, reason = "delays are checked to be short, and casts saturate")]
    pub fn samples(self, step: f64) -> i64 {
        match self {
            Self::Samples(n) => n,
            Self::Seconds(s) => (s / step).round() as i64,
        }
    }
}

/// Fills missing commands with the previous value; leading ones stay missing. Returns the number of filled cells.
pub(crate) fn hold(values: &mut [f64]) -> usize {
    let mut last = f64::NAN;
    let mut filled = 0;
    for x in values {
        if x.is_nan() {
            *x = last;
            filled += usize::from(!last.is_nan());
        } else {
            last = *x;
        }
    }
    filled
}

/// Moves commands `shift` rows down (up if negative); rows without a command are missing.
pub(crate) fn shift(values: &mut [f64], shift: i64) {
    let rows = values.len();
    let by = usize::try_from(shift.unsigned_abs()).unwrap_or(rows).min(rows);
    if shift >= 0 {
        values.copy_within(..rows - by, by);
        values[..by].fill(f64::NAN);
    } else {
        values.copy_within(by.., 0);
        values[rows - by..].fill(f64::NAN);
    }
}
