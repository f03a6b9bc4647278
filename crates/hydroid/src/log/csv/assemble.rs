//! Joins the parts of a log.

use std::io::{self, Read};

use rayon::prelude::*;

use super::super::error::LogError;
use super::super::stamp;
use super::super::summary::{PairSummary, Summary};
use super::cell::text;
use super::chunks::{Chunk, Chunks};
use super::header::{delimiter, has_decimal_comma, header_columns, name_the_nameless, take_units, title};
use super::rows::{self, Defect, Format, Kind, Part, Rows};
use super::{Plan, RawColumn, RawLog};

/// Parts that are parsed together.
const TOGETHER: usize = 16;

/// Reads a log in parts of about `size` bytes.
pub(super) fn read(
    reader: impl Read + Send,
    path: &str,
    size: usize,
    plan: impl FnOnce(&RawLog) -> Option<Plan>,
) -> Result<RawLog, LogError> {
    let failed = |source: io::Error| super::failed(path.to_owned(), source);
    let mut chunks = Chunks::new(reader, size);
    let Header { format, columns, begin, before } = header(&mut chunks, path)?;
    chunks.set_delimiter(format.delimiter);
    let mut log = RawLog::without_rows(path, columns);
    let plan = plan(&log).unwrap_or_else(|| Plan { keep: vec![true; format.width], pairs: Vec::new() });
    let kinds = vec![Kind::Unknown; format.width];
    let mut table = Table { log: &mut log, plan: &plan, kinds, before, last: Vec::new() };
    table.begin();
    table.append(vec![Rows::of(&begin, &format, &table.kinds)], format.needed)?;
    drop(begin);
    let mut batch = chunks.take(TOGETHER).map_err(failed)?;
    while !batch.is_empty() {
        let kinds = table.kinds.clone();
        let parse = || batch.par_iter().map(|chunk| Rows::of(chunk, &format, &kinds)).collect();
        let (mut parsed, next): (Vec<Rows>, _) = rayon::join(parse, || chunks.take(TOGETHER));
        // The first cell of a column that was empty until now decides how the parts after it are read.
        let mut kinds = kinds.clone();
        for (i, chunk) in batch.iter().enumerate() {
            if kinds != table.kinds {
                parsed[i] = Rows::of(chunk, &format, &kinds);
            }
            kinds = parsed[i].columns.iter().map(|part| part.kind).collect();
        }
        table.append(parsed, format.needed)?;
        batch = next.map_err(failed)?;
    }
    table.finish();
    if log.lines.is_empty() {
        return Err(LogError::HeaderOnly { path: path.to_owned() });
    }
    if log.columns.iter().all(|column| !column.has_values())
        && let Some(bad) = log.columns.iter().find_map(|column| column.bad.as_ref())
    {
        let (path, line, text) = (path.to_owned(), bad.line, bad.text.clone());
        return Err(LogError::NoNumbers { path, line, text });
    }
    // A column without a name comes from a trailing separator or is an index written by a program.
    let kept: Vec<bool> = log.columns.iter().map(|c| !c.name.is_empty() || c.has_values()).collect();
    let place = |column: usize| kept[..column].iter().filter(|kept| **kept).count();
    for (a, b, _) in &mut log.rest.pairs {
        (*a, *b) = (place(*a), place(*b));
    }
    let mut kept = kept.iter();
    log.columns.retain(|_| kept.next().is_some_and(|kept| *kept));
    name_the_nameless(&mut log.columns);
    Ok(log)
}

struct Header {
    format: Format,
    columns: Vec<RawColumn>,
    /// The rest of the part with the header, and the number of lines before it.
    begin: Chunk,
    before: u64,
}

fn header(chunks: &mut Chunks<impl Read>, path: &str) -> Result<Header, LogError> {
    let mut before = 0;
    let mut first = true;
    loop {
        let read = chunks.next().map_err(|source| super::failed(path.to_owned(), source))?;
        let Some(mut chunk) = read else { return Err(LogError::Empty { path: path.to_owned() }) };
        if let Some(endless) = chunk.endless {
            return Err(Defect::Endless(endless).error(path, before, 0));
        }
        if std::mem::take(&mut first) {
            if [[0xff, 0xfe], [0xfe, 0xff]].iter().any(|mark| chunk.bytes.starts_with(mark)) {
                let remedy = "the encoding is UTF-16: save the file as `CSV UTF-8`";
                return Err(LogError::NotUtf8 { path: path.to_owned(), line: 1, remedy });
            }
            if chunk.bytes.starts_with(b"\xef\xbb\xbf") {
                chunk.bytes.drain(..3);
            }
        }
        let bytes = &chunk.bytes;
        let end_of_line = end_of_line(bytes);
        rows::utf8(bytes, end_of_line).map_err(|defect| defect.error(path, before, 0))?;
        let title = title(bytes);
        let delimiter = delimiter(&bytes[title..]);
        let mut reader = rows::records(&bytes[title..], delimiter);
        let mut record = csv::ByteRecord::new();
        while reader.read_byte_record(&mut record).is_ok_and(|found| found) {
            if record.iter().all(|cell| text(cell).is_empty()) {
                continue;
            }
            let header: Vec<String> = record.iter().map(|cell| text(cell).to_owned()).collect();
            let mut columns = header_columns(&header, path)?;
            let needed = header.iter().rposition(|cell| !cell.is_empty()).map_or(0, |at| at + 1);
            let mut read = reader.position().byte();
            let mut found = reader.read_byte_record(&mut record).unwrap_or(false);
            if found && take_units(&mut columns, &record) {
                read = reader.position().byte();
                found = reader.read_byte_record(&mut record).unwrap_or(false);
            }
            let read = usize::try_from(read).unwrap_or(bytes.len());
            let format = Format {
                omits: found && record.len() < needed,
                delimiter,
                decimal_comma: delimiter != b',' && has_decimal_comma(bytes, delimiter, end_of_line),
                end_of_line,
                width: columns.len(),
                needed,
            };
            let end = title.saturating_add(read).min(bytes.len());
            let before = before + rows::count(&bytes[..end], end_of_line);
            chunk.bytes.drain(..end);
            return Ok(Header { format, columns, begin: chunk, before });
        }
        before += rows::count(bytes, end_of_line);
    }
}

/// The byte that ends the first line: a line feed unless there is only a carriage return.
fn end_of_line(bytes: &[u8]) -> u8 {
    let ends = bytes.trim_ascii_start().iter().skip_while(|byte| !matches!(byte, b'\n' | b'\r'));
    let mut ends = ends.take_while(|byte| matches!(byte, b'\n' | b'\r')).peekable();
    if ends.peek().is_some() && ends.all(|byte| *byte == b'\r') { b'\r' } else { b'\n' }
}

/// The log up to a part.
struct Table<'a> {
    log: &'a mut RawLog,
    plan: &'a Plan,
    kinds: Vec<Kind>,
    /// Lines before the next part.
    before: u64,
    /// Values of the last row in the columns that are left out.
    last: Vec<f64>,
}

impl Table<'_> {
    fn begin(&mut self) {
        for (column, keep) in self.log.columns.iter_mut().zip(&self.plan.keep) {
            column.left_out = (!keep).then(Summary::default);
        }
        self.log.rest.pairs = self.plan.pairs.iter().map(|&(a, b)| (a, b, PairSummary::default())).collect();
    }

    /// Appends parts in the order of the file.
    fn append(&mut self, parts: Vec<Rows>, needed: usize) -> Result<(), LogError> {
        let mut before = Vec::with_capacity(parts.len());
        for rows in &parts {
            before.push(self.before);
            self.before += rows.ends;
        }
        if let Some(at) = parts.iter().position(|rows| rows.defect.is_some()) {
            let defect = parts.into_iter().nth(at).and_then(|rows| rows.defect);
            return defect.map_or(Ok(()), |defect| Err(defect.error(&self.log.path, before[at], needed)));
        }
        for (rows, &before) in parts.iter().zip(&before) {
            self.log.lines.append(&rows.lines, before);
            self.log.short.add(rows.short, before);
            self.compare(&rows.columns);
        }
        self.log.columns.par_iter_mut().enumerate().for_each(|(c, column)| {
            for (rows, &before) in parts.iter().zip(&before) {
                column.append(&rows.columns[c], before);
            }
        });
        self.log.rest.pairs.par_iter_mut().for_each(|(a, b, pair)| {
            for rows in &parts {
                pair.extend(&rows.columns[*a].values, &rows.columns[*b].values);
            }
        });
        if let Some(rows) = parts.last() {
            self.kinds = rows.columns.iter().map(|part| part.kind).collect();
        }
        Ok(())
    }

    /// Notes which rows repeat the row before in the columns that are left out.
    fn compare(&mut self, parts: &[Part]) {
        let columns: Vec<&Vec<f64>> = parts
            .iter()
            .zip(&self.plan.keep)
            .filter(|(_, keep)| !**keep)
            .map(|(part, _)| &part.values)
            .collect();
        let Some(rows) = columns.first().map(|values| values.len()) else { return };
        let same = |a: f64, b: f64| a == b || a.is_nan() && b.is_nan();
        for k in 0..rows {
            let repeats = match k.checked_sub(1) {
                Some(before) => columns.iter().all(|values| same(values[before], values[k])),
                None => {
                    self.last.len() == columns.len()
                        && columns.iter().zip(&self.last).all(|(values, last)| same(*last, values[k]))
                }
            };
            self.log.rest.repeats.push(repeats);
        }
        if rows > 0 {
            self.last = columns.iter().map(|values| values[rows - 1]).collect();
        }
    }

    fn finish(&mut self) {
        for column in &mut self.log.columns {
            if column.stamps.as_ref().is_some_and(|first| !first.dated) {
                stamp::pass_midnight(&mut column.values);
            }
        }
        self.log.columns.iter_mut().filter_map(|column| column.left_out.as_mut()).for_each(Summary::finish);
        self.log.rest.pairs.iter_mut().for_each(|(_, _, pair)| pair.finish());
    }
}

impl RawColumn {
    fn append(&mut self, part: &Part, before: u64) {
        match &mut self.left_out {
            Some(summary) => summary.extend(&part.values),
            None => self.values.extend_from_slice(&part.values),
        }
        self.bad_cells += part.bad_cells;
        if self.bad.is_none() {
            self.bad = part.bad.clone().map(|bad| super::BadCell { line: before + bad.line, ..bad });
        }
        if self.stamps.is_none() {
            self.stamps =
                part.stamps.clone().map(|stamp| super::FirstStamp { line: before + stamp.line, ..stamp });
        }
    }
}
