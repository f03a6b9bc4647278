//! Reader of workbooks: Office Open XML, ECMA-376 part 1 (`SpreadsheetML`) in a package of part 2.
//!
//! A sheet with a row of names and numbers below is a topic. Rows are read one by one.

mod book;
mod rows;
mod table;
mod xml;

use std::cell::Cell as Shared;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::rc::Rc;

use zip::ZipArchive;

use self::book::{Package, Sheet};
use self::rows::{Row, Rows};
use self::table::Table;
use self::xml::Stop;
use crate::error::IoError;
use crate::input::Input;
use crate::log_file::Stream;
use crate::sink::{Sink, Summary};

/// Longest directory of the package: a workbook has a few hundred parts.
const LONGEST_DIRECTORY: u32 = 16 << 20;

/// Rows of a sheet by its specification.
const MOST_ROWS: u64 = 1_048_576;

const AGAIN: &str = "save it again as a workbook (.xlsx), or as CSV";

/// A file that counts what is read of it.
struct Counted {
    file: Stream,
    read: Rc<Shared<u64>>,
}

impl Read for Counted {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let size = self.file.read(into)?;
        self.read.set(self.read.get().saturating_add(size as u64));
        Ok(size)
    }
}

impl Seek for Counted {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

pub(crate) fn scan(input: &mut Input, sink: &mut dyn Sink) -> Result<Summary, IoError> {
    check_directory(input)?;
    let opened = input.source().open();
    let file = opened.map_err(|source| IoError::Read { path: input.path().to_owned(), source })?;
    let read = Rc::new(Shared::new(0));
    let counted = Counted { file, read: Rc::clone(&read) };
    let zip = ZipArchive::new(BufReader::new(counted))
        .map_err(|_| input.damaged("the directory of the package is damaged", AGAIN))?;
    let mut package = Package::new(zip, input.length());
    let book = match book::load(&mut package) {
        Ok(Some(book)) => book,
        Ok(None) => return Err(input.damaged("this is a ZIP file that holds no workbook", AGAIN)),
        Err(Stop::Damaged) => return Err(input.damaged("the list of the sheets or styles is damaged", AGAIN)),
        Err(Stop::Bomb) => return Err(bomb(input)),
    };
    let mut summary = Summary::default();
    if book.strings.cut {
        summary.note("texts behind the first 64 MiB are left out");
    }
    let mut topics = 0;
    for Sheet { name, part } in &book.sheets {
        let Some((xml, start, size)) = package.part(part) else {
            summary.lose(0, 0, &format!("sheet '{name}' is not in the package, or packed in an unknown way"));
            continue;
        };
        let mut rows = Rows::new(xml, &book);
        let mut table = Table::new(name, topics);
        let mut row = Row::default();
        let end = loop {
            match rows.next(&mut row) {
                Ok(true) => {}
                Ok(false) => break table.finish(&mut rows, sink),
                Err(stop) => {
                    table.start(sink);
                    break Err(stop);
                }
            }
            if !table.add(&mut row, sink) {
                break Ok(());
            }
            if table.lines() > MOST_ROWS {
                let reason = format!("sheet '{name}' has more than the {MOST_ROWS} rows of a workbook");
                return Err(input.damaged(&reason, AGAIN));
            }
            if table.lines().is_multiple_of(1024)
                && !sink.proceed(read.get().min(input.length()), input.length())
            {
                return Err(IoError::Interrupted);
            }
        };
        topics += usize::from(table.is_stated());
        match end {
            Err(Stop::Bomb) => return Err(bomb(input)),
            Err(Stop::Damaged) => {
                // The directory may say places outside of the file.
                let start = start.min(input.length());
                let size = size.min(input.length() - start);
                summary.lose(start, size, &format!("sheet '{name}' is damaged behind row {}", table.lines()));
            }
            Ok(()) => {}
        }
        table.note(&mut summary);
    }
    Ok(summary)
}

fn bomb(input: &Input) -> IoError {
    input.damaged("a part of the package unpacks to far more than a sheet; it is not read", AGAIN)
}

/// The directory is at the end of the file (PKWARE APPNOTE, section 4.3.16). Its size and the number of its entries limit
/// what is held in memory. Each place that may be its end is tested, because a reader may take an earlier one.
fn check_directory(input: &mut Input) -> Result<(), IoError> {
    let length = input.length();
    let mut tail = Vec::new();
    let start = length.saturating_sub(22 + 65_535);
    input.read_at(start, 22 + 65_535, &mut tail)?;
    input.seek(length)?;
    let mut found = false;
    for at in memchr::memmem::find_iter(&tail, b"PK\x05\x06") {
        let Some(end) = tail[at..].first_chunk::<22>() else { continue };
        found = true;
        let entries = u16::from_le_bytes([end[10], end[11]]);
        let size = u32::from_le_bytes([end[12], end[13], end[14], end[15]]);
        let offset = u32::from_le_bytes([end[16], end[17], end[18], end[19]]);
        let before = (start + at as u64).saturating_sub(u64::from(offset));
        // The largest numbers stand for a directory of the 64-bit format.
        if entries == u16::MAX
            || offset == u32::MAX
            || size > LONGEST_DIRECTORY
            || before > u64::from(LONGEST_DIRECTORY)
        {
            return Err(input.damaged("the package has more parts than a workbook", AGAIN));
        }
    }
    if !found {
        return Err(input.damaged(
            "the file does not end with the directory of a package; it is not whole",
            "copy or save it again",
        ));
    }
    Ok(())
}
