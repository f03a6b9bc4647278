//! Reading of recordings into memory.

use std::path::{Path, PathBuf};

use hydroid_io::{Clock, Field, Format, IoError, LogFile, Sink, Summary, Topic};

use super::clock::Clocks;
use crate::key::key;
use crate::log::line::{Source, Time};
use crate::log::{
    self, ChannelSpec, LONGEST_TIME_S, LogError, Note, RawColumn, RawLog, SINCE_1970_S, Selection,
};
use crate::progress::{self, Progress};

/// The chosen columns of a recording.
#[derive(Clone, Debug)]
pub(super) struct Recording {
    /// All columns of all topics. Those that are chosen have a value for each stamp of their topic, and the others none.
    pub(super) log: RawLog,
    /// Topic of each column.
    pub(super) topic_of: Vec<usize>,
    /// Topics.
    pub(super) topics: Vec<Times>,
}

/// Stamps of a topic.
#[derive(Clone, Debug)]
pub(super) struct Times {
    pub(super) clock: Clock,
    /// Increasing stamps \[s\].
    pub(super) t: Vec<f64>,
}

/// Whether a path is a recording: a folder, or a file of another format than CSV.
///
/// # Errors
/// If the file cannot be read.
pub fn is_recording(source: impl Into<LogFile>) -> Result<bool, LogError> {
    let source = source.into();
    if source.is_folder() {
        return Ok(true);
    }
    // A pipe can be read only once.
    if !source.is_file() {
        return Ok(false);
    }
    match hydroid_io::detect(source) {
        Ok(format) => Ok(format.is_some()),
        // The reader of CSV has its own message.
        Err(IoError::Empty { .. }) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

/// Gives the rows of a recording, of a CSV file or of all files of a folder to a sink. A CSV file is a topic; its time is
/// the column `time`, if it has that.
pub(super) fn scan(
    source: &LogFile,
    time: Option<&str>,
    sink: &mut dyn Sink,
    notes: &mut Vec<Note>,
) -> Result<(Summary, Clocks), LogError> {
    let files = if source.is_folder() { files(source.path(), notes)? } else { vec![source.clone()] };
    let mut summary = Summary::default();
    let mut joined = Joined { sink, names: Vec::new(), ids: Vec::new(), file: 0, clocks: Clocks::default() };
    let mut timed = time.is_none();
    for (i, file) in files.iter().enumerate() {
        joined.ids.clear();
        if is_recording(file)? {
            // The files of a bag continue each other.
            let is_bag = hydroid_io::detect(file)?.is_some_and(|format| BAG_FORMATS.contains(&format));
            joined.file = if is_bag { 0 } else { i };
            merge(&mut summary, hydroid_io::scan(file, &mut joined)?);
        } else {
            joined.file = i;
            timed |= csv(file, time, files.len() == 1, &mut joined, notes)?;
        }
    }
    if let Some(time) = time.filter(|_| !timed) {
        notes.push(
            Note::warning(format!(
                "{}: no CSV file in it has the column `{time}` of the time; the times are those of the recording",
                source.name()
            ))
            .with_remedy(format!("leave {} out", key("time"))),
        );
    }
    Ok((summary, joined.clocks))
}

/// Files of a folder that are read together: those of a ROS 2 bag, else all of a known format.
fn files(folder: &Path, notes: &mut Vec<Note>) -> Result<Vec<LogFile>, LogError> {
    let failed = |source| LogError::Read { path: folder.display().to_string(), source };
    let mut all = std::fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, _>>())
        .map_err(failed)?;
    all.sort();
    let inner = all.iter().filter(|path| path.is_dir()).filter_map(|path| path.file_name());
    let inner: Vec<String> = inner.map(|name| name.to_string_lossy().into_owned()).collect();
    if !inner.is_empty() {
        notes.push(
            Note::warning(format!("{}: folders in it are not read: {}", folder.display(), inner.join(", ")))
                .with_remedy("move their files into the folder of the recording, with a name for each topic"),
        );
    }
    let has_extension = |path: &Path, of: &[&str]| {
        path.extension().is_some_and(|e| of.iter().any(|of| e.eq_ignore_ascii_case(of)))
    };
    let bags: Vec<LogFile> = all.iter().filter(|path| has_extension(path, BAGS)).map(LogFile::from).collect();
    if !bags.is_empty() {
        return Ok(bags);
    }
    let is_known = |path: &&PathBuf| {
        has_extension(path, &["csv"]) || hydroid_io::detect(*path).is_ok_and(|format| format.is_some())
    };
    let is_file = |path: &&PathBuf| {
        path.is_file() && path.file_name().is_some_and(|name| !name.as_encoded_bytes().starts_with(b"."))
    };
    let (known, others): (Vec<_>, Vec<_>) = all.iter().filter(is_file).partition(is_known);
    if known.is_empty() {
        return Err(LogError::Unusable {
            path: folder.display().to_string(),
            reason: "the folder has neither a ROS 2 bag (.db3, .mcap) nor files of a known format".to_owned(),
            remedy: "name the log itself".to_owned(),
        });
    }
    if !others.is_empty() {
        let names = others.iter().filter_map(|path| path.file_name()).take(LISTED);
        let names: Vec<_> = names.map(|name| name.to_string_lossy().into_owned()).collect();
        let more = if others.len() > LISTED { ", ..." } else { "" };
        notes.push(Note::info(format!(
            "{}: files of other formats are not read: {}{more}",
            folder.display(),
            names.join(", ")
        )));
    }
    Ok(known.into_iter().map(LogFile::from).collect())
}

/// Extensions and formats of the files of a bag, which continue each other.
const BAGS: &[&str] = &["db3", "mcap", "bag"];
const BAG_FORMATS: [Format; 3] = [Format::Mcap, Format::Ros1Bag, Format::Ros2Sqlite];
/// Names that a note lists.
const LISTED: usize = 5;

fn merge(all: &mut Summary, part: Summary) {
    let Summary { losses, lost_parts, lost_bytes, utc_offset_ns, parameters, notes } = part;
    let room = Summary::LISTED.saturating_sub(all.losses.len());
    all.losses.extend(losses.into_iter().take(room));
    all.lost_parts += lost_parts;
    all.lost_bytes = all.lost_bytes.saturating_add(lost_bytes);
    all.utc_offset_ns = all.utc_offset_ns.or(utc_offset_ns);
    all.parameters.extend(parameters);
    for note in notes {
        all.note(note);
    }
}

/// Topics of several files: those of the same name are one.
struct Joined<'a> {
    sink: &'a mut dyn Sink,
    names: Vec<String>,
    /// Topic of each topic of the present file.
    ids: Vec<usize>,
    /// The present file, or the first one of those that continue each other.
    file: usize,
    clocks: Clocks,
}

impl Sink for Joined<'_> {
    fn topic(&mut self, id: usize, topic: &Topic) -> bool {
        if id == self.ids.len() {
            // Topics of the same name within a file stay apart.
            let known = self.names.iter().enumerate();
            let known = known.filter(|(at, name)| **name == topic.name && !self.ids.contains(at));
            let at = known.map(|(at, _)| at).next().unwrap_or(self.names.len());
            if at == self.names.len() {
                self.names.push(topic.name.clone());
            }
            self.ids.push(at);
        }
        self.clocks.topic(self.ids[id], topic, self.file);
        self.sink.topic(self.ids[id], topic)
    }

    fn row(&mut self, id: usize, stamp_ns: i64, received_ns: Option<i64>, values: &[f64]) {
        let received = received_ns.filter(|_| (stamp_ns as f64) < SINCE_1970_S * 1e9);
        self.clocks.row(self.ids[id], received.unwrap_or(stamp_ns));
        self.sink.row(self.ids[id], stamp_ns, received_ns, values);
    }

    fn proceed(&mut self, done: u64, total: u64) -> bool {
        self.sink.proceed(done, total)
    }
}

/// A CSV file as a topic with its name, and whether its time is the column `time`. Without that column, another one is the
/// time, unless the file is `alone`.
fn csv(
    file: &LogFile,
    time: Option<&str>,
    alone: bool,
    sink: &mut dyn Sink,
    notes: &mut Vec<Note>,
) -> Result<bool, LogError> {
    let log = match log::read(file) {
        // A topic without messages.
        Err(LogError::HeaderOnly { .. }) => return Ok(false),
        log => log?,
    };
    let named = match time {
        Some(text) => alone || log::line::locate(&log, &text.parse()?).is_some(),
        None => false,
    };
    let selection = Selection { time: time.filter(|_| named).map(str::to_owned), ..Selection::default() };
    let time = log::time(&log, &selection, None, notes);
    let time = if named { Ok(time?) } else { time };
    let source = match &time {
        Ok(Time::Column { source, .. }) => Some(source),
        _ => None,
    };
    if let Some(source) = source {
        check_time(&log, &log.columns[source.column], notes)?;
    }
    let is_dated = |source: &Source| log.columns[source.column].stamps.as_ref().is_some_and(|s| s.dated);
    let clock = match source {
        Some(source) if is_dated(source) => Clock::Utc,
        Some(_) => Clock::Boot,
        None => Clock::None,
    };
    let kept: Vec<&RawColumn> = log
        .columns
        .iter()
        .enumerate()
        .filter(|(i, column)| source.is_none_or(|s| s.column != *i) && column.has_values())
        .map(|(_, column)| column)
        .collect();
    for column in kept.iter().filter(|column| column.bad_cells > 0) {
        notes.push(Note::warning(format!(
            "{}: {} cells of `{}` are not numbers, and are missing",
            log.path, column.bad_cells, column.name
        )));
    }
    let fields = kept.iter().map(|c| Field { name: c.name.clone(), unit: c.unit.clone() }).collect();
    let name = file.path().file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let topic = Topic { name, type_name: String::new(), clock, fields, texts: Vec::new() };
    if !sink.topic(0, &topic) {
        return Ok(named);
    }
    let mut values = vec![0.0; kept.len()];
    let mut absurd = Vec::new();
    for k in 0..log.rows() {
        let t = source.map_or(k as f64, |source| source.si(log.columns[source.column].values[k]));
        if t.is_nan() {
            continue;
        }
        if t.abs() > LONGEST_TIME_S {
            absurd.push(k);
            continue;
        }
        for (value, column) in values.iter_mut().zip(&kept) {
            *value = column.values[k];
        }
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let stamp_ns = (t * 1e9).round() as i64;
        sink.row(0, stamp_ns, None, &values);
    }
    if let (Some(&k), Some(source)) = (absurd.first(), source) {
        let (path, line, time) =
            (log.path.clone(), log.lines.get(k), source.si(log.columns[source.column].values[k]));
        if 2 * absurd.len() > log.rows() {
            return Err(LogError::AbsurdTime { path, line, time });
        }
        notes.push(Note::warning(format!(
            "{path}: {} rows are left out, the first in line {line}: a time of {time:e} s is not plausible",
            absurd.len()
        )));
    }
    Ok(named)
}

/// Rows without a time are left out. If no row has one, it is an error.
fn check_time(log: &RawLog, column: &RawColumn, notes: &mut Vec<Note>) -> Result<(), LogError> {
    let missing = column.values.iter().filter(|t| t.is_nan()).count();
    if missing == 0 {
        return Ok(());
    }
    let (path, name) = (log.path.clone(), column.name.clone());
    match &column.bad {
        Some(bad) if missing == log.rows() => Err(LogError::TextInNumbers {
            path,
            line: bad.line,
            column: name,
            text: bad.text.clone(),
            remedy: "write the time as 2020-08-03T11:04:37.125Z, or as a number with its unit in the header",
        }),
        None if missing == log.rows() => Err(LogError::AllMissing { path, column: name }),
        bad => {
            let first = bad.as_ref().map_or(String::new(), |bad| {
                format!("; the first cell that is not a time is `{}` in line {}", bad.text, bad.line)
            });
            notes.push(Note::warning(format!(
                "{path}: {missing} of {} rows have no time in `{name}`, and are left out{first}",
                log.rows()
            )));
            Ok(())
        }
    }
}

/// Name of a column.
pub(super) fn qualified(topic: &str, field: &str) -> String {
    format!("{topic}.{field}")
}

/// The quaternion of a yaw angle: its name, and those of its components x, y, z, w.
pub(super) fn quaternion(column: &str) -> Option<[[String; 4]; 2]> {
    let stem = column.strip_suffix(".yaw")?;
    let letters = ["x", "y", "z", "w"].map(|c| format!("{stem}.{c}"));
    let indices = [1, 2, 3, 0].map(|i| format!("{stem}[{i}]"));
    Some([letters, indices])
}

/// The rotation about the third axis (z of the frame) of a quaternion x, y, z, w.
fn yaw([x, y, z, w]: [f64; 4]) -> f64 {
    (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z))
}

/// Names that a specification may mean.
pub(super) fn names(spec: &ChannelSpec) -> impl Iterator<Item = String> + '_ {
    spec.as_names()
        .map(|spec| spec.column)
        .chain([spec.column.clone()])
        .chain(log::same::on_link(&spec.column))
}

struct Collector<'p> {
    names: Vec<String>,
    all: bool,
    topics: Vec<Collected>,
    progress: Progress<'p>,
    /// Completed fraction. Each file of a folder begins anew.
    fraction: f64,
}

struct Collected {
    topic: Topic,
    stamps: Vec<i64>,
    received: Vec<i64>,
    columns: Vec<RawColumn>,
    /// Fields that are chosen.
    chosen: Vec<usize>,
}

impl Sink for Collector<'_> {
    fn topic(&mut self, id: usize, topic: &Topic) -> bool {
        if id == self.topics.len() {
            self.topics.push(Collected {
                topic: topic.clone(),
                stamps: Vec::new(),
                received: Vec::new(),
                columns: Vec::new(),
                chosen: Vec::new(),
            });
        }
        let kept = &mut self.topics[id];
        for (i, field) in topic.fields.iter().enumerate().skip(kept.columns.len()) {
            let name = qualified(&topic.name, &field.name);
            let mut values = Vec::new();
            if self.all || self.names.contains(&name) || self.names.contains(&field.name) {
                values.resize(kept.stamps.len(), f64::NAN);
                kept.chosen.push(i);
            }
            kept.columns.push(RawColumn::of(&field.name, None, values));
        }
        kept.topic = topic.clone();
        !kept.chosen.is_empty()
    }

    fn row(&mut self, id: usize, stamp_ns: i64, received_ns: Option<i64>, values: &[f64]) {
        let kept = &mut self.topics[id];
        kept.stamps.push(stamp_ns);
        kept.received.extend(received_ns);
        for &field in &kept.chosen {
            kept.columns[field].values.push(values.get(field).copied().unwrap_or(f64::NAN));
        }
    }

    fn proceed(&mut self, done: u64, total: u64) -> bool {
        self.fraction = self.fraction.max(done as f64 / total.max(1) as f64).min(1.0);
        progress::report(self.progress, self.fraction).is_ok()
    }
}

/// Specifications of a selection.
fn specs(selection: &Selection) -> impl Iterator<Item = &ChannelSpec> {
    let wind = selection.wind.iter().flat_map(|wind| [&wind.speed, &wind.direction]);
    let sensors = selection.sensors.iter().flat_map(|sensors| sensors.columns().map(|(_, spec)| spec));
    selection.outputs.iter().chain(&selection.inputs).chain(wind).chain(&selection.heading).chain(sensors)
}

/// Reads the columns of a selection. Without named outputs or inputs, all columns are read.
pub(super) fn read(
    source: &LogFile,
    selection: &Selection,
    notes: &mut Vec<Note>,
    progress: Progress<'_>,
) -> Result<Recording, LogError> {
    let of_parts = selection.parts.columns();
    let mut wanted: Vec<String> = specs(selection).chain(&of_parts).flat_map(names).collect();
    let components: Vec<String> =
        wanted.iter().filter_map(|name| quaternion(name)).flatten().flatten().collect();
    wanted.extend(components);
    let all = selection.sensors.is_none() && (selection.outputs.is_empty() || selection.inputs.is_empty());
    let mut collector = Collector { names: wanted.clone(), all, topics: Vec::new(), progress, fraction: 0.0 };
    let (summary, clocks) = scan(source, selection.time.as_deref(), &mut collector, notes)?;
    let shown = source.name();
    note_losses(&shown, &summary, &clocks, notes);
    let single = collector.topics.len() == 1;
    let mut recording =
        Recording { log: RawLog::without_rows(&shown, Vec::new()), topic_of: Vec::new(), topics: Vec::new() };
    let mut times: Vec<Vec<f64>> =
        collector.topics.iter().map(|collected| times(collected, &summary, &shown, notes)).collect();
    let orders = clocks.order(&mut times);
    for (collected, (t, order)) in collector.topics.into_iter().zip(times.into_iter().zip(orders)) {
        recording.add(collected, &t, &order, single, notes);
    }
    for name in &wanted {
        recording.add_yaw(name);
    }
    Ok(recording)
}

/// Notes on parts of a file that could not be read, those of its reader, and on its clock.
pub(super) fn note_losses(path: &str, summary: &Summary, clocks: &Clocks, notes: &mut Vec<Note>) {
    notes.extend(clocks.note(path, summary));
    notes.extend(summary.notes.iter().map(|note| Note::info(format!("{path}: {note}"))));
    let Some(first) = summary.losses.first() else { return };
    let others = match summary.lost_parts {
        1 => String::new(),
        2 => ", and one more part".to_owned(),
        n => format!(", and {} more parts", n - 1),
    };
    notes.push(Note::warning(format!(
        "{path}: {} bytes could not be read: at byte {}, {}{others}; the rest is used",
        summary.lost_bytes, first.offset, first.reason
    )));
}

/// Times of the rows of a topic \[s\], in the order of the file.
fn times(collected: &Collected, summary: &Summary, path: &str, notes: &mut Vec<Note>) -> Vec<f64> {
    let Collected { topic, stamps, received, .. } = collected;
    let seconds = |ns: &i64| *ns as f64 / 1e9;
    let t: Vec<f64> = match (topic.clock, summary.utc_offset_ns) {
        (Clock::Boot, Some(offset)) => stamps.iter().map(|ns| seconds(&ns.saturating_add(offset))).collect(),
        _ => stamps.iter().map(seconds).collect(),
    };
    // Some senders leave their stamp zero.
    if received.len() == t.len()
        && t.iter().all(|t| *t < SINCE_1970_S)
        && received.iter().any(|ns| seconds(ns) >= SINCE_1970_S)
    {
        notes.push(Note::info(format!(
            "{path}: the messages of `{}` have no stamp of their sender: the time of reception is used",
            topic.name
        )));
        return received.iter().map(seconds).collect();
    }
    t
}

impl Recording {
    fn add(&mut self, collected: Collected, t: &[f64], order: &[usize], single: bool, notes: &mut Vec<Note>) {
        let Collected { topic, columns, chosen, .. } = collected;
        let left_out = t.len() - order.len();
        if left_out > 0 {
            notes.push(Note::warning(format!(
                "{}: {left_out} of {} rows of `{}` have the stamp of another row or one of another day, and are left out",
                self.log.path,
                t.len(),
                topic.name
            )));
        }
        let sorted: Vec<f64> = order.iter().map(|&k| t[k]).collect();
        let index = self.topics.len();
        for (i, (field, column)) in topic.fields.iter().zip(columns).enumerate() {
            let name = if single { field.name.clone() } else { qualified(&topic.name, &field.name) };
            let finite = |&k: &usize| Some(column.values[k]).filter(|x| x.is_finite()).unwrap_or(f64::NAN);
            let values = if chosen.contains(&i) { order.iter().map(finite).collect() } else { Vec::new() };
            self.log.columns.push(RawColumn::of(&name, field.unit.as_deref(), values));
            self.topic_of.push(index);
        }
        self.topics.push(Times { clock: topic.clock, t: sorted });
    }

    /// Adds the yaw angle of a quaternion as a column.
    fn add_yaw(&mut self, name: &str) {
        if self.log.position(name).is_some() {
            return;
        }
        for components in quaternion(name).into_iter().flatten() {
            let found = components.map(|component| self.log.position(&component));
            let [Some(x), Some(y), Some(z), Some(w)] = found else { continue };
            let topic = self.topic_of[x];
            if [y, z, w].iter().any(|i| self.topic_of[*i] != topic) {
                continue;
            }
            let rows = self.topics[topic].t.len();
            let parts = [x, y, z, w].map(|i| &self.log.columns[i].values);
            if parts.iter().any(|values| values.len() < rows) {
                continue;
            }
            let values = (0..rows).map(|k| yaw(parts.map(|values| values[k]))).collect();
            self.log.columns.push(RawColumn::of(name, Some("rad"), values));
            self.topic_of.push(topic);
            return;
        }
    }
}
