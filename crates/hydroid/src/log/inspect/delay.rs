//! By how many samples commands act later than they are logged.
//!
//! For every delay `d` the increments of all outputs are regressed on the state and on the command `d` samples
//! before, `y_{k+1} - y_k ~ 1, y_k, y_k |y_k|, c_{k-d}, c_{k-d} |c_{k-d}|`, and the residuals compared:
//! the right delay explains most. Where the increments are noise, commands and outputs are first averaged over
//! the same few samples, which leaves the delay between them as it is. The estimate is an *effective* delay:
//! dead time and the lag of an actuator look alike here.
//!
//! Then each input is tried by itself, the others at the common delay.

use super::super::align::{CommandTiming, InputDelay};
use super::super::note::Note;
use super::super::prepare::PrepareOptions;
use super::super::trajectory::Trajectory;
use super::lags::{EARLIEST, Fixed, LATEST, Problem};

/// Commands must explain this share of what the state alone does not.
const EXPLAINED: f64 = 0.01;
/// So many rows' worth of residual the best of all delays explains by chance.
const CHANCE: f64 = 8.0;
/// Samples that noisy outputs and their commands are averaged over.
const AVERAGED: usize = 10;

/// How far an estimate can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Confidence {
    /// The commands explain next to nothing at any delay, or all delays explain the same.
    None,
    /// There is a best delay, but others are nearly as good, or it lies at the edge of what was tried.
    Low,
    /// One delay, within a sample or two, is clearly best.
    High,
}

/// The delay that explains the outputs best.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct DelayEstimate {
    /// Delay in samples of the runs; negative if the log shows commands late.
    pub samples: i64,
    /// The same in seconds.
    pub seconds: f64,
    /// Shortest and longest delay that explain nearly as much.
    pub range: (i64, i64),
    /// Share of the residual of the state alone that the command explains at this delay.
    pub explained: f64,
    /// How much smaller the residual is than without a delay, as a share.
    pub better_than_zero: f64,
    /// How far to trust it.
    pub confidence: Confidence,
}

pub(super) struct Delays {
    pub(super) common: Option<DelayEstimate>,
    pub(super) per_input: Vec<Option<DelayEstimate>>,
}

/// How the runs that were looked at were made.
pub(super) struct Applied<'a> {
    pub(super) options: &'a PrepareOptions,
    /// Step of the log \[s\], whose samples an input delay counts.
    pub(super) step_s: f64,
}

impl Applied<'_> {
    /// The input delay to give instead of the one in force, if that leaves a delay of so many samples of the
    /// runs, or of so many seconds.
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
    /// What the user should know of the common delay, beside the delays of the inputs by themselves.
    pub(super) fn note(&self, path: &str, own: &[(&str, &Self)], applied: &Applied) -> Option<Note> {
        if self.confidence == Confidence::None {
            return Some(
                Note::info(format!("{path}: the input delay cannot be told from this log"))
                    .with_remedy("record a few clear steps of each command"),
            );
        }
        if self.samples == 0 || self.better_than_zero < 0.005 {
            return None;
        }
        let told: Vec<_> = own.iter().filter(|(_, d)| d.confidence != Confidence::None).collect();
        let earliest = told.iter().map(|(_, d)| d.range.0).max();
        let latest = told.iter().map(|(_, d)| d.range.1).min();
        if earliest > latest && told.len() > 1 {
            // A delay of the logger would be the same for all.
            let list: Vec<String> =
                told.iter().map(|(name, d)| format!("{} for `{name}`", d.samples)).collect();
            return Some(
                Note::info(format!("{path}: commands seem to act later than they are logged, each by its own number of samples: {}", list.join(", ")))
                    .with_remedy(format!("this looks like the lag of actuators, not like a delay of the log: leave --input-delay at {} and let the model learn it", applied.options.input_delay)),
            );
        }
        let Self { samples, seconds, range, better_than_zero, .. } = self;
        let right = applied.with(*samples, *seconds);
        if (range.0..=range.1).contains(&0) {
            // No delay explains the log nearly as well: nothing to tell.
            return None;
        }
        let share = 100.0 * better_than_zero;
        let trusted = if self.confidence == Confidence::High { "" } else { ", with little certainty" };
        if *samples < 0 {
            let after = if applied.options.command_timing == CommandTiming::Before {
                format!(
                    "if the row holds the command that led to its measurement, --command-timing after; else --input-delay={right}"
                )
            } else {
                format!("try --input-delay={right}")
            };
            return Some(
                Note::warning(format!(
                    "{path}: commands seem to be logged {} samples after they act ({} to {}; {share:.1} % less residual{trusted})",
                    -samples, -range.1, -range.0
                ))
                .with_remedy(format!(
                    "{after}. In closed loop the command follows the measurement, and this may mislead"
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
            "try --input-delay {right} and compare on validation runs; an actuator's lag looks like a delay too"
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

/// The best of the residuals of all delays, with so many rows more than terms.
fn judge(scores: &[f64], without: f64, free: f64, dt: f64) -> Option<DelayEstimate> {
    let best = scores.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
    let zero = scores.get(usize::try_from(-EARLIEST).ok()?)?;
    let lowest = *best.1;
    if !(without > 0.0 && lowest.is_finite()) {
        return None;
    }
    let delay = |i: usize| EARLIEST + i64::try_from(i).unwrap_or(0);
    // What chance and the slow change of commands leave open: neighbours whose residual is as low.
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
