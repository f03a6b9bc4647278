//! One part of a log without jumps on a regular clock, column by column.

use super::align::{CommandTiming, InputDelay, hold, shift};
use super::columns::Columns;
use super::error::LogError;

/// Maximum number of samples of a part: a step that is far too small is an error.
pub(crate) const MOST_SAMPLES: f64 = 5e7;

/// Samples on a regular clock; NaN is missing, in inputs as well.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub(crate) t0: f64,
    pub(crate) dt: f64,
    pub(crate) rows: usize,
    pub(crate) outputs: Vec<Vec<f64>>,
    pub(crate) inputs: Vec<Vec<f64>>,
    pub(crate) truth: Option<Vec<Vec<f64>>>,
    pub(crate) heading: Option<Vec<f64>>,
    /// Blank command cells that were filled with the command before, per input.
    pub(crate) held: Vec<usize>,
    /// Rows absent from the log.
    pub(crate) absent: usize,
}

impl Grid {
    /// Rows `from..to` of a log with a regular clock. Absent rows are missing measurements. Over them the command of
    /// the row before acts on, or that of the row after ([`CommandTiming::After`]).
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
            places.push(truncate(place));
        }
        let rows = places.last().map_or(0, |p| p + 1);
        let put = |values: &Vec<f64>, places: &[usize]| {
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
        let measured = |values: &Vec<f64>| put(values, &places);
        // With `After`, the command of a row acts from the row before. It is placed one sample after that row, and the
        // shift moves it there.
        let begins: Vec<usize> = match timing {
            CommandTiming::Before => places.clone(),
            CommandTiming::After => {
                std::iter::once(0).chain(places.iter().take(t.len() - 1).map(|p| p + 1)).collect()
            }
        };
        let mut inputs: Vec<Vec<f64>> = columns.inputs.iter().map(|values| put(values, &begins)).collect();
        let by = delay.samples(step).saturating_sub(i64::from(timing == CommandTiming::After));
        let mut held = Vec::with_capacity(inputs.len());
        for (values, raw) in inputs.iter_mut().zip(&columns.inputs) {
            hold(values);
            held.push(
                raw[from..to]
                    .iter()
                    .zip(&begins)
                    .filter(|(x, p)| x.is_nan() && !values[**p].is_nan())
                    .count(),
            );
            shift(values, by);
        }
        Ok(Self {
            t0: t[0],
            dt: step,
            rows,
            outputs: columns.outputs.iter().map(measured).collect(),
            inputs,
            truth: columns.truth.as_ref().map(|t| t.iter().map(measured).collect()),
            heading: columns.heading.as_ref().map(measured),
            held,
            absent: rows - t.len(),
        })
    }

    /// Drops the rows without a command at both ends and returns their numbers.
    pub(crate) fn drop_without_command(&mut self) -> (usize, usize) {
        let known = |k: &usize| self.inputs.iter().all(|values| !values[*k].is_nan());
        let front = (0..self.rows).find(known).unwrap_or(self.rows);
        let back = self.rows - (front..self.rows).rfind(known).map_or(front, |k| k + 1);
        let end = self.rows - back;
        let measured =
            self.outputs.iter_mut().chain(self.truth.iter_mut().flatten()).chain(&mut self.heading);
        for values in measured.chain(&mut self.inputs) {
            values.truncate(end);
            values.drain(..front);
        }
        self.t0 += front as f64 * self.dt;
        self.rows = end - front;
        (front, back)
    }
}

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

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "checked by the callers; casts saturate"
)]
pub(crate) fn truncate(x: f64) -> usize {
    x as usize
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::resample::Resampling;
    use super::super::trajectory::Channel;
    use super::*;

    const STEP: f64 = 0.1;

    /// A log with rows at these places of a regular clock; every row has its own command.
    fn columns(places: &[usize], inputs: Vec<f64>) -> Columns {
        Columns {
            unstated: None,
            path: String::from("log.csv"),
            t: places.iter().map(|p| *p as f64 * STEP).collect(),
            lines: (2..).take(places.len()).collect(),
            output_channels: vec![Channel::new("u", "m/s")],
            input_channels: vec![Channel::new("n", "rps")],
            outputs: vec![places.iter().map(|p| *p as f64).collect()],
            inputs: vec![inputs],
            truth: None,
            heading: None,
        }
    }

    fn native(columns: &Columns, timing: CommandTiming, delay: InputDelay) -> Vec<f64> {
        Grid::native(columns, (0, columns.rows()), STEP, timing, delay).unwrap().inputs.remove(0)
    }

    fn resampled(columns: &Columns, timing: CommandTiming, delay: InputDelay) -> Vec<f64> {
        let resampling = Resampling { dt: STEP, step: STEP, max_gap_s: 1e9, timing, delay };
        resampling.run(columns, (0, columns.rows())).unwrap().inputs.remove(0)
    }

    /// The values, with -1 for missing ones.
    fn plain(values: &[f64]) -> Vec<f64> {
        values.iter().map(|x| if x.is_nan() { -1.0 } else { *x }).collect()
    }

    #[test]
    fn a_command_that_acted_until_its_row_fills_the_gap_before_it() {
        let places = [0, 1, 2, 3, 4, 8, 9, 10, 11];
        let columns = columns(&places, vec![0.0, 1.0, 2.0, 3.0, 4.0, 100.0, 9.0, 10.0, 11.0]);
        let after = native(&columns, CommandTiming::After, InputDelay::default());
        assert_eq!(plain(&after), [1.0, 2.0, 3.0, 4.0, 100.0, 100.0, 100.0, 100.0, 9.0, 10.0, 11.0, -1.0]);
        let before = native(&columns, CommandTiming::Before, InputDelay::default());
        assert_eq!(plain(&before), [0.0, 1.0, 2.0, 3.0, 4.0, 4.0, 4.0, 4.0, 100.0, 9.0, 10.0, 11.0]);
    }

    #[test]
    fn a_blank_command_after_a_gap_holds_the_one_before_the_gap() {
        let columns = columns(&[0, 1, 5, 6], vec![0.0, 1.0, f64::NAN, 6.0]);
        let after = native(&columns, CommandTiming::After, InputDelay::default());
        assert_eq!(plain(&after), [1.0, 1.0, 1.0, 1.0, 1.0, 6.0, -1.0]);
    }

    proptest! {
        #[test]
        fn commands_of_a_log_with_gaps_are_those_of_the_log_resampled_to_its_own_step(
            rows in prop::collection::vec((1..5_usize, prop::option::weighted(0.8, 0..100_i32)), 2..40),
            after in any::<bool>(),
            delay in -6..7_i64,
        ) {
            let places: Vec<usize> = rows.iter().scan(0, |at, (step, _)| { *at += step; Some(*at) }).collect();
            let commands = rows.iter().map(|(_, c)| c.map_or(f64::NAN, f64::from)).collect();
            let columns = columns(&places, commands);
            let timing = if after { CommandTiming::After } else { CommandTiming::Before };
            let delay = InputDelay::Samples(delay);
            prop_assert_eq!(
                plain(&native(&columns, timing, delay)),
                plain(&resampled(&columns, timing, delay))
            );
        }
    }
}
