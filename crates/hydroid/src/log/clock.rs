//! Clock of a log: step, regularity, jumps.

use std::borrow::Cow;

use super::columns::Columns;
use super::error::LogError;
use super::lines::Lines;
use super::note::Note;
use super::prepare::FEWEST_SAMPLES;

/// Relative deviation of single steps that still counts as regular.
const TOLERANCE: f64 = 0.01;
/// Relative deviation from an even grid that counts as rounding of the stamps (a 30 Hz clock written in milliseconds).
const ROUNDING: f64 = 0.05;

/// A step back by more than this multiple of the usual step is a restart of the clock.
const RESTART: f64 = 3.0;

/// Mean step, relative to the usual one, above which rows arrive in bursts.
const BURST: f64 = 4.0;

/// Sampling of one log.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Clock {
    /// Sample time \[s\]: the usual step; the mean one of rows that arrive in bursts.
    pub step_s: f64,
    /// Shortest step \[s\].
    pub shortest_s: f64,
    /// Longest step \[s\], jumps included.
    pub longest_s: f64,
    /// Whether every step between jumps is a multiple of the sample time within 1 % (5 % for rounded stamps).
    pub regular: bool,
}

/// Rejects identical time stamps and decreasing time.
pub(crate) fn check_order(columns: &Columns<'_>) -> Result<(), LogError> {
    for (k, pair) in columns.t.windows(2).enumerate() {
        if pair[1] > pair[0] {
            continue;
        }
        let path = || columns.path.clone();
        let line = columns.lines.get(k + 1);
        if pair[1] == pair[0] {
            return Err(LogError::SameTime {
                path: path(),
                line,
                before: columns.lines.get(k),
                time: pair[0],
            });
        }
        if pair[1] < pair[0] {
            let remedy =
                "sort the rows by time, or put each recording into a file of its own if several were joined";
            return Err(LogError::Backwards { path: path(), line, from: pair[0], to: pair[1], remedy });
        }
    }
    Ok(())
}

/// Time after a run at which the next one begins in the table, if the clock goes back between them \[s\].
const APART_S: f64 = 3600.0;

/// Rows before which the clock restarts, as after a reboot, at the end of daylight saving time, or where sessions were joined: each
/// begins rising times.
fn restarts(t: &[f64]) -> Vec<usize> {
    let back: Vec<usize> = (1..t.len()).filter(|&k| t[k] < t[k - 1]).collect();
    let Some(step) = Clock::usual_step(t) else { return Vec::new() };
    let ends = back.iter().copied().chain([t.len()]);
    let is_run = std::iter::once(0)
        .chain(back.iter().copied())
        .zip(ends)
        .all(|(from, to)| to - from >= FEWEST_SAMPLES);
    // A misplaced row steps back alone.
    let is_back = |k: usize| t[k..].iter().take(FEWEST_SAMPLES).all(|later| *later < t[k - 1]);
    let is_far = back.iter().all(|&k| t[k - 1] - t[k] > RESTART * step && is_back(k));
    if is_run && is_far { back } else { Vec::new() }
}

/// Lets each run after a restart of the clock follow the one before after an hour, and says so.
pub(crate) fn follow_on(t: &mut Cow<[f64]>, lines: &Lines, path: &str, notes: &mut Vec<Note>) {
    let restarts = restarts(t);
    let Some(&first) = restarts.first() else { return };
    notes.push(
        Note::warning(format!(
            "{path}: the clock goes back {} before line {}, from {:.3} s to {:.3} s: what follows is a run of its own, an hour later",
            if restarts.len() == 1 { "once," } else { "several times, first" },
            lines.get(first),
            t[first - 1],
            t[first]
        ))
        .with_remedy("if the rows belong to one recording, sort them by time"),
    );
    let t = t.to_mut();
    for (i, &from) in restarts.iter().enumerate() {
        let to = restarts.get(i + 1).copied().unwrap_or(t.len());
        let shift = t[from - 1] + APART_S - t[from];
        t[from..to].iter_mut().for_each(|t| *t += shift);
    }
}

/// The median (the upper one of an even number of values).
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// A value rounded to few digits if they agree within 1e-6 relative.
pub(crate) fn round_if_close(x: f64) -> f64 {
    for digits in 0..4 {
        let rounded: f64 = format!("{x:.digits$e}").parse().unwrap_or(x);
        if (rounded - x).abs() <= 1e-6 * x.abs() {
            return rounded;
        }
    }
    x
}

impl Clock {
    /// The usual step of rising time stamps; `None` for fewer than two.
    pub(crate) fn usual_step(t: &[f64]) -> Option<f64> {
        median(t.windows(2).map(|p| p[1] - p[0]).collect())
    }

    /// Clock of increasing time stamps; steps beyond `max_gap_s` are jumps. `None` for fewer than two stamps.
    pub fn of(t: &[f64], max_gap_s: f64) -> Option<Self> {
        Some(Self::with_usual_step(t, Self::usual_step(t)?, max_gap_s))
    }

    /// As [`of`](Self::of), with the usual step.
    pub(crate) fn with_usual_step(t: &[f64], usual: f64, max_gap_s: f64) -> Self {
        let steps = || t.windows(2).map(|p| p[1] - p[0]);
        let (mut sum, mut singles) = (0.0, 0_usize);
        let mut regular = true;
        let (mut all, mut count) = (0.0, 0_usize);
        for step in steps().filter(|s| *s <= max_gap_s) {
            (all, count) = (all + step, count + 1);
            let multiple = (step / usual).round().max(1.0);
            regular &= (step - multiple * usual).abs() <= TOLERANCE * usual;
            if multiple == 1.0 {
                sum += step;
                singles += 1;
            }
        }
        // Rows that arrive in bursts have a usual step in which next to no time passes.
        if all > BURST * usual * count as f64 {
            return Self {
                step_s: round_if_close(all / count as f64),
                shortest_s: steps().fold(f64::INFINITY, f64::min),
                longest_s: steps().fold(0.0, f64::max),
                regular: false,
            };
        }
        let mean = if singles > 0 { sum / singles as f64 } else { usual };
        let mut step_s = nominal(usual, mean);
        if !regular {
            let grid = round_if_close(mean);
            regular = on_grid(t, grid, max_gap_s);
            step_s = if regular { grid } else { round_if_close(usual) };
        }
        Self {
            step_s,
            shortest_s: steps().fold(f64::INFINITY, f64::min),
            longest_s: steps().fold(0.0, f64::max),
            regular,
        }
    }
}

/// The median step if it is round and agrees with the mean, else the mean: it does not drift for rounded stamps.
fn nominal(median: f64, mean: f64) -> f64 {
    let round = round_if_close(median);
    if round != median && (mean - round).abs() <= 1e-4 * round { round } else { round_if_close(mean) }
}

fn on_grid(t: &[f64], step: f64, max_gap_s: f64) -> bool {
    let (mut start, mut index) = (t[0], 0.0);
    t.windows(2).all(|p| {
        if p[1] - p[0] > max_gap_s {
            (start, index) = (p[1], 0.0);
            return true;
        }
        index += ((p[1] - p[0]) / step).round().max(1.0);
        (p[1] - start - index * step).abs() <= ROUNDING * step
    })
}
