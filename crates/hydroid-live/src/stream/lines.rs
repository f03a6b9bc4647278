//! Lines of an untrusted source, in bounded memory.

use std::io::{self, BufRead};

/// Longest line \[bytes\].
pub const LONGEST_LINE: usize = 1 << 20;

/// A line without its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line<'a> {
    /// All of it.
    Whole(&'a [u8]),
    /// Longer than [`LONGEST_LINE`]; the content is dropped.
    TooLong,
}

/// A line reader with one buffer.
#[derive(Debug)]
pub struct Lines<R> {
    reader: R,
    buffer: Vec<u8>,
}

impl<R: BufRead> Lines<R> {
    /// Lines of a source.
    pub fn new(reader: R) -> Self {
        Self { reader, buffer: Vec::new() }
    }

    /// Memory of the buffer \[bytes\].
    #[doc(hidden)]
    pub fn capacity(&self) -> usize {
        self.buffer.capacity()
    }

    /// The next line without its end, or `None` at the end of the source. Blocks until a line is complete.
    pub fn next_line(&mut self) -> io::Result<Option<Line<'_>>> {
        self.buffer.clear();
        let (mut any, mut long) = (false, false);
        loop {
            let chunk = match self.reader.fill_buf() {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                other => other?,
            };
            if chunk.is_empty() && !any {
                return Ok(None);
            }
            any = true;
            let end = chunk.iter().position(|b| *b == b'\n');
            let part = &chunk[..end.unwrap_or(chunk.len())];
            let done = end.is_some() || chunk.is_empty();
            long |= self.buffer.len() + part.len() > LONGEST_LINE;
            if !long {
                self.buffer.extend_from_slice(part);
            }
            let used = part.len() + usize::from(end.is_some());
            self.reader.consume(used);
            if done {
                break;
            }
        }
        if long {
            return Ok(Some(Line::TooLong));
        }
        let line = self.buffer.strip_suffix(b"\r").unwrap_or(&self.buffer);
        Ok(Some(Line::Whole(line)))
    }
}
