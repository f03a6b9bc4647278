//! Parts of a package as XML with limits: a part of a few kilobytes can hold gigabytes of text.

use std::cell::Cell;
use std::io::{self, BufRead, BufReader, Read};
use std::rc::Rc;

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

/// Longest tag or text. A cell has at most 32,767 characters.
const LONGEST_EVENT: usize = 1 << 20;

/// Why a part cannot be read further.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    Bomb,
    Damaged,
}

/// What a part holds, step by step.
#[derive(Debug)]
pub(super) enum Step<'a> {
    /// A tag that is opened, and whether it is closed as well.
    Open(&'a BytesStart<'a>, bool),
    Close(&'a [u8]),
    /// A piece of text.
    Text(&'a str),
    End,
}

/// A part of the package.
pub(super) struct Xml<R: Read> {
    reader: Reader<Limited<BufReader<R>>>,
    buffer: Vec<u8>,
    /// Tags that are open. A part that ends before they are closed is cut.
    open: usize,
}

impl<R: Read> Xml<R> {
    /// A part, with the bytes that are left for all parts.
    pub(super) fn new(content: R, left: Rc<Cell<u64>>) -> Self {
        let limited = Limited { content: BufReader::new(content), event: 0, left, over: false };
        Self { reader: Reader::from_reader(limited), buffer: Vec::new(), open: 0 }
    }

    /// The next step.
    pub(super) fn next<T>(&mut self, take: impl FnOnce(Step<'_>) -> T) -> Result<T, Stop> {
        loop {
            self.buffer.clear();
            self.reader.get_mut().event = LONGEST_EVENT;
            let Ok(event) = self.reader.read_event_into(&mut self.buffer) else {
                return Err(if self.reader.get_mut().over { Stop::Bomb } else { Stop::Damaged });
            };
            let step = match &event {
                Event::Start(tag) => {
                    self.open += 1;
                    Step::Open(tag, false)
                }
                Event::Empty(tag) => Step::Open(tag, true),
                Event::End(tag) => {
                    // The reader refuses an end without a beginning.
                    self.open = self.open.saturating_sub(1);
                    return Ok(take(Step::Close(tag.local_name().as_ref().as_bytes())));
                }
                Event::Text(text) => return Ok(take(Step::Text(&text.xml10_content()))),
                Event::CData(text) => return Ok(take(Step::Text(&text.xml10_content()))),
                Event::GeneralRef(name) => {
                    let letter = match &*name.xml10_content() {
                        "amp" => Some('&'),
                        "lt" => Some('<'),
                        "gt" => Some('>'),
                        "quot" => Some('"'),
                        "apos" => Some('\''),
                        _ => name.resolve_char_ref().ok().flatten(),
                    };
                    return Ok(take(Step::Text(letter.unwrap_or('?').encode_utf8(&mut [0; 4]))));
                }
                Event::Eof if self.open > 0 => return Err(Stop::Damaged),
                Event::Eof => Step::End,
                _ => continue,
            };
            return Ok(take(step));
        }
    }
}

/// Longest attribute that is kept: the longest text of a cell.
pub(super) const LONGEST_ATTRIBUTE: usize = 32_767;

/// Value of an attribute of a tag; none if it is too long.
pub(super) fn attribute(tag: &BytesStart<'_>, name: &str) -> Option<String> {
    let found = tag
        .attributes()
        .with_checks(false)
        .flatten()
        .find(|known| known.key.local_name().as_ref() == name)
        .filter(|known| known.value.len() <= LONGEST_ATTRIBUTE)?;
    Some(found.normalized_value(XmlVersion::Implicit1_0).ok()?.into_owned())
}

/// Bytes with a limit for all parts and for each event.
struct Limited<B> {
    content: B,
    event: usize,
    left: Rc<Cell<u64>>,
    over: bool,
}

impl<B: BufRead> Read for Limited<B> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let size = self.fill_buf()?.read(into)?;
        self.consume(size);
        Ok(size)
    }
}

impl<B: BufRead> BufRead for Limited<B> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.event == 0 || self.left.get() == 0 {
            self.over = true;
            return Err(io::Error::other("the part is longer than the limit"));
        }
        self.content.fill_buf()
    }

    fn consume(&mut self, size: usize) {
        self.event = self.event.saturating_sub(size);
        self.left.set(self.left.get().saturating_sub(size as u64));
        self.content.consume(size);
    }
}
