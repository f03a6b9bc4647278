//! Estimate of the input delay: the time between the logging and the effect of a command.
//!
//! For every delay `d` the increments of all outputs are regressed on the state and the delayed command,
//! `y_{k+1} - y_k ~ 1, y_k, y_k |y_k|, c_{k-d}, c_{k-d} |c_{k-d}|`. The estimate is the delay with the smallest
//! residual. If the increments are mostly noise, commands and outputs are first averaged over the same
//! number of samples, which does not change the delay between them. The estimate is an *effective* delay: the
//! regression does not distinguish dead time from actuator lag.
//!
//! A second regression varies the delay of each input separately, with the others at the common delay.

use super::super::align::{CommandTiming, InputDelay};
use super::super::note::Note;
use super::super::prepare::PrepareOptions;
use super::super::trajectory::Trajectory;
use super::lags::{EARLIEST, Fixed, LATEST, Problem};
use crate::key::key;

/// Smallest share of the residual without commands that the commands must explain.
const EXPLAINED: f64 = 0.01;
/// Reduction of the residual by chance at the best of all delays, in rows.
const CHANCE: f64 = 8.0;
/// Averaging window of noisy outputs and their commands \[samples\].
const AVERAGED: usize = 10;

/// Confidence of an estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Confidence {
    /// The commands explain almost none of the residual at any delay, or all delays explain equally much.
    None,
    /// The best delay is at the edge of the searched range, or other delays are nearly as good.
    Low,
    /// The best delay is unique within one or two samples.
    High,
}

/// Estimated delay of the commands.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct DelayEstimate {
    /// Delay in samples of the runs; negative if commands are logged after they act.
    pub samples: i64,
    /// Delay \[s\].
    pub seconds: f64,
    /// Shortest and longest delay with nearly the same residual.
    pub range: (i64, i64),
    /// Share of the residual without commands that the commands explain at this delay.
    pub explained: f64,
    /// Relative reduction of the residual from zero delay to this delay.
    pub better_than_zero: f64,
    /// Confidence of the estimate.
    pub confidence: Confidence,
}

pub(super) struct Delays {
    pub(super) common: Option<DelayEstimate>,
    pub(super) per_input: Vec<Option<DelayEstimate>>,
}

pub(super) struct Applied<'a> {
    pub(super) options: &'a PrepareOptions,
    /// Step of the log \[s\], the unit of an input delay in samples.
    pub(super) step_s: f64,
}

impl Applied<'_> {
    /// The input delay of the options, corrected by the remaining delay in samples of the runs or in seconds.
    fn with(&self, samples: i64, seconds: f64) -> InputDelay {
        let same_step = self.options.dt.is_none_or(|dt| (dt - self.step_s).abs() <= 1e-3 * dt);
        match self.options.input_delay {
            InputDelay::Samples(n) if same_step => InputDelay::Samples(n.saturating_add(samples)),
            delay => {
                let total = delay.seconds_at(self.step_s) + seconds;
                InputDelay::Seconds((total * 1e3).round() / 1e3)
            }
        }
    }
}

impl DelayEstimate {
    /// Note on the common delay, given the separate delays of the inputs.
    pub(super) fn note(&self, path: &str, own: &[(&str, &Self)], applied: &Applied) -> Option<Note> {
        if self.confidence == Confidence::None {
            return Some(
                Note::info(format!("{path}: the input delay cannot be estimated from this log"))
                    .with_remedy("record several steps of each command"),
            );
        }
        if self.samples == 0 || self.better_than_zero < 0.005 {
            return None;
        }
        let estimates: Vec<_> = own.iter().filter(|(_, d)| d.confidence != Confidence::None).collect();
        let earliest = estimates.iter().map(|(_, d)| d.range.0).max();
        let latest = estimates.iter().map(|(_, d)| d.range.1).min();
        if earliest > latest && estimates.len() > 1 {
            // A delay of the logger is the same for all inputs.
            let list: Vec<String> =
                estimates.iter().map(|(name, d)| format!("{} for `{name}`", d.samples)).collect();
            return Some(
                Note::info(format!("{path}: commands seem to act after they are logged, with a different delay in samples for each input: {}", list.join(", ")))
                    .with_remedy(format!(
                        "the cause is probably actuator lag and not a delay of the log: keep {}, the model identifies the lag",
                        key("input_delay").is(applied.options.input_delay)
                    )),
            );
        }
        let Self { samples, seconds, range, better_than_zero, .. } = self;
        let right = key("input_delay").is(applied.with(*samples, *seconds));
        if (range.0..=range.1).contains(&0) {
            return None;
        }
        let share = 100.0 * better_than_zero;
        let trusted = if self.confidence == Confidence::High { "" } else { ", low confidence" };
        if *samples < 0 {
            let after = if applied.options.command_timing == CommandTiming::Before {
                format!(
                    "if the row holds the command that led to its measurement, {}; else {right}",
                    key("command_timing").is("after")
                )
            } else {
                format!("try {right}")
            };
            return Some(
                Note::warning(format!(
                    "{path}: commands seem to be logged {} samples after they act ({} to {}; {share:.1} % less residual{trusted})",
                    -samples, -range.1, -range.0
                ))
                .with_remedy(format!(
                    "{after}. The estimate may be wrong for a log in closed loop, where the command follows the measurement"
                )),
            );
        }
        let message = format!(
            "{path}: commands seem to act {samples} samples ({seconds:.2} s) after they are logged ({} to {}; {share:.1} % less residual{trusted})",
            range.0, range.1
        );
        let note =
            if self.confidence == Confidence::High { Note::warning(message) } else { Note::info(message) };
        Some(note.with_remedy(format!(
            "try {right} and compare on validation runs; actuator lag has a similar effect"
        )))
    }
}

/// Estimates the delay of all inputs together, and of each with the others at the common delay.
pub(super) fn estimate(runs: &[Trajectory], noisy: bool) -> Delays {
    let Some(first) = runs.first() else { return Delays { common: None, per_input: Vec::new() } };
    let inputs = first.inputs.width();
    let none = || Delays { common: None, per_input: vec![None; inputs] };
    let Some(problem) = Problem::new(runs, if noisy { AVERAGED } else { 1 }) else { return none() };
    let scores: Vec<f64> = (EARLIEST..=LATEST).map(|d| problem.residual(&vec![Some(d); inputs])).collect();
    let alone = problem.residual(&vec![None; inputs]);
    let common = judge(&scores, alone, problem.free(), first.dt);
    if inputs == 1 {
        return Delays { per_input: vec![common.clone()], common };
    }
    let at = common.as_ref().filter(|d| d.confidence != Confidence::None).map_or(0, |d| d.samples);
    let fixed = Fixed::new(&problem, at);
    let per_input = (0..inputs)
        .map(|input| {
            let (scores, without) = fixed.scan(&problem, input);
            judge(&scores, without, problem.free(), first.dt)
        })
        .collect();
    Delays { common, per_input }
}

/// Estimate from the residuals of all delays; `rows` is the number of rows minus the number of terms.
fn judge(scores: &[f64], without: f64, free: f64, dt: f64) -> Option<DelayEstimate> {
    let best = scores.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
    let zero = scores.get(usize::try_from(-EARLIEST).ok()?)?;
    let lowest = *best.1;
    if !(without > 0.0 && lowest.is_finite()) {
        return None;
    }
    let delay = |i: usize| EARLIEST + i64::try_from(i).unwrap_or(0);
    // Neighbouring delays with a residual that does not differ significantly.
    let open = lowest + (0.1 * (without - lowest)).max(CHANCE * lowest / free);
    let near = |i: &usize| scores[*i] <= open;
    let from = (0..=best.0).rev().take_while(near).last().unwrap_or(best.0);
    let to = (best.0..scores.len()).take_while(near).last().unwrap_or(best.0);
    let explained = 1.0 - lowest / without;
    let at_edge = best.0 == 0 || best.0 + 1 == scores.len();
    let confidence = if explained < EXPLAINED.max(CHANCE / free) || (from == 0 && to + 1 == scores.len()) {
        Confidence::None
    } else if at_edge || to - from > 6 {
        Confidence::Low
    } else {
        Confidence::High
    };
    Some(DelayEstimate {
        samples: delay(best.0),
        seconds: delay(best.0) as f64 * dt,
        range: (delay(from), delay(to)),
        explained,
        better_than_zero: if *zero > 0.0 { 1.0 - lowest / zero } else { 0.0 },
        confidence,
    })
}
