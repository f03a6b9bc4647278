//! Resampling of a log to another clock.
//!
//! **Outputs** are interpolated linearly between the nearest values before and after an instant, if these are no
//! farther apart than the gap limit. A mean over the new step would contain later measurements, so that the model would
//! receive part of the future that it predicts. The cost is aliasing of oscillations faster than half the new rate.
//! Interpolation uses measurements up to one step of the log ahead, which is negligible if the new step is several
//! times longer. If it is shorter, errors at horizons within the step of the log are too small; the preparation gives a
//! warning.
//!
//! **Commands** take the last value before the instant. If the new step is at least 1.5 times that of the log, they are
//! the mean of the held command over the new interval.
//!
//! Angles (unit rad) are interpolated along the shorter arc.

use std::borrow::Cow;
use std::f64::consts::TAU;

use super::align::{CommandTiming, InputDelay};
use super::columns::Columns;
use super::error::LogError;
use super::grid::{Part, check_size, truncate};
use super::trajectory::{Table, Trajectory};

/// Tolerance, in new steps, within which a stamp coincides with an instant.
const AT: f64 = 1e-6;
/// Ratio of new to old step from which on commands are averaged.
const COARSER: f64 = 1.5;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Resampling {
    /// New step \[s\].
    pub(crate) dt: f64,
    /// Usual step of the log \[s\].
    pub(crate) step: f64,
    /// Farthest distance of two values that are interpolated between \[s\].
    pub(crate) max_gap_s: f64,
    pub(crate) timing: CommandTiming,
    pub(crate) delay: InputDelay,
}

impl Resampling {
    /// Rows `from..to` of a log on the new clock, beginning at the first of them.
    pub(crate) fn run(&self, columns: &Columns<'_>, (from, to): (usize, usize)) -> Result<Part, LogError> {
        let t = &columns.t[from..to];
        let (t0, last) = (t[0], t[t.len() - 1]);
        let span = (last - t0) / self.dt + AT;
        check_size(span, self.dt, columns)?;
        let rows = truncate(span) + 1;
        let instants = || (0..rows).map(|k| t0 + k as f64 * self.dt);
        let outputs = &columns.output_channels;
        let measured = |channels: &[Cow<[f64]>]| {
            let values = channels.iter().zip(outputs).map(|(values, channel)| {
                let angle = channel.unit == "rad";
                Cow::Owned(self.interpolate(t, &values[from..to], instants(), angle))
            });
            Table::of_columns(outputs, values, rows)
        };
        let stamps = self.command_times(t);
        let mut held = Vec::new();
        let inputs = columns.inputs.iter().map(|values| {
            let values = &values[from..to];
            let first = values.iter().position(|x| !x.is_nan()).unwrap_or(values.len());
            held.push(values[first..].iter().filter(|x| x.is_nan()).count());
            Cow::Owned(self.command(&stamps, values, last, instants()))
        });
        let inputs = Table::of_columns(&columns.input_channels, inputs, rows);
        let heading = columns.heading.as_ref();
        let position = columns.position.as_ref().map(|axes| {
            let [x, y] = axes.each_ref().map(|axis| self.interpolate(t, &axis[from..to], instants(), false));
            let mut position: Vec<[f64; 2]> = x.into_iter().zip(y).map(|(x, y)| [x, y]).collect();
            // There are no more positions than in the log: between two of them, an interpolated one is no measurement.
            let mut measured = vec![false; rows];
            let mut before = [f64::NAN; 2];
            for (t, (x, y)) in t.iter().zip(axes[0][from..to].iter().zip(&axes[1][from..to])) {
                let nearest = ((t - t0) / self.dt).round();
                if [*x, *y] != before && !x.is_nan() && !y.is_nan() && nearest >= 0.0 {
                    measured.get_mut(truncate(nearest)).into_iter().for_each(|at| *at = true);
                    before = [*x, *y];
                }
            }
            position
                .iter_mut()
                .zip(measured)
                .filter(|(_, known)| !known)
                .for_each(|(at, _)| *at = [f64::NAN; 2]);
            position
        });
        let run = Trajectory {
            name: String::new(),
            t0,
            dt: self.dt,
            outputs: measured(&columns.outputs).with_deviations(columns.deviations.clone()),
            inputs,
            truth: columns.truth.as_ref().map(|truth| measured(truth)),
            heading: heading.map(|heading| self.interpolate(t, &heading[from..to], instants(), true)),
            position,
        };
        Ok(Part { run, held, absent: 0 })
    }

    /// Time from which each command of the log acts.
    fn command_times(&self, t: &[f64]) -> Vec<f64> {
        let delay = self.delay.seconds_at(self.step);
        match self.timing {
            CommandTiming::Before => t.iter().map(|t| t + delay).collect(),
            CommandTiming::After => std::iter::once(t[0] - self.step)
                .chain(t[..t.len() - 1].iter().copied())
                .map(|t| t + delay)
                .collect(),
        }
    }

    fn interpolate(
        &self,
        t: &[f64],
        values: &[f64],
        instants: impl Iterator<Item = f64>,
        angle: bool,
    ) -> Vec<f64> {
        let valid: Vec<(f64, f64)> =
            t.iter().copied().zip(values.iter().copied()).filter(|(_, x)| !x.is_nan()).collect();
        let mut next = 0;
        instants
            .map(|g| {
                while next < valid.len() && valid[next].0 <= g + AT * self.dt {
                    next += 1;
                }
                let Some((ta, a)) = next.checked_sub(1).map(|i| valid[i]) else {
                    return f64::NAN;
                };
                if (g - ta).abs() <= AT * self.dt {
                    return a;
                }
                match valid.get(next) {
                    Some(&(tb, b)) if tb - ta <= self.max_gap_s * (1.0 + 1e-9) => {
                        let mut difference = b - a;
                        if angle {
                            difference -= TAU * (difference / TAU).round();
                        }
                        let w = (g - ta) / (tb - ta);
                        // Interpolated from the nearer value, so that an angle keeps its multiple of 2 pi.
                        if w < 0.5 { a + difference * w } else { b - difference * (1.0 - w) }
                    }
                    _ => f64::NAN,
                }
            })
            .collect()
    }

    fn command(
        &self,
        stamps: &[f64],
        values: &[f64],
        last: f64,
        instants: impl Iterator<Item = f64>,
    ) -> Vec<f64> {
        let events: Vec<(f64, f64)> =
            stamps.iter().copied().zip(values.iter().copied()).filter(|(_, x)| !x.is_nan()).collect();
        // After the interval of the last row the command is unknown.
        let lag = if self.timing == CommandTiming::After { 0.0 } else { self.step };
        let end = last + lag + self.delay.seconds_at(self.step);
        let average = self.dt >= COARSER * self.step;
        let mut next = 0;
        instants
            .map(|g| {
                while next < events.len() && events[next].0 <= g + AT * self.dt {
                    next += 1;
                }
                if next == 0 || g >= end - AT * self.dt {
                    return f64::NAN;
                }
                let held = events[next - 1].1;
                if average { mean(&events[next..], held, g, (g + self.dt).min(end)) } else { held }
            })
            .collect()
    }
}

/// Mean over `from..to` of a command that is `held` at `from` and changes at the later events.
pub(crate) fn mean(events: &[(f64, f64)], held: f64, from: f64, to: f64) -> f64 {
    // Deviations from the first value are summed, so that the mean of a constant command is exact.
    let (mut sum, mut value, mut since) = (0.0, held, from);
    for &(time, x) in events.iter().take_while(|e| e.0 < to) {
        sum += (value - held) * (time - since);
        (value, since) = (x, time);
    }
    sum += (value - held) * (to - since);
    held + sum / (to - from)
}
