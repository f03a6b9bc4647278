//! Metrics of a run.

use std::collections::BTreeMap;

use hydroid_core::actuator::Limits;
use hydroid_core::control::Status;
use serde::Serialize;

use super::run::{Run, Sample};

/// Computing time of a command \[us\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Times {
    /// Median.
    pub median: f64,
    /// Maximum.
    pub max: f64,
}

/// Metrics of a run. Errors are those of the controlled point over the samples from `from_s`. They are infinite if
/// there are no such samples or the state became non-finite, so that a failed run ranks last in each metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// RMS distance from the reference \[m\].
    pub rms_position: f64,
    /// RMS cross-track error \[m\].
    pub rms_cross_track: f64,
    /// RMS difference of speed over ground and reference speed \[m/s\].
    pub rms_speed: f64,
    /// Largest cross-track error \[m\].
    pub max_cross_track: f64,
    /// Time after which the distance from the reference stays within the tolerance \[s\]; `None` if it does not.
    pub settled_after: Option<f64>,
    /// Share of the samples with a command at its limit.
    pub saturated: f64,
    /// Computing time of a command, adaptation included.
    pub us_per_command: Times,
    /// Number of samples with each status that occurred.
    pub status: BTreeMap<&'static str, usize>,
    /// Start of the evaluation \[s\].
    pub from_s: f64,
    /// Duration of the run \[s\].
    pub duration_s: f64,
    /// Whether the end of the path was reached; `None` for a closed path.
    pub arrived: Option<bool>,
    /// Whether the true state became non-finite.
    pub diverged: bool,
    /// Commands that were not finite or violated a limit or rate limit. Zero for a correct controller.
    pub violations: usize,
    /// Samples beyond the tolerance without status `lost` or worse. Zero for a correct controller.
    pub undetected_losses: usize,
    /// Whether the run settled before `from_s`, has samples after it, and reached the end of an open path.
    pub held: bool,
}

impl Metrics {
    /// Metrics of the samples from `from_s` on.
    pub fn of(run: &Run, from_s: f64) -> Self {
        let all = &run.samples;
        let counted = || all.iter().filter(|m| m.t >= from_s - 1e-9);
        let rms = |of: fn(&Sample) -> f64| {
            let (sum, n) = counted().fold((0.0, 0.0), |(sum, n), m| (sum + of(m).powi(2), n + 1.0));
            or_worst(run, (sum / n).sqrt())
        };
        let most = counted().map(|m| or_worst(run, m.cross_track.abs())).reduce(f64::max);
        // NaN counts as beyond the tolerance.
        let beyond = |m: &Sample| m.distance.is_nan() || m.distance > run.tolerance;
        let settled_after = match all.iter().rposition(beyond) {
            None => all.first().map(|m| m.t),
            Some(last) => all.get(last + 1).map(|m| m.t),
        }
        .filter(|_| !run.diverged);
        let mut status = BTreeMap::new();
        for sample in all {
            *status.entry(sample.status.name()).or_insert(0) += 1;
        }
        let at_limit = |k: &usize| {
            let inside =
                |(c, limits): (&f64, &Limits)| limits.are_held() || limits.low < *c && *c < limits.high;
            !run.command(*k).iter().zip(&run.limits).all(inside)
        };
        let held = settled_after.is_some_and(|settled| settled <= from_s + 1e-9)
            && counted().next().is_some()
            && run.arrived != Some(false);
        let last = all.last().map_or(0.0, |m| m.t + run.dt_s);
        Self {
            rms_position: rms(|m| m.distance),
            rms_cross_track: rms(|m| m.cross_track),
            rms_speed: rms(|m| m.speed_error),
            max_cross_track: most.unwrap_or(f64::INFINITY),
            settled_after,
            saturated: (0..all.len()).filter(at_limit).count() as f64 / (all.len() as f64).max(1.0),
            us_per_command: times(all),
            status,
            from_s,
            duration_s: last,
            arrived: run.arrived,
            diverged: run.diverged,
            violations: violations(run),
            undetected_losses: all.iter().filter(|m| beyond(m) && m.status < Status::Lost).count(),
            held,
        }
    }
}

/// Replaces NaN and the metrics of a diverged run by infinity: the sign of a NaN, and its rank, depend on the machine.
const fn or_worst(run: &Run, figure: f64) -> f64 {
    if run.diverged || figure.is_nan() { f64::INFINITY } else { figure }
}

fn times(all: &[Sample]) -> Times {
    let mut times: Vec<f64> = all.iter().map(|m| m.time_us).collect();
    times.sort_unstable_by(f64::total_cmp);
    let at = |index: usize| times.get(index).copied().unwrap_or(0.0);
    Times { median: at(times.len() / 2), max: at(times.len().saturating_sub(1)) }
}

/// Commands outside of limits or rate limits; the commands before the first sample are at rest.
fn violations(run: &Run) -> usize {
    let mut last: Vec<f64> = run.limits.iter().map(|limits| limits.rest).collect();
    let mut count = 0;
    for k in 0..run.samples.len() {
        for ((command, last), limits) in run.command(k).iter().zip(&mut last).zip(&run.limits) {
            let inside = (limits.low..=limits.high).contains(command);
            // Tolerance for rounding.
            let allowed = limits.rate * run.dt_s * (1.0 + 1e-9);
            if !(inside && (*command - *last).abs() <= allowed) {
                count += 1;
            }
            *last = *command;
        }
    }
    count
}
