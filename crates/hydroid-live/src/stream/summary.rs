//! Summary of a stream.

use std::fmt;

use super::answer::Status;
use hydroid::adapt::{Coverage, Times};
use hydroid_core::adapt::Outcome;

/// Number of lines with each status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineCounts {
    /// Accepted with full weight.
    pub accepted: u64,
    /// Accepted with reduced weight.
    pub inflated: u64,
    /// Rejected by the innovation gate.
    pub rejected: u64,
    /// Used before the adapter can learn.
    pub waiting: u64,
    /// Used by a model that does not learn.
    pub used: u64,
    /// Weights restored afterwards.
    pub rolled_back: u64,
    /// First samples of new runs.
    pub reset: u64,
    /// Not after the last sample.
    pub late: u64,
    /// Between the grid points of the model.
    pub between: u64,
    /// Not readable.
    pub error: u64,
    /// Farther ahead than the longest gap, and not confirmed.
    pub ahead: u64,
    /// Answered before a restart.
    pub repeated: u64,
    /// Not lines: measurements were too old for a command while none arrived.
    pub lost: u64,
}

impl LineCounts {
    pub(super) fn add(&mut self, status: Status) {
        let count = match status {
            Status::Used(Outcome::Waiting) => &mut self.waiting,
            Status::Used(Outcome::Accepted) => &mut self.accepted,
            Status::Used(Outcome::Inflated { .. }) => &mut self.inflated,
            Status::Used(Outcome::Rejected(_)) => &mut self.rejected,
            Status::Used(Outcome::RolledBack) => &mut self.rolled_back,
            Status::Constant => &mut self.used,
            Status::Reset => &mut self.reset,
            Status::Late => &mut self.late,
            Status::Ahead => &mut self.ahead,
            Status::Repeated => &mut self.repeated,
            Status::Between => &mut self.between,
            Status::Error => &mut self.error,
            Status::Lost => &mut self.lost,
        };
        *count += 1;
    }
}

/// Summary of a stream.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Lines by status.
    pub lines: LineCounts,
    /// Share of the measurements inside the one-step bands; NaN without bands.
    pub coverage: Coverage,
    /// Time from a line to its flushed answer \[microseconds\].
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
            (lines.used, "used"),
            (lines.rolled_back, "rolled back"),
            (lines.reset, "reset"),
            (lines.late, "late"),
            (lines.between, "between"),
            (lines.error, "error"),
            (lines.ahead, "ahead"),
            (lines.repeated, "repeated"),
            (lines.lost, "lost"),
        ];
        let listed: Vec<String> =
            counts.iter().filter(|(n, _)| *n > 0).map(|(n, name)| format!("{n} {name}")).collect();
        writeln!(f, "lines: {}", if listed.is_empty() { "none".to_owned() } else { listed.join(", ") })?;
        let percent = |share: f64| {
            if share.is_nan() { "no band".to_owned() } else { format!("{:.1} %", 100.0 * share) }
        };
        writeln!(
            f,
            "measurements inside the one-step bands: 80 %: {}, 95 %: {}",
            percent(self.coverage.of_80),
            percent(self.coverage.of_95)
        )?;
        let Times { median, p99, max } = self.latency;
        let us = |x: f64| if x.is_nan() { "-".to_owned() } else { format!("{x:.0}") };
        write!(
            f,
            "from line to answer: {} us (median), {} (99th percentile), {} (maximum)",
            us(median),
            us(p99),
            us(max)
        )
    }
}
