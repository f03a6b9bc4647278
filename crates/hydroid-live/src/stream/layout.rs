//! Assignment of the columns of a stream, from the CSV header or from the keys of the first JSON object.

use hydroid::key::key;
use hydroid::log::line::{Resolved, Source, Time, locate, unknown};
use hydroid::log::line::{delimiter, header_columns, name_the_nameless};
use hydroid::log::{ChannelSpec, LogError, Note, RawColumn, RawLog, Selection, Table, Trajectory};
use hydroid::model::{Model, Port, Reading};

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

/// How the pose of a steered vessel is read.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Position {
    /// Origin of the track as latitude and longitude \[deg\]; `None` for a track in metres.
    pub origin_deg: Option<[f64; 2]>,
}

/// Columns of the pose: north and east, or latitude and longitude, and heading.
#[derive(Clone, Debug)]
pub(super) struct PoseColumns {
    pub(super) sources: [Source; 3],
    /// Origin, if the position is a latitude and a longitude \[deg\].
    pub(super) origin_deg: Option<[f64; 2]>,
}

const METRES: [[&str; 2]; 3] = [["x", "y"], ["north", "east"], ["northing", "easting"]];
const DEGREES: [[&str; 2]; 2] = [["lat", "lon"], ["latitude", "longitude"]];
const HEADING: [&str; 4] = ["psi", "heading", "yaw", "hdg"];

impl PoseColumns {
    fn find(log: &RawLog, reading: &Reading, position: &Position) -> Result<Self, LogError> {
        let bad = |reason: String| LogError::BadLine { path: log.path.clone(), line: 1, reason };
        let pairs = |pairs: &[[&str; 2]]| {
            let mut specs = pairs.iter().map(|pair| pair.map(ChannelSpec::named));
            specs.find(|pair| pair.iter().all(|spec| locate(log, spec).is_some()))
        };
        let origin_deg = position.origin_deg;
        let found = if origin_deg.is_some() { pairs(&DEGREES) } else { pairs(&METRES) };
        let columns: Vec<&str> = log.columns.iter().map(|column| column.name.as_str()).collect();
        let Some([x, y]) = found else {
            let needed = if origin_deg.is_some() {
                "lat [deg] and lon [deg]"
            } else {
                "x [m] (north) and y [m] (east)"
            };
            return Err(bad(format!(
                "no columns of the position among {}: for this track, name them {needed}",
                columns.join(", ")
            )));
        };
        let named = HEADING.map(ChannelSpec::named);
        let mut heading = reading.selection.heading.iter().chain(&named);
        let Some(heading) = heading.find(|spec| locate(log, spec).is_some()).cloned() else {
            return Err(bad(format!(
                "no column of the heading among {}: name it psi [rad] or heading [deg]",
                columns.join(", ")
            )));
        };
        let selection = Selection {
            outputs: vec![x, y, heading],
            wind: None,
            heading: None,
            ..reading.selection.clone()
        };
        let resolved = Resolved::new(log, &selection, reading.options.dt, &mut Vec::new())?;
        let sources = <[Source; 3]>::try_from(resolved.outputs)
            .map_err(|_| bad("the pose needs three columns".to_owned()))?;
        Ok(Self { sources, origin_deg })
    }
}

/// The reading of a steered stream: all channels by name, and the heading by the column that the first line has.
fn by_name(line: &str, name: &str, reading: &Reading, model: &Model) -> Result<Reading, StreamError> {
    let mut reading = reading.clone();
    let log = if line.trim_start().starts_with('{') {
        RawLog::without_rows(name, header_columns(&super::line::keys(line, name)?, name)?)
    } else {
        csv(line, name)?.1
    };
    let named = HEADING.map(ChannelSpec::named);
    let mut headings = reading.selection.heading.iter().chain(&named);
    let found = headings.find_map(|spec| locate(&log, spec).map(|(column, _)| (column, spec.clone())));
    if let Some((column, mut heading)) = found {
        // The unit in the line counts, and not that of the training logs.
        if log.columns[column].unit.is_some() {
            heading.unit = None;
        }
        reading.selection.heading = Some(heading);
    }
    let named = |ports: &[Port]| ports.iter().map(|port| ChannelSpec::named(&port.channel.name)).collect();
    let Selection { outputs, inputs, .. } = &mut reading.selection;
    if outputs.is_empty() {
        *outputs = named(&model.description.outputs);
    }
    if inputs.is_empty() {
        *inputs = named(&model.description.inputs);
    }
    Ok(reading)
}

/// A column that a line may have later.
fn absent_column(spec: &ChannelSpec) -> RawColumn {
    RawColumn::named(&spec.column)
}

#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) name: String,
    pub(super) format: Format,
    pub(super) names: Vec<String>,
    pub(super) columns: Resolved,
    /// Pose of a steered vessel.
    pub(super) pose: Option<PoseColumns>,
}

impl Layout {
    pub(super) fn new(
        line: &str,
        name: &str,
        model: &Model,
        reading: &Reading,
        position: Option<&Position>,
        notes: &mut Vec<Note>,
    ) -> Result<Self, StreamError> {
        let line = line.strip_prefix('\u{feff}').unwrap_or(line);
        let named = position.map(|_| by_name(line, name, reading, model)).transpose()?;
        let reading = named.as_ref().unwrap_or(reading);
        let (format, log) = if line.trim_start().starts_with('{') {
            object(line, name, reading, position.is_some(), notes)?
        } else {
            let (format, mut log) = csv(line, name)?;
            if position.is_some() {
                let inputs = &reading.selection.inputs;
                let absent: Vec<RawColumn> =
                    inputs.iter().filter(|spec| locate(&log, spec).is_none()).map(absent_column).collect();
                log.columns.extend(absent);
            }
            (format, log)
        };
        let selection = &reading.selection;
        let begun = notes.len();
        let mut columns = Resolved::new(&log, selection, reading.options.dt, notes)?;
        if position.is_some() && matches!(&columns.time, Time::Column { stated: false, .. }) {
            // A controller has no option for the column of the time.
            for note in &mut notes[begun..] {
                if note.remedy.as_ref().is_some_and(|remedy| remedy.contains("[ms]")) {
                    note.remedy = Some("if it is not in seconds, name it with its unit: t [ms]".to_owned());
                }
            }
        }
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
            position: None,
        }])?;
        let pose = position.map(|position| PoseColumns::find(&log, reading, position)).transpose()?;
        if model.description.current.is_none() || pose.is_some() {
            columns.heading = None;
        } else if columns.heading.is_none() {
            let reason = format!(
                "the estimate of the current needs a heading, and no column looks like one: name it, as in {}",
                key("heading").is("yaw [deg]")
            );
            return Err(LogError::BadLine { path: name.to_owned(), line: 1, reason }.into());
        }
        let names = log.columns.into_iter().map(|column| column.name).collect();
        Ok(Self { name: name.to_owned(), format, names, columns, pose })
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
    Ok((format, RawLog::without_rows(name, columns)))
}

/// The keys of the first object are the columns: all commands, at least one output; other outputs may follow later.
fn object(
    line: &str,
    name: &str,
    reading: &Reading,
    steered: bool,
    notes: &mut Vec<Note>,
) -> Result<(Format, RawLog), LogError> {
    let mut keys = super::line::keys(line, name)?;
    let mut columns = header_columns(&keys, name)?;
    name_the_nameless(&mut columns);
    let mut log = RawLog::without_rows(name, columns);
    let selection = &reading.selection;
    let wind = selection.wind.iter().flat_map(|wind| [&wind.speed, &wind.direction]);
    let outputs: Vec<&ChannelSpec> = selection.outputs.iter().collect();
    let commands: Vec<&ChannelSpec> = selection.named_inputs(&log).iter().chain(wind).collect();
    let heading: Vec<&ChannelSpec> = selection.heading.iter().collect();
    // A steered vessel applies the commands of the answers.
    let least = if steered { 0 } else { commands.len() };
    for (specs, least) in [(outputs, 1), (heading, 0), (commands.clone(), least)] {
        let absent: Vec<&ChannelSpec> =
            specs.iter().copied().filter(|spec| locate(&log, spec).is_none()).collect();
        if let Some(first) = absent.first().filter(|_| specs.len() < absent.len() + least) {
            return Err(unknown(&log, &first.column));
        }
        for spec in absent {
            if !(steered && commands.contains(&spec)) {
                notes.push(Note::warning(format!(
                    "{name}: the first line has no `{}`: it counts as missing until a line contains it",
                    spec.column
                )));
            }
            keys.push(spec.column.clone());
            log.columns.push(absent_column(spec));
        }
    }
    Ok((Format::Json { keys }, log))
}
