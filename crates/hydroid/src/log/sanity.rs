//! Plausibility limits: values beyond them indicate a wrong unit or a spike.

use rayon::prelude::*;

use super::columns::Columns;
use super::error::LogError;
use super::trajectory::Channel;

/// Fastest plausible velocity \[m/s\].
pub(crate) const FASTEST_M_S: f64 = 100.0;
/// Fastest plausible yaw rate of a vessel \[rad/s\].
pub(crate) const FASTEST_RAD_S: f64 = 20.0;
/// Ratio of a spike to the typical size of its channel.
const SPIKE: f64 = 1e6;
/// Values up to this size are not spikes: a channel may rest at rounding errors before it moves.
const NO_SPIKE: f64 = 1e3;

/// Rejects a log with an implausible value in a selected column.
pub(crate) fn check(columns: &Columns) -> Result<(), LogError> {
    let outputs = columns.output_channels.par_iter().zip(&columns.outputs);
    let inputs = columns.input_channels.par_iter().zip(&columns.inputs);
    let outputs = outputs.map(|(channel, values)| {
        limit(columns, channel, values)?;
        spike(columns, channel, values)
    });
    let inputs = inputs.map(|(channel, values)| spike(columns, channel, values));
    // The error of the first channel, whichever is found first.
    let checked: Vec<Result<(), LogError>> = outputs.chain(inputs).collect();
    checked.into_iter().collect()
}

/// Limits of velocities and yaw rates; `u`, `v`, `r` without a unit are in SI units.
fn limit(columns: &Columns, channel: &Channel, values: &[f64]) -> Result<(), LogError> {
    let fastest = fastest(channel).map_or(f64::INFINITY, |(limit, _)| limit);
    match values.iter().position(|x| x.abs() > fastest) {
        None => Ok(()),
        Some(k) => check_value(channel, values[k], &columns.path, columns.lines.get(k)),
    }
}

pub(crate) fn is_velocity(channel: &Channel) -> bool {
    fastest(channel).is_some()
}

/// The limit of a channel and its unit.
fn fastest(channel: &Channel) -> Option<(f64, &'static str)> {
    match (channel.name.as_str(), channel.unit.as_str()) {
        (_, "m/s") | ("u" | "v", "") => Some((FASTEST_M_S, "m/s")),
        (_, "rad/s") | ("r", "") => Some((FASTEST_RAD_S, "rad/s")),
        _ => None,
    }
}

/// Checks that a value of an output is possible for a vessel.
///
/// # Errors
/// If it is not.
pub fn check_value(channel: &Channel, value: f64, path: &str, line: u64) -> Result<(), LogError> {
    match fastest(channel) {
        Some((limit, unit)) if value.abs() > limit => Err(LogError::Absurd {
            path: path.to_owned(),
            line,
            column: channel.name.clone(),
            value: format!("{} {unit} is more than any vessel does ({limit} {unit})", short(value)),
            remedy: "if the unit is another, state it (`name [deg/s]`, `name [km/h]`); if it is a spike, blank the cell"
                .to_owned(),
        }),
        _ => Ok(()),
    }
}

/// Rejects a few values a million times larger than the median. If many, the channel mostly rests at rounding errors.
fn spike(columns: &Columns, channel: &Channel, values: &[f64]) -> Result<(), LogError> {
    let mut sizes: Vec<f64> = values.iter().map(|x| x.abs()).filter(|x| *x > 0.0).collect();
    if sizes.is_empty() {
        return Ok(());
    }
    let middle = sizes.len() / 2;
    let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
    let above = |x: &f64| x.abs() > (SPIKE * median).max(NO_SPIKE);
    let found = values.iter().filter(|x| above(x)).count();
    let allowed_as_spikes = (values.len() / 100).max(3);
    if found == 0 || found > allowed_as_spikes {
        return Ok(());
    }
    let k = values.iter().position(above).unwrap_or(0);
    Err(LogError::Absurd {
        path: columns.path.clone(),
        line: columns.lines.get(k),
        column: channel.name.clone(),
        value: format!("{} is a million times the channel's typical size ({median:.3e})", short(values[k])),
        remedy: "blank the cell if it is a spike".to_owned(),
    })
}

/// A number as text; beyond 1e16 with an exponent in place of up to 300 digits.
fn short(value: f64) -> String {
    if value.abs() < 1e16 { value.to_string() } else { format!("{value:e}") }
}
