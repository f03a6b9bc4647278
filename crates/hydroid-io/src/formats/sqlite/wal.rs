//! The write-ahead log of a SQLite file (SQLite documentation, "Database File Format", section 4): pages that have been
//! written but are not yet in the file.

use std::collections::HashMap;

use crate::error::IoError;
use crate::input::Input;
use crate::log_file::LogFile;
use crate::sink::Summary;

const HEADER: usize = 32;
const FRAME: usize = 24;

/// Pages of the finished transactions of a log.
pub(super) struct Wal {
    input: Input,
    /// Place of the last version of each page.
    places: HashMap<u64, u64>,
    /// Pages of the file after the last transaction.
    pages: u64,
}

impl Wal {
    /// Opens the log of a file; `None` if it has none, or none with a finished transaction.
    pub(super) fn open(
        of: &LogFile,
        page_size: usize,
        summary: &mut Summary,
    ) -> Result<Option<Self>, IoError> {
        let Some(source) = of.beside("-wal") else { return Ok(None) };
        let path = source.name();
        let mut input = Input::open(source)?;
        if input.length() <= HEADER as u64 {
            return Ok(None);
        }
        let unread = "rows in it are not read; open the bag once with sqlite3 to merge them";
        let Some(header) = input.window(HEADER)?.first_chunk::<HEADER>().copied() else { return Ok(None) };
        let word = |at: usize| super::big(&header[at..]).unwrap_or(0);
        // The last bit of the first word is the order of bytes of the checksums.
        let big = word(0) & 1 == 1;
        let mut sum = checksum(&header[..24], (0, 0), big);
        if word(0) & !1 != 0x377f_0682 || word(8) as usize != page_size || sum != (word(24), word(28)) {
            summary.note(format!("{path} is damaged: {unread}"));
            return Ok(None);
        }
        let mut wal = Self { input, places: HashMap::new(), pages: 0 };
        let mut open = Vec::new();
        wal.input.skip(HEADER as u64)?;
        loop {
            let offset = wal.input.offset();
            let Some(frame) = wal.input.window(FRAME + page_size)?.get(..FRAME + page_size) else { break };
            let word = |at: usize| super::big(&frame[at..]).unwrap_or(0);
            sum = checksum(&frame[FRAME..], checksum(&frame[..8], sum, big), big);
            // Frames of an older log follow behind the end of this one.
            if frame[8..16] != header[16..24] || sum != (word(16), word(20)) {
                break;
            }
            open.push((u64::from(word(0)), offset + FRAME as u64));
            if word(4) > 0 {
                wal.pages = u64::from(word(4));
                wal.places.extend(open.drain(..));
            }
            wal.input.skip((FRAME + page_size) as u64)?;
        }
        Ok((wal.pages > 0).then_some(wal))
    }

    /// Pages of the file after the last transaction, as the log states them.
    pub(super) fn pages(&self) -> u64 {
        self.pages
    }

    /// Pages that are in the log.
    pub(super) fn stored(&self) -> u64 {
        self.places.len() as u64
    }

    /// Where the newest version of a page is, if it is in the log.
    pub(super) fn find(&mut self, page: u64) -> Option<(&mut Input, u64)> {
        let place = *self.places.get(&page)?;
        Some((&mut self.input, place))
    }
}

/// Adds bytes to a checksum (section 4.2).
fn checksum(bytes: &[u8], (mut a, mut b): (u32, u32), big: bool) -> (u32, u32) {
    let read = |bytes: &[u8; 4]| if big { u32::from_be_bytes(*bytes) } else { u32::from_le_bytes(*bytes) };
    for pair in bytes.as_chunks().0.as_chunks::<2>().0 {
        a = a.wrapping_add(read(&pair[0])).wrapping_add(b);
        b = b.wrapping_add(read(&pair[1])).wrapping_add(a);
    }
    (a, b)
}
