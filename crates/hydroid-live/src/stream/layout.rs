//! Assignment of the columns of a stream, from the CSV header or from the keys of the first JSON object.

use hydroid::log::line::{Resolved, Source, Time, locate, unknown};
use hydroid::log::line::{delimiter, header_columns, name_the_nameless};
use hydroid::log::{ChannelSpec, LogError, Note, RawColumn, RawLog, Table, Trajectory};
use hydroid::model::{Model, Reading};

use super::StreamError;

#[derive(Clone, Debug)]
pub(super) enum Format {
    Csv {
        delimiter: u8,
        /// Number of cells up to the last named column.
        needed: usize,
        most: usize,
    },
    Json {
        /// Keys of the columns, with units.
        keys: Vec<String>,
    },
}

#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) name: String,
    pub(super) format: Format,
    pub(super) names: Vec<String>,
    pub(super) columns: Resolved,
}

impl Layout {
    pub(super) fn new(
        line: &str,
        name: &str,
        model: &Model,
        reading: &Reading,
        notes: &mut Vec<Note>,
    ) -> Result<Self, StreamError> {
        let line = line.strip_prefix('\u{feff}').unwrap_or(line);
        let (format, log) = if line.trim_start().starts_with('{') {
            object(line, name, reading, notes)?
        } else {
            csv(line, name)?
        };
        let selection = &reading.selection;
        let mut columns = Resolved::new(&log, selection, reading.options.dt, notes)?;
        let (outputs, inputs) = (columns.output_channels(), columns.input_channels());
        // The model checks an empty run with the channels of the stream.
        model.check(&[Trajectory {
            name: name.to_owned(),
            t0: 0.0,
            // A time column decides the sample time; another stated one is an error.
            dt: reading.options.dt.unwrap_or(model.description.dt),
            outputs: Table::new(outputs, Vec::new()),
            inputs: Table::new(inputs, Vec::new()),
            truth: None,
            heading: None,
        }])?;
        if model.description.current.is_none() {
            columns.heading = None;
        } else if columns.heading.is_none() {
            let reason = "the estimate of the current needs a heading, and no column looks like one: name it, as in --heading 'yaw [deg]'";
            return Err(
                LogError::BadLine { path: name.to_owned(), line: 1, reason: reason.to_owned() }.into()
            );
        }
        let names = log.columns.into_iter().map(|column| column.name).collect();
        Ok(Self { name: name.to_owned(), format, names, columns })
    }

    pub(super) fn time_is_unstated(&self) -> bool {
        matches!(&self.columns.time, Time::Column { stated: false, .. })
    }

    /// Columns of the inputs without the wind.
    pub(super) fn commands(&self) -> &[Source] {
        &self.columns.inputs
    }
}

fn csv(line: &str, name: &str) -> Result<(Format, RawLog), LogError> {
    let delimiter = delimiter(line.as_bytes());
    let cells: Vec<String> =
        super::line::cells(line, delimiter).iter().map(|cell| cell.trim().to_owned()).collect();
    let mut columns = header_columns(&cells, name)?;
    name_the_nameless(&mut columns);
    let needed = cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |p| p + 1);
    let format = Format::Csv { delimiter, needed, most: cells.len() };
    Ok((format, RawLog { path: name.to_owned(), columns, lines: Vec::new() }))
}

/// The keys of the first object are the columns: all commands, at least one output; other outputs may follow later.
fn object(
    line: &str,
    name: &str,
    reading: &Reading,
    notes: &mut Vec<Note>,
) -> Result<(Format, RawLog), LogError> {
    let mut keys = super::line::keys(line, name)?;
    let mut columns = header_columns(&keys, name)?;
    name_the_nameless(&mut columns);
    let mut log = RawLog { path: name.to_owned(), columns, lines: Vec::new() };
    let selection = &reading.selection;
    let wind = selection.wind.iter().flat_map(|wind| [&wind.speed, &wind.direction]);
    let outputs: Vec<&ChannelSpec> = selection.outputs.iter().collect();
    let commands: Vec<&ChannelSpec> = selection.inputs.iter().chain(wind).collect();
    let heading: Vec<&ChannelSpec> = selection.heading.iter().collect();
    for (specs, least) in [(outputs, 1), (heading, 0), (commands.clone(), commands.len())] {
        let absent: Vec<&ChannelSpec> =
            specs.iter().copied().filter(|spec| locate(&log, spec).is_none()).collect();
        if let Some(first) = absent.first().filter(|_| specs.len() < absent.len() + least) {
            return Err(unknown(&log, &first.column));
        }
        for spec in absent {
            notes.push(Note::warning(format!(
                "{name}: the first line has no `{}`: it counts as missing until a line contains it",
                spec.column
            )));
            keys.push(spec.column.clone());
            log.columns.push(RawColumn {
                name: spec.column.clone(),
                unit: None,
                values: Vec::new(),
                bad: None,
                bad_cells: 0,
                stamps: None,
            });
        }
    }
    Ok((Format::Json { keys }, log))
}
