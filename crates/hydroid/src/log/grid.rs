//! One uninterrupted part of a log on a regular clock, column by column.

use super::align::{CommandTiming, InputDelay, hold, shift};
use super::columns::Columns;
use super::error::LogError;

/// Most samples that a part may have: a step far too small for a log is an error, not a crash.
pub(crate) const MOST_SAMPLES: f64 = 5e7;

/// Samples on a regular clock; NaN is missing, in inputs too.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub(crate) t0: f64,
    pub(crate) dt: f64,
    pub(crate) rows: usize,
    pub(crate) outputs: Vec<Vec<f64>>,
    pub(crate) inputs: Vec<Vec<f64>>,
    pub(crate) truth: Option<Vec<Vec<f64>>>,
    /// Blank command cells that were filled with the command before, per input.
    pub(crate) held: Vec<usize>,
    /// Rows that the log leaves out.
    pub(crate) absent: usize,
}

impl Grid {
    /// Rows `from..to` of a log with a regular clock, each at its place; rows that the log leaves out are
    /// missing measurements, commands hold across them.
    pub(crate) fn native(
        columns: &Columns,
        (from, to): (usize, usize),
        step: f64,
        timing: CommandTiming,
        delay: InputDelay,
    ) -> Result<Self, LogError> {
        let t = &columns.t[from..to];
        let mut places = Vec::with_capacity(t.len());
        let mut place = 0.0;
        places.push(0);
        for pair in t.windows(2) {
            place += ((pair[1] - pair[0]) / step).round().max(1.0);
            check_size(place, step, columns)?;
            places.push(whole(place));
        }
        let rows = places.last().map_or(0, |p| p + 1);
        let put = |values: &Vec<f64>| {
            let values = &values[from..to];
            if rows == values.len() {
                return values.to_vec();
            }
            let mut placed = vec![f64::NAN; rows];
            for (place, value) in places.iter().zip(values) {
                placed[*place] = *value;
            }
            placed
        };
        let mut inputs: Vec<Vec<f64>> = columns.inputs.iter().map(put).collect();
        let by = delay.samples(step).saturating_sub(i64::from(timing == CommandTiming::After));
        let mut held = Vec::with_capacity(inputs.len());
        for (values, raw) in inputs.iter_mut().zip(&columns.inputs) {
            hold(values);
            held.push(
                raw[from..to]
                    .iter()
                    .zip(&places)
                    .filter(|(x, p)| x.is_nan() && !values[**p].is_nan())
                    .count(),
            );
            shift(values, by);
        }
        Ok(Self {
            t0: t[0],
            dt: step,
            rows,
            outputs: columns.outputs.iter().map(put).collect(),
            inputs,
            truth: columns.truth.as_ref().map(|t| t.iter().map(put).collect()),
            held,
            absent: rows - t.len(),
        })
    }

    /// Drops the rows without a command at both ends; gives how many at the front and at the back.
    pub(crate) fn drop_without_command(&mut self) -> (usize, usize) {
        let known = |k: &usize| self.inputs.iter().all(|values| !values[*k].is_nan());
        let front = (0..self.rows).find(known).unwrap_or(self.rows);
        let back = self.rows - (front..self.rows).rfind(known).map_or(front, |k| k + 1);
        let end = self.rows - back;
        for values in self.outputs.iter_mut().chain(&mut self.inputs).chain(self.truth.iter_mut().flatten()) {
            values.truncate(end);
            values.drain(..front);
        }
        self.t0 += front as f64 * self.dt;
        self.rows = end - front;
        (front, back)
    }
}

/// Refuses a grid of absurd length.
pub(crate) fn check_size(rows: f64, step: f64, columns: &Columns) -> Result<(), LogError> {
    if rows < MOST_SAMPLES {
        return Ok(());
    }
    Err(LogError::BadOption {
        what: "a step",
        value: format!("{step} s"),
        reason: format!(
            "{} would have {rows:.0} samples; give a longer step, or a shorter gap limit",
            columns.path
        ),
    })
}

/// A count that was computed in floating point and is known to be small and not negative.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "checked by the callers; casts saturate"
)]
pub(crate) fn whole(x: f64) -> usize {
    x as usize
}
