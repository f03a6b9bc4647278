//! Summary of the data: ranges by channel and part of the split.

use serde::Serialize;

use crate::evaluate::{DesignRange, mean_finite};
use crate::log::{Channel, Split, Table, Trajectory};

/// One channel over the runs of one part of the split.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelSummary {
    /// Name and unit.
    pub channel: Channel,
    /// Whether it is an input.
    pub input: bool,
    /// By part: training, validation, test.
    pub parts: [Summary; 3],
}

/// Statistics of a channel over some runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub std: f64,
    /// Number of missing values.
    pub missing: usize,
}

/// Summary of all channels, outputs first.
pub fn data_summary(split: &Split) -> Vec<ChannelSummary> {
    let parts = [&split.train, &split.validation, &split.test];
    let Some(run) = split.train.first() else { return Vec::new() };
    let summaries = |input: bool, channels: &[Channel]| -> Vec<ChannelSummary> {
        channels
            .iter()
            .enumerate()
            .map(|(c, channel)| ChannelSummary {
                channel: channel.clone(),
                input,
                parts: parts.map(|runs| {
                    let tables: Vec<&Table> =
                        runs.iter().map(|run| if input { &run.inputs } else { &run.outputs }).collect();
                    summary(&tables, c)
                }),
            })
            .collect()
    };
    let mut all = summaries(false, run.outputs.channels());
    all.extend(summaries(true, run.inputs.channels()));
    all
}

fn summary(tables: &[&Table], channel: usize) -> Summary {
    let values = || tables.iter().flat_map(|table| table.column(channel));
    let mean = mean_finite(values()).unwrap_or(f64::NAN);
    Summary {
        min: values().fold(f64::NAN, f64::min),
        max: values().fold(f64::NAN, f64::max),
        mean,
        std: mean_finite(values().map(|v| (v - mean).powi(2))).unwrap_or(f64::NAN).sqrt(),
        missing: values().filter(|v| v.is_nan()).count(),
    }
}

/// Ranges of the outputs over runs: the design ranges of a model if none are stated.
pub fn output_ranges(runs: &[&Trajectory]) -> Vec<DesignRange> {
    let tables: Vec<&Table> = runs.iter().map(|run| &run.outputs).collect();
    of_tables(&tables)
}

pub(crate) fn input_ranges(runs: &[&Trajectory]) -> Vec<DesignRange> {
    let tables: Vec<&Table> = runs.iter().map(|run| &run.inputs).collect();
    of_tables(&tables)
}

fn of_tables(tables: &[&Table]) -> Vec<DesignRange> {
    let width = tables.first().map_or(0, |table| table.width());
    (0..width)
        .map(|c| {
            let Summary { min, max, .. } = summary(tables, c);
            // A constant channel needs a range of positive width.
            if max > min {
                DesignRange { low: min, high: max }
            } else {
                let middle = if min.is_finite() { min } else { 0.0 };
                let half = 0.5 * middle.abs().max(1.0);
                DesignRange { low: middle - half, high: middle + half }
            }
        })
        .collect()
}
