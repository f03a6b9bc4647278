//! Gap limit of the measurements, and the cuts where it is exceeded.

use std::borrow::Cow;

use super::clock::median;
use super::columns::Columns;
use super::note::Note;
use super::trajectory::{Table, Trajectory};
use crate::key::key;

/// Default gap limit in samples.
const SAMPLES: f64 = 10.0;
/// Smallest default gap limit \[s\].
const SECONDS: f64 = 1.0;

/// Default gap limit: the longer of 1 s and 10 sample times of the slowest output. Adds notes on slow outputs.
pub(crate) fn default_limit(columns: &Columns, step: f64, dt: Option<f64>, notes: &mut Vec<Note>) -> f64 {
    let slow: Vec<(usize, f64, usize)> = columns
        .outputs
        .iter()
        .enumerate()
        .filter_map(|(i, values)| {
            let known = values.iter().filter(|x| !x.is_nan()).count();
            // Half of the rows, or one more if the first and the last row have a value.
            if 2 * known > values.len() + 1 {
                return None;
            }
            let times: Vec<f64> =
                values.iter().zip(columns.t.iter()).filter(|(x, _)| !x.is_nan()).map(|(_, t)| *t).collect();
            // A sensor that fails during the log is not slow: the median ignores the gap.
            let own = median(times.windows(2).map(|p| p[1] - p[0]).collect()).unwrap_or(step);
            (own >= 1.5 * step).then_some((i, own, times.len()))
        })
        .collect();
    let spacing = slow.iter().map(|(_, own, _)| *own).fold(step, f64::max);
    let resampled = dt.is_some_and(|dt| dt >= 0.99 * spacing);
    let path = &columns.path;
    let remedy = |step: f64| {
        format!("{} puts all channels on the clock of the slowest", key("dt").is(format_args!("{step:.3}")))
    };
    if !resampled {
        for (i, own, values) in &slow {
            notes.push(
                Note::info(format!(
                    "{path}: `{}` has values in {values} of {} rows, about every {own:.3} s",
                    columns.output_channels[*i].name,
                    columns.rows(),
                ))
                .with_remedy(remedy(spacing)),
            );
        }
    }
    // Mean spacing of sensors that measure in bursts, for which no spacing is usual.
    let apart = if slow.is_empty() { mean_spacing(columns).max(step) } else { spacing };
    if never_together(&columns.outputs) && dt.is_none_or(|dt| dt < 0.99 * apart) {
        notes.push(
            Note::warning(format!(
                "{path}: no two outputs ever have a value in the same row, so that no row holds the state of the vessel"
            ))
            .with_remedy(remedy(apart)),
        );
    }
    SECONDS.max(SAMPLES * spacing)
}

/// Whether there are several outputs and no row has values of two of them.
fn never_together(outputs: &[Cow<[f64]>]) -> bool {
    let rows = outputs.first().map_or(0, |values| values.len());
    outputs.len() > 1 && (0..rows).all(|k| outputs.iter().filter(|values| !values[k].is_nan()).count() < 2)
}

/// Mean time between the values of the output with the fewest \[s\].
fn mean_spacing(columns: &Columns) -> f64 {
    let fewest = columns.outputs.iter().map(|v| v.iter().filter(|x| !x.is_nan()).count()).min();
    let (Some(first), Some(last)) = (columns.t.first(), columns.t.last()) else { return 0.0 };
    (last - first) / fewest.unwrap_or(1).max(1) as f64
}

/// Usable parts `from..to` of rows on a regular clock, without the rows between successive values of an output that are
/// farther apart than the limit. Each part starts at the latest first value of all outputs and ends at the earliest
/// last.
pub(crate) fn usable(run: &Trajectory, max_gap_s: f64) -> Vec<(usize, usize)> {
    let (outputs, rows, dt) = (&run.outputs, run.len(), run.dt);
    let mut cut = vec![false; rows];
    for c in 0..outputs.width() {
        let mut last: Option<usize> = None;
        for k in outputs.column(c).enumerate().filter(|(_, x)| !x.is_nan()).map(|(k, _)| k) {
            if let Some(last) = last
                && (k - last) as f64 * dt > max_gap_s * (1.0 + 1e-9)
            {
                cut[last + 1..k].fill(true);
            }
            last = Some(k);
        }
    }
    let mut parts = Vec::new();
    let mut k = 0;
    while k < rows {
        let end = (k..rows).find(|&i| cut[i]).unwrap_or(rows);
        if let Some(part) = trim(outputs, k, end) {
            parts.push(part);
        }
        k = (end..rows).find(|&i| !cut[i]).unwrap_or(rows);
    }
    parts
}

/// The part of `from..to` in which every output has begun and none has ended.
fn trim(outputs: &Table, from: usize, to: usize) -> Option<(usize, usize)> {
    let (mut first, mut last) = (from, to);
    for c in 0..outputs.width() {
        let has = |k: &usize| !outputs.row(*k)[c].is_nan();
        first = first.max((from..to).find(has)?);
        last = last.min((from..to).rfind(has)? + 1);
    }
    (first < last).then_some((first, last))
}
