//! What came of a stream, for the end of it.

use std::fmt;

use super::answer::Status;
use hydroid::adapt::{Coverage, Times};
use hydroid_core::adapt::Outcome;

/// How many lines had which status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineCounts {
    /// Learned from with full weight.
    pub accepted: u64,
    /// Learned from with less weight.
    pub inflated: u64,
    /// Not learned from.
    pub rejected: u64,
    /// Used, with nothing to learn from yet.
    pub waiting: u64,
    /// After which the weights went back.
    pub rolled_back: u64,
    /// With which a new run began.
    pub reset: u64,
    /// Not after the last one.
    pub late: u64,
    /// Between the places of the model.
    pub between: u64,
    /// Not read.
    pub error: u64,
    /// Not answered, because an earlier session has answered them.
    pub skipped: u64,
}

impl LineCounts {
    pub(super) fn add(&mut self, status: Status) {
        let count = match status {
            Status::Used(Outcome::Waiting) => &mut self.waiting,
            Status::Used(Outcome::Accepted) => &mut self.accepted,
            Status::Used(Outcome::Inflated { .. }) => &mut self.inflated,
            Status::Used(Outcome::Rejected(_)) => &mut self.rejected,
            Status::Used(Outcome::RolledBack) => &mut self.rolled_back,
            Status::Reset => &mut self.reset,
            Status::Late => &mut self.late,
            Status::Between => &mut self.between,
            Status::Error => &mut self.error,
        };
        *count += 1;
    }
}

/// A stream at its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Lines by status.
    pub lines: LineCounts,
    /// Share of the measurements inside the bands of the step before; NaN where there was none.
    pub coverage: Coverage,
    /// From a line to its answer, written and flushed \[microseconds\].
    pub latency: Times,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines = &self.lines;
        let counts = [
            (lines.accepted, "accepted"),
            (lines.inflated, "inflated"),
            (lines.rejected, "rejected"),
            (lines.waiting, "waiting"),
            (lines.rolled_back, "rolled back"),
            (lines.reset, "reset"),
            (lines.late, "late"),
            (lines.between, "between"),
            (lines.error, "error"),
            (lines.skipped, "skipped"),
        ];
        let told: Vec<String> =
            counts.iter().filter(|(n, _)| *n > 0).map(|(n, name)| format!("{n} {name}")).collect();
        writeln!(f, "lines: {}", if told.is_empty() { "none".to_owned() } else { told.join(", ") })?;
        let percent = |share: f64| {
            if share.is_nan() { "no band".to_owned() } else { format!("{:.1} %", 100.0 * share) }
        };
        writeln!(
            f,
            "measured inside the band of one step: 80 %: {}, 95 %: {}",
            percent(self.coverage.of_80),
            percent(self.coverage.of_95)
        )?;
        let Times { median, p99, max } = self.latency;
        let us = |x: f64| if x.is_nan() { "-".to_owned() } else { format!("{x:.0}") };
        write!(
            f,
            "from line to answer: {} us (median), {} (99 of 100), {} (longest)",
            us(median),
            us(p99),
            us(max)
        )
    }
}
