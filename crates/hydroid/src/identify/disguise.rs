//! Inputs that are outputs in disguise: a scaled, delayed, noisy or rounded copy of an output, of its rate of change or of its
//! integral.
//!
//! Two series are compared at each lag by their squared correlation, the share of the input that a straight line explains. If the
//! input is explained best by *later* outputs, it drives them, however the command was chosen: an autopilot that follows the
//! heading error and the yaw rate moves its rudder before the ship turns. If present or past outputs explain it at least as well,
//! and beyond [`MIN_SHARE`], it contains what the model shall predict. Which series precedes the other is the question of Geweke,
//! Measurement of linear dependence and feedback between multiple time series, J. Am. Stat. Assoc. 77 (1982) 304. His measure, the
//! increments of predictability in both directions, does not decide here: a present command adds little where later ones matter,
//! and a second sensor adds information because its noise is another one.
//!
//! *Valid* for a linear relation to one output within lags of a fifth of the horizon, and for inputs of more than one frequency:
//! one sinusoid is a copy of every response to it. A purely proportional controller with a
//! constant set-point is a copy by this test as well, because its log is: the effect of such a command cannot be separated from
//! that of the output.

use std::ops::RangeInclusive;

use super::IdentifyError;
use super::expressions::channel_index;
use crate::log::{Table, Trajectory};

/// Share of an input that an output must explain. True commands stay below it where the input does not lead, and copies with
/// noise of a fifth of their spread are above it.
const MIN_SHARE: f64 = 0.95;

/// Largest number of pairs of a correlation.
const MOST_PAIRS: usize = 20_000;

/// Largest delay of a copy of a rate of change or of an integral [samples]. With longer ones, a command that varies like a
/// sinusoid would be a copy of its response.
const NEAR: isize = 2;

/// Fewest windows of the increments that are compared with integrals.
const WINDOWS: usize = 8;

/// Refuses inputs that are outputs in disguise, except those in `allowed`.
pub(super) fn check(runs: &[Trajectory], horizon: usize, allowed: &[String]) -> Result<(), IdentifyError> {
    let Some(first) = runs.first() else { return Ok(()) };
    let (inputs, outputs) = (first.inputs.channels(), first.outputs.channels());
    for name in allowed {
        channel_index("allow feedback", "input", name, inputs)?;
    }
    let samples: usize = runs.iter().map(Trajectory::len).sum();
    let window = horizon.min(samples / WINDOWS).max(1);
    let lags = (horizon / 5).min(samples / 50).clamp(1, 1000).cast_signed();
    for (i, input) in inputs.iter().enumerate().filter(|(_, input)| !allowed.contains(&input.name)) {
        let commands = columns(runs, |run| &run.inputs, i);
        let unwrapped = unwrap(&commands);
        for (o, output) in outputs.iter().enumerate() {
            let y = columns(runs, |run| &run.outputs, o);
            let forward = each(&y, |y, k| Some(y.get(k + 1)? - y[k]));
            let central = each(&y, |y, k| Some(y.get(k + 1)? - y.get(k.checked_sub(1)?)?));
            let rise = |of: &[Vec<f64>]| each(of, |x, k| Some(x.get(k + window)? - x[k]));
            let forms = [
                ("", largest(&commands, &y, lags, 0..=lags)),
                ("the rate of change of ", {
                    // A forward difference is the effect of the command of its own interval.
                    let (follows, leads) = largest(&commands, &forward, lags, 1..=NEAR);
                    let middle = (explained(&commands, &central, 0), 0);
                    (if middle.0 > follows.0 { middle } else { follows }, leads)
                }),
                ("the integral of ", largest(&rise(&unwrapped), &rise(&integrals(&y)), lags, 0..=NEAR)),
            ];
            for (form, ((share, lag), leads)) in forms {
                if share >= MIN_SHARE && share >= leads {
                    return Err(IdentifyError::Disguise {
                        input: input.name.clone(),
                        form,
                        output: output.name.clone(),
                        percent: 100.0 * share,
                        delay_s: lag as f64 * first.dt,
                        leads_percent: 100.0 * leads,
                    });
                }
            }
        }
    }
    Ok(())
}

fn columns(runs: &[Trajectory], table: fn(&Trajectory) -> &Table, c: usize) -> Vec<Vec<f64>> {
    runs.iter().map(|run| table(run).column(c).collect()).collect()
}

/// A series of each run from another one; NaN where there is no value.
fn each(series: &[Vec<f64>], value: impl Fn(&[f64], usize) -> Option<f64>) -> Vec<Vec<f64>> {
    series.iter().map(|x| (0..x.len()).map(|k| value(x, k).unwrap_or(f64::NAN)).collect()).collect()
}

/// Integrals over the samples by the trapezoidal rule; missing values add nothing.
fn integrals(series: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let of = |y: &Vec<f64>| {
        let steps =
            y.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).map(|s| if s.is_nan() { 0.0 } else { s });
        let sums = steps.scan(0.0, |sum, step| {
            *sum += step;
            Some(*sum)
        });
        std::iter::once(0.0).chain(sums).collect()
    };
    series.iter().map(of).collect()
}

/// A series that covers a full circle, in radians or degrees, without jumps.
fn unwrap(series: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let values = || series.iter().flatten().copied();
    let range = values().fold(f64::NAN, f64::max) - values().fold(f64::NAN, f64::min);
    let circles = [std::f64::consts::TAU, 360.0];
    let Some(circle) = circles.into_iter().find(|c| (0.5 * c..=1.01 * c).contains(&range)) else {
        return series.to_vec();
    };
    let of = |x: &Vec<f64>| {
        let mut turns = 0.0;
        let mut last = f64::NAN;
        let value = |&x: &f64| {
            let turn = ((x - last) / circle).round();
            turns -= if turn.is_finite() { turn } else { 0.0 };
            last = if x.is_nan() { last } else { x };
            x + turns * circle
        };
        x.iter().map(value).collect()
    };
    series.iter().map(of).collect()
}

/// Largest share that values explain which are older than the input by one of these numbers of samples, with that number, and
/// the largest share by younger ones.
fn largest(
    input: &[Vec<f64>],
    by: &[Vec<f64>],
    lags: isize,
    older: RangeInclusive<isize>,
) -> ((f64, isize), f64) {
    let best = |range: RangeInclusive<isize>| {
        let shares = range.map(|lag| (explained(input, by, lag), lag));
        shares.fold((0.0, 0), |best, next| if next.0 > best.0 { next } else { best })
    };
    let from = *older.start();
    (best(older), best(-lags..=from - 1).0)
}

/// Squared correlation of a series with the values of another one `lag` samples before.
fn explained(input: &[Vec<f64>], by: &[Vec<f64>], lag: isize) -> f64 {
    let step = (input.iter().map(Vec::len).sum::<usize>() / MOST_PAIRS).max(1);
    let pairs = || {
        input.iter().zip(by).flat_map(|(x, y)| {
            let pair = |k: usize| Some((x[k], *y.get(k.checked_add_signed(-lag)?)?));
            (0..x.len()).step_by(step).filter_map(pair).filter(|(x, y)| x.is_finite() && y.is_finite())
        })
    };
    let (n, x, y) = pairs().fold((0.0, 0.0, 0.0), |(n, sx, sy), (x, y)| (n + 1.0, sx + x, sy + y));
    let (x, y) = (x / n, y / n);
    let (xx, xy, yy) = pairs().fold((0.0, 0.0, 0.0), |(xx, xy, yy), (a, b)| {
        (xx + (a - x).powi(2), xy + (a - x) * (b - y), yy + (b - y).powi(2))
    });
    // Sums of rounding errors are not a spread.
    let is_spread = |squares: f64, mean: f64| squares > 1e-20 * n * mean * mean;
    if n > 2.0 && is_spread(xx, x) && is_spread(yy, y) { xy * xy / (xx * yy) } else { 0.0 }
}
