//! Reader of NMEA 0183 sentences, one a line (IEC 61162-1).
//!
//! The topic of a sentence is its formatter: `HDT`. The same sentence of a second talker is the topic `HDT[GP]`,
//! of a second shaft `RPM[S2]`, of the true wind behind the apparent one `MWV[T]`: what differs from the first one
//! is in the brackets. Empty fields are NaN. `valid` is 1 for A and 0 for V.
//!
//! Stamps are the times of arrival in front of the sentences (ISO 8601, Unix time, or the tag `c`); then `utc_s`
//! alone has the time in a sentence. Without, a sentence has the time of the last one that states a time, with the
//! date of RMC or ZDA, or from midnight if the first MB has no date. Without any time the sentences are numbered. A sentence
//! that comes several times between two times is spread evenly over the time between, and a note says how often.

mod arrival;
mod line;
mod sentence;
mod spread;
mod time;

use std::collections::BTreeMap;

use self::line::{Line, has_sentence};
use self::sentence::Sentence;
use self::spread::Spread;
use self::time::Times;
use super::stream::{BLOCK, Block, blocks};
use crate::error::IoError;
use crate::input::Input;
use crate::sink::{Sink, Summary, Topic};

/// Longest line; NMEA 0183 allows 82 characters, a tag block and a time come on top.
const LONGEST_LINE: usize = 4096;

/// Limits for damaged files.
const MOST_TOPICS: usize = 1000;
const MOST_OTHERS: usize = 50;

/// Whether a text is NMEA 0183: most of its lines have a sentence.
pub(crate) fn begins(head: &[u8]) -> bool {
    let whole = if head.len() < 64 << 10 { head.len() } else { memchr::memrchr(b'\n', head).unwrap_or(0) };
    let (mut lines, mut sentences) = (0, 0);
    for line in head[..whole].split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii) {
        if !line.is_empty() {
            lines += 1;
            sentences += usize::from(line.len() <= LONGEST_LINE && has_sentence(line));
        }
    }
    sentences * 2 > lines
}

/// Reads a file of NMEA 0183 sentences.
pub(crate) fn scan(input: &mut Input, sink: &mut dyn Sink) -> Result<Summary, IoError> {
    let times = Times::new(input.window(BLOCK)?);
    let mut reader = Reader {
        times,
        topics: Vec::new(),
        long: None,
        sentences: 0,
        others: BTreeMap::new(),
        spread: Spread::default(),
        values: Vec::new(),
        summary: Summary::default(),
    };
    blocks(input, sink, |block, sink| reader.block(block, sink))?;
    reader.spread.flush(None, sink);
    if reader.sentences == 0 {
        input.seek(0)?;
        return Err(input.damaged("no NMEA 0183 sentence is whole", "check how the file was transferred"));
    }
    if !reader.others.is_empty() {
        let others: Vec<String> =
            reader.others.iter().map(|(name, count)| format!("{name} {count}")).collect();
        reader
            .summary
            .note(format!("sentences that are not read, with their numbers: {}", others.join(", ")));
    }
    for (topic, known) in reader.topics.iter().enumerate() {
        let spread = reader.spread.spread(topic);
        if spread > 0 {
            reader.summary.note(format!(
                "{spread} of {} sentences {} come behind another one without a time between them, and are spread evenly up to the next time: record the time of arrival in front of each sentence",
                known.count,
                String::from_utf8_lossy(&known.sentence.formatter),
            ));
        }
    }
    reader.times.notes(&mut reader.summary);
    Ok(reader.summary)
}

/// A sentence of a talker.
#[derive(Debug)]
struct Known {
    talker: [u8; 2],
    /// Values of the fields that tell topics apart.
    variant: [u8; 4],
    sentence: &'static Sentence,
    wanted: bool,
    checksum: bool,
    /// Number of sentences.
    count: u64,
}

struct Reader {
    times: Times,
    topics: Vec<Known>,
    /// First byte of a line that is too long.
    long: Option<u64>,
    sentences: u64,
    /// Numbers of the sentences that are not read.
    others: BTreeMap<String, u64>,
    spread: Spread,
    values: Vec<f64>,
    summary: Summary,
}

impl Reader {
    fn block(&mut self, block: Block<'_>, sink: &mut dyn Sink) -> usize {
        let bytes = block.bytes;
        let mut at = 0;
        while at < bytes.len() {
            let newline = memchr::memchr(b'\n', &bytes[at..]);
            let end = match newline {
                Some(size) => at + size + 1,
                None if block.last => bytes.len(),
                None if bytes.len() - at > LONGEST_LINE => {
                    self.long.get_or_insert(block.place(at));
                    return bytes.len();
                }
                None => return at,
            };
            let start = self.long.take().unwrap_or(block.place(at));
            let size = block.place(end) - start;
            if size > LONGEST_LINE as u64 {
                self.summary.lose(start, size, "a line that is too long for a sentence");
            } else if let Err(reason) = self.line(&bytes[at..end], newline.is_some(), sink) {
                self.summary.lose(start, size, reason);
            }
            at = end;
        }
        at
    }

    fn line(&mut self, line: &[u8], ended: bool, sink: &mut dyn Sink) -> Result<(), &'static str> {
        let text = line.trim_ascii_end();
        if text.is_empty() {
            return Ok(());
        }
        let line = Line::parse(text)?;
        if !line.checksum && !ended {
            return Err("the file ends within a line (truncated, or it is still being written)");
        }
        let Some(sentence) = line.formatter().and_then(Sentence::of) else {
            self.other(&line);
            return Ok(());
        };
        let (formatter, talker) = (sentence.formatter, line.talker());
        let (fields, count) = line.fields();
        let fields = &fields[..count];
        if count < sentence.least && !line.checksum {
            return Err("a sentence that is cut");
        }
        let variant = variant(sentence, fields);
        let same = |known: &Known| known.sentence.formatter == formatter && known.talker == talker;
        if !line.checksum && self.topics.iter().any(|known| same(known) && known.checksum) {
            return Err("a sentence that is cut");
        }
        let stamp = self.times.stamp(line.prefix, sentence, fields)?;
        self.sentences += 1;
        let found = self.topics.iter().position(|known| same(known) && known.variant == variant);
        let topic = found.unwrap_or(self.topics.len());
        let known = match found {
            Some(index) => &mut self.topics[index],
            None if self.topics.len() >= MOST_TOPICS => {
                return Err("a sentence of one more talker than are read");
            }
            None => {
                let name = self.name(formatter, talker, variant);
                let clock = self.times.clock();
                let text = String::from_utf8_lossy(&formatter).into_owned();
                let stated =
                    Topic { name, type_name: text, clock, fields: sentence.fields(), texts: Vec::new() };
                let wanted = sink.topic(topic, &stated);
                let known = Known { talker, variant, sentence, wanted, checksum: false, count: 0 };
                self.topics.push_mut(known)
            }
        };
        known.checksum |= line.checksum;
        known.count += 1;
        if known.wanted {
            known.sentence.read(fields, &mut self.values);
            if self.times.are_stated() {
                self.spread.row(topic, stamp, &self.values, sink);
            } else {
                sink.row(topic, stamp, None, &self.values);
            }
        }
        Ok(())
    }

    /// The formatter, and in brackets what differs from the first topic of the sentence.
    fn name(&self, formatter: [u8; 3], talker: [u8; 2], variant: [u8; 4]) -> String {
        let text = |bytes: &[u8]| super::number::text(bytes);
        let Some(first) = self.topics.iter().find(|known| known.sentence.formatter == formatter) else {
            return text(&formatter);
        };
        let mut parts = Vec::new();
        if first.talker != talker {
            parts.push(text(&talker));
        }
        if first.variant != variant {
            parts.push(text(&variant));
        }
        format!("{}[{}]", text(&formatter), parts.join(" "))
    }

    /// Counts a sentence that is not read.
    fn other(&mut self, line: &Line<'_>) {
        self.sentences += 1;
        self.times.see(line.prefix);
        let name = String::from_utf8_lossy(&line.address[..line.address.len().min(8)]).into_owned();
        let name = if self.others.len() < MOST_OTHERS || self.others.contains_key(&name) {
            name
        } else {
            "others".to_owned()
        };
        *self.others.entry(name).or_insert(0) += 1;
    }
}

/// The first bytes of the fields that tell topics apart.
fn variant(sentence: &Sentence, fields: &[&[u8]]) -> [u8; 4] {
    let mut variant = [0; 4];
    let bytes = sentence.variant.iter().filter_map(|&at| fields.get(at)).flat_map(|field| field.iter());
    for (place, byte) in variant.iter_mut().zip(bytes) {
        *place = *byte;
    }
    variant
}
