//! Removal of the parts of a log in which the vessel is towed, pushed or carried.

use std::borrow::Cow;
use std::ops::Range;

use super::columns::Columns;
use super::note::Note;
use super::sanity::is_velocity;
use crate::key::key;

/// Shortest stretch that is examined \[s\].
const SHORTEST_S: f64 = 20.0;
/// Largest share of a log: if its commands are mostly zero, the vessel moves without them.
const SHARE: f64 = 0.5;
/// Time after the commands become zero in which lagging actuators may still act \[s\].
const GRACE_S: f64 = 10.0;
/// Averaging time of the outputs \[s\], against noise and waves.
const MEAN_S: f64 = 1.0;
/// Increase of an output that indicates towing, in its standard deviations under command.
const GATHERED: f64 = 1.0;

/// Removes the parts of a log in which all of the first `commands` inputs are exactly zero for 20 s or
/// longer while a velocity or yaw rate grows: a vessel without commands slows down or drifts. With `m_b` the mean of
/// the output over the `b`th second, from 10 s after the beginning of such a part, the vessel is towed if
///
/// ```text
/// max over b of (|m_b| - min over a <= b of |m_a|) > standard deviation under command
/// ```
///
/// A blank command holds the one before it. Parts longer than half of the log are kept.
pub(crate) fn cut(columns: &mut Columns, commands: usize, notes: &mut Vec<Note>) {
    let is_steered = under_command(&columns.inputs[..commands], columns.rows());
    let mut keep = vec![true; is_steered.len()];
    let mut next = 0;
    for rows in is_steered.chunk_by(|a, b| a == b) {
        let stretch = next..next + rows.len();
        next = stretch.end;
        if rows[0] {
            continue;
        }
        let Some(output) = growing_output(columns, stretch.clone(), &is_steered) else { continue };
        let (from, to) = (columns.t[stretch.start], columns.t[stretch.end - 1]);
        notes.push(
            Note::warning(format!(
                "{}: {} of the log, {:.1} s from line {} to line {}, is removed: all commands are exactly zero and `{}` grows, \
                 as if the vessel is towed, pushed or carried",
                columns.path,
                match (stretch.start, stretch.end == keep.len()) {
                    (0, _) => "the beginning",
                    (_, true) => "the end",
                    _ => "a part",
                },
                to - from,
                columns.lines.get(stretch.start),
                columns.lines.get(stretch.end - 1),
                columns.output_channels[output].name,
            ))
            .with_remedy(format!("keep it with {}", key("keep_towed"))),
        );
        keep[stretch].fill(false);
    }
    if keep.contains(&false) {
        columns.keep(&keep);
    }
}

/// Whether a command is not zero in each row.
fn under_command(commands: &[Cow<[f64]>], rows: usize) -> Vec<bool> {
    let mut held = vec![0.0; commands.len()];
    let steered = |k: usize| {
        for (held, command) in held.iter_mut().zip(commands).filter(|(_, command)| !command[k].is_nan()) {
            *held = command[k];
        }
        held.iter().any(|&command| command != 0.0)
    };
    (0..rows).map(steered).collect()
}

/// The first output that grows in a stretch of rows, relative to its standard deviation under command.
fn growing_output(columns: &Columns, stretch: Range<usize>, is_steered: &[bool]) -> Option<usize> {
    let t = &columns.t[stretch.clone()];
    let (first, last) = (*t.first()?, *t.last()?);
    if last - first < SHORTEST_S || t.len() as f64 > SHARE * columns.rows() as f64 {
        return None;
    }
    (0..columns.outputs.len()).filter(|&i| is_velocity(&columns.output_channels[i])).find(|&i| {
        let y = &columns.outputs[i];
        let allowed = GATHERED * deviation(y, is_steered);
        let measured = t.iter().zip(&y[stretch.clone()]).filter(|(_, y)| !y.is_nan());
        let mut least = f64::INFINITY;
        second_by_second(measured.map(|(t, y)| (t - first - GRACE_S, *y))).any(|mean| {
            least = least.min(mean.abs());
            // An output that is constant under command is not evidence.
            allowed > 0.0 && mean.abs() - least > allowed
        })
    })
}

/// Means over the seconds from 0 on.
fn second_by_second(values: impl Iterator<Item = (f64, f64)>) -> impl Iterator<Item = f64> {
    let mut values = values.filter(|(t, _)| *t >= 0.0).map(|(t, y)| ((t / MEAN_S).floor(), y)).peekable();
    std::iter::from_fn(move || {
        let (second, mut sum) = values.next()?;
        let mut count = 1.0;
        while let Some((_, y)) = values.next_if(|(next, _)| *next == second) {
            sum += y;
            count += 1.0;
        }
        Some(sum / count)
    })
}

fn deviation(y: &[f64], is_used: &[bool]) -> f64 {
    let measured = || y.iter().zip(is_used).filter(|(y, used)| **used && y.is_finite()).map(|(y, _)| y);
    let n = measured().count().max(1) as f64;
    let mean = measured().sum::<f64>() / n;
    (measured().map(|y| (y - mean).powi(2)).sum::<f64>() / n).sqrt()
}
