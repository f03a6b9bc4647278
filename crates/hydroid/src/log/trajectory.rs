//! One run of a vessel on a regular clock.

use std::borrow::Cow;
use std::sync::Arc;

/// A named quantity with its unit.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// Name of the channel.
    pub name: String,
    /// SI unit of the stored values (`m/s`, `rad/s`, `N` ...); empty if unknown.
    pub unit: String,
}

impl Channel {
    /// A channel with a name and a unit (empty for unknown).
    pub fn new(name: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { name: name.into(), unit: unit.into() }
    }

    /// Heading of its column in a CSV file: `name [unit]`, with a suffix after the name.
    pub(crate) fn heading(&self, suffix: &str) -> String {
        let Self { name, unit } = self;
        if unit.is_empty() { format!("{name}{suffix}") } else { format!("{name}{suffix} [{unit}]") }
    }
}

/// Samples of several channels: row `k` holds all channels at sample `k`. A missing value is NaN.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    channels: Arc<[Channel]>,
    values: Vec<f64>,
    /// Stated standard deviation of each channel over the log; empty if none is stated.
    deviations: Vec<Option<f64>>,
}

impl Table {
    /// A table from its channels and its values, row by row.
    ///
    /// # Panics
    /// If the number of values is not a multiple of the number of channels.
    pub fn new(channels: impl Into<Arc<[Channel]>>, values: Vec<f64>) -> Self {
        let channels = channels.into();
        assert!(
            if channels.is_empty() { values.is_empty() } else { values.len().is_multiple_of(channels.len()) },
            "values do not fill whole rows"
        );
        Self { channels, values, deviations: Vec::new() }
    }

    /// The table with the standard deviations that its log states for the channels, one for each, or none.
    #[must_use]
    pub fn with_deviations(self, deviations: Vec<Option<f64>>) -> Self {
        Self { deviations, ..self }
    }

    /// Standard deviation of the values of a channel over the log (RMS without the least certain rows), if the log states it.
    pub fn deviation(&self, channel: usize) -> Option<f64> {
        self.deviations.get(channel).copied().flatten()
    }

    /// A table from its columns, each of which is released when it is in the table.
    pub(crate) fn of_columns<'a>(
        channels: &[Channel],
        columns: impl IntoIterator<Item = Cow<'a, [f64]>>,
        rows: usize,
    ) -> Self {
        let width = channels.len();
        let mut values = vec![0.0; rows * width];
        for (c, column) in columns.into_iter().enumerate() {
            values.iter_mut().skip(c).step_by(width).zip(column.iter()).for_each(|(cell, x)| *cell = *x);
        }
        Self::new(channels.to_vec(), values)
    }

    /// The channels, in column order.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Number of channels.
    pub fn width(&self) -> usize {
        self.channels.len()
    }

    /// Number of rows (0 for a table without channels).
    pub fn len(&self) -> usize {
        self.values.len() / self.width().max(1)
    }

    /// Whether the table has no rows.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// All channels at sample `k`.
    pub fn row(&self, k: usize) -> &[f64] {
        let w = self.width();
        &self.values[k * w..(k + 1) * w]
    }

    /// Rows `from..to`, flat, row by row.
    pub fn rows(&self, from: usize, to: usize) -> &[f64] {
        let w = self.width();
        &self.values[from * w..to * w]
    }

    /// One channel over time.
    pub fn column(&self, channel: usize) -> impl ExactSizeIterator<Item = f64> + Clone + '_ {
        (0..self.len()).map(move |k| self.values[k * self.width() + channel])
    }

    /// Rows `from..to` as a table of their own.
    pub fn slice(&self, from: usize, to: usize) -> Self {
        Self {
            channels: Arc::clone(&self.channels),
            values: self.rows(from, to).to_vec(),
            deviations: self.deviations.clone(),
        }
    }
}

/// One run on a regular clock. Row `k` of `outputs` was measured at `t0 + k dt`; row `k` of `inputs` was held until row
/// `k + 1`. Missing outputs are NaN; inputs are never missing.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Name of the file, with the part of it if it was cut.
    pub name: String,
    /// Time of the first sample \[s\].
    pub t0: f64,
    /// Sample time \[s\].
    pub dt: f64,
    /// Measured outputs.
    pub outputs: Table,
    /// Commands and other known inputs.
    pub inputs: Table,
    /// True outputs, in a simulated log: same channels as `outputs`.
    pub truth: Option<Table>,
    /// Heading \[rad\] of each sample, clockwise from north; NaN where it is missing. `None` without a heading.
    pub heading: Option<Vec<f64>>,
    /// Position \[m\] of each sample in two axes, as logged: their order and directions are not known; NaN where it is missing.
    /// `None` without a position.
    pub position: Option<Vec<[f64; 2]>>,
}

impl Trajectory {
    /// Name of the log, without that of the part: `a.csv` of `a.csv (0.0 s to 12.0 s)` and of `a.csv[0..100]`.
    pub(crate) fn log(&self) -> &str {
        let mut name = &*self.name;
        while let Some((log, part)) = name.strip_suffix(']').and_then(|name| name.rsplit_once('['))
            && part.split_once("..").is_some_and(|(a, b)| [a, b].iter().all(|x| x.parse::<usize>().is_ok()))
        {
            name = log;
        }
        match name.strip_suffix(" s)").and_then(|name| name.rsplit_once(" (")) {
            Some((log, part)) if part.contains(" s to ") => log,
            _ => name,
        }
    }

    /// Leaves samples `from..to`.
    pub(super) fn keep(&mut self, from: usize, to: usize) {
        let tables = [&mut self.outputs, &mut self.inputs].into_iter().chain(&mut self.truth);
        for Table { channels, values, .. } in tables {
            values.truncate(to * channels.len());
            values.drain(..from * channels.len());
        }
        if let Some(heading) = &mut self.heading {
            heading.truncate(to);
            heading.drain(..from);
        }
        if let Some(position) = &mut self.position {
            position.truncate(to);
            position.drain(..from);
        }
        self.t0 += from as f64 * self.dt;
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.outputs.len()
    }

    /// Whether the run has no samples.
    pub fn is_empty(&self) -> bool {
        self.outputs.is_empty()
    }

    /// Duration \[s\], from the first sample to the last.
    pub fn duration_s(&self) -> f64 {
        self.len().saturating_sub(1) as f64 * self.dt
    }

    /// Heading \[rad\] at sample `k`; NaN where there is none.
    pub fn heading_at(&self, k: usize) -> f64 {
        self.heading.as_ref().map_or(f64::NAN, |heading| heading[k])
    }

    /// Samples `from..to` as a run of its own, named after the part.
    pub fn slice(&self, from: usize, to: usize) -> Self {
        self.named_slice(from, to, format!("{}[{from}..{to}]", self.name))
    }

    pub(crate) fn named_slice(&self, from: usize, to: usize, name: String) -> Self {
        Self {
            name,
            t0: self.t0 + from as f64 * self.dt,
            dt: self.dt,
            outputs: self.outputs.slice(from, to),
            inputs: self.inputs.slice(from, to),
            truth: self.truth.as_ref().map(|t| t.slice(from, to)),
            heading: self.heading.as_ref().map(|heading| heading[from..to].to_vec()),
            position: self.position.as_ref().map(|position| position[from..to].to_vec()),
        }
    }
}
