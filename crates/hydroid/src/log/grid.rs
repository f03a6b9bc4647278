//! One part of a log without jumps on a regular clock, column by column.

use std::borrow::Cow;

use super::align::{CommandTiming, InputDelay, hold, shift};
use super::columns::Columns;
use super::error::LogError;
use super::trajectory::{Table, Trajectory};

/// Maximum number of samples of a part: a step that is far too small is an error.
pub(crate) const MOST_SAMPLES: f64 = 5e7;

/// A part of a log on a regular clock before it is cut: NaN is missing, in inputs as well.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) run: Trajectory,
    /// Blank command cells that were filled with the command before, per input.
    pub(crate) held: Vec<usize>,
    /// Rows absent from the log.
    pub(crate) absent: usize,
}

impl Part {
    /// Rows `from..to` of a log with a regular clock. Absent rows are missing measurements. Over them the command of
    /// the row before acts on, or that of the row after ([`CommandTiming::After`]). If these are all rows of the log and
    /// none is absent, the columns are released one after another.
    pub(crate) fn native<'a>(
        columns: &mut Columns<'a>,
        (from, to): (usize, usize),
        step: f64,
        timing: CommandTiming,
        delay: InputDelay,
    ) -> Result<Self, LogError> {
        let t = &columns.t[from..to];
        let steps = || t.windows(2).map(|pair| ((pair[1] - pair[0]) / step).round().max(1.0));
        let (t0, found, last) = (t[0], t.len(), steps().sum::<f64>());
        check_size(last, step, columns)?;
        let rows = 1 + truncate(last);
        // The place of each row, where rows are absent.
        let places: Option<Vec<usize>> = (rows > found).then(|| {
            let places = steps().scan(0.0, |place, step| {
                *place += step;
                Some(truncate(*place))
            });
            std::iter::once(0).chain(places).collect()
        });
        let whole = from == 0 && to == columns.rows();
        let put = |values: &mut Cow<'a, [f64]>, places: Option<&[usize]>| -> Cow<'a, [f64]> {
            let Some(places) = places else {
                return match values {
                    values if whole => std::mem::take(values),
                    Cow::Borrowed(values) => Cow::Borrowed(&values[from..to]),
                    Cow::Owned(values) => Cow::Owned(values[from..to].to_vec()),
                };
            };
            let mut placed = vec![f64::NAN; rows];
            for (place, value) in places.iter().zip(&values[from..to]) {
                placed[*place] = *value;
            }
            Cow::Owned(placed)
        };
        let mut measured = |values: &mut Cow<'a, [f64]>| put(values, places.as_deref());
        let channels = &columns.output_channels;
        let outputs = Table::of_columns(channels, columns.outputs.iter_mut().map(&mut measured), rows)
            .with_deviations(columns.deviations.clone());
        let truth = columns.truth.as_mut();
        let truth = truth.map(|all| Table::of_columns(channels, all.iter_mut().map(&mut measured), rows));
        let heading = columns.heading.as_mut().map(|heading| measured(heading).into_owned());
        let position = columns.position.as_mut().map(|axes| axes.each_mut().map(&mut measured));
        let position = position.map(|[x, y]| x.iter().zip(&*y).map(|(x, y)| [*x, *y]).collect());
        // With `After`, the command of a row acts from the row before. It is placed one sample after that row, and the
        // shift moves it there.
        let begins: Option<Vec<usize>> = places.as_ref().map(|places| match timing {
            CommandTiming::Before => places.clone(),
            CommandTiming::After => {
                std::iter::once(0).chain(places.iter().take(found - 1).map(|p| p + 1)).collect()
            }
        });
        let by = delay.samples(step).saturating_sub(i64::from(timing == CommandTiming::After));
        let mut held = Vec::new();
        let command = |values: &mut Cow<'a, [f64]>| {
            let mut input = put(values, begins.as_deref());
            let filled = if input.iter().any(|x| x.is_nan()) { hold(input.to_mut()) } else { 0 };
            held.push(match &begins {
                None => filled,
                // Absent rows are not blank cells.
                Some(begins) => {
                    let cells = values[from..to].iter().zip(begins);
                    cells.filter(|(x, place)| x.is_nan() && !input[**place].is_nan()).count()
                }
            });
            if by != 0 {
                shift(input.to_mut(), by);
            }
            input
        };
        let inputs = Table::of_columns(&columns.input_channels, columns.inputs.iter_mut().map(command), rows);
        let run = Trajectory { name: String::new(), t0, dt: step, outputs, inputs, truth, heading, position };
        Ok(Self { run, held, absent: rows - found })
    }

    /// Drops the rows without a command at both ends and returns their numbers.
    pub(crate) fn drop_without_command(&mut self) -> (usize, usize) {
        let rows = self.run.len();
        let known = |k: &usize| self.run.inputs.row(*k).iter().all(|x| !x.is_nan());
        let front = (0..rows).find(known).unwrap_or(rows);
        let end = (front..rows).rfind(known).map_or(front, |k| k + 1);
        self.run.keep(front, end);
        (front, rows - end)
    }
}

pub(crate) fn check_size(rows: f64, step: f64, columns: &Columns<'_>) -> Result<(), LogError> {
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
    fn columns(places: &[usize], inputs: Vec<f64>) -> Columns<'static> {
        Columns {
            unstated: None,
            path: String::from("log.csv"),
            t: places.iter().map(|p| *p as f64 * STEP).collect(),
            lines: (2..).take(places.len()).collect(),
            output_channels: vec![Channel::new("u", "m/s")],
            input_channels: vec![Channel::new("n", "rps")],
            outputs: vec![places.iter().map(|p| *p as f64).collect()],
            deviations: Vec::new(),
            inputs: vec![inputs.into()],
            truth: None,
            heading: None,
            position: None,
        }
    }

    fn native(columns: &Columns<'_>, timing: CommandTiming, delay: InputDelay) -> Vec<f64> {
        let rows = (0, columns.rows());
        Part::native(&mut columns.clone(), rows, STEP, timing, delay).unwrap().run.inputs.column(0).collect()
    }

    fn resampled(columns: &Columns<'_>, timing: CommandTiming, delay: InputDelay) -> Vec<f64> {
        let resampling = Resampling { dt: STEP, step: STEP, max_gap_s: 1e9, timing, delay };
        resampling.run(columns, (0, columns.rows())).unwrap().run.inputs.column(0).collect()
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
