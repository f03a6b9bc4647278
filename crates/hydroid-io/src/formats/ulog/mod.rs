//! Reader of PX4 ULog (PX4 Guide, "ULog File Format", version 1).
//!
//! `timestamp` is the stamp and no field. Instance 0 of `sensor_gps` is the topic `sensor_gps`, instance 1 is
//! `sensor_gps[1]`. The format states no units: they follow from the ends of PX4's names (`_m_s2`, `_rad`).
//! After damage the reader goes on where a message begins that is possible and that another one follows.

mod format;

use self::format::{Formats, Plan, number};
use super::number::chunk;
use super::stream::{Block, blocks};
use super::time::{Offsets, STAMP_TOO_LARGE};
use crate::error::IoError;
use crate::input::Input;
use crate::sink::{Sink, Summary};

/// Length of the header of the file.
const FILE_HEADER: usize = 16;

/// Length of the header of a message: its length and type.
const HEADER: usize = 3;

const SYNC: [u8; 8] = [0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12];

/// Bytes that must follow in a block so that a message and those after it that [`Reader::follows`] looks at can be
/// seen.
const MARGIN: usize = 3 * (1 << 16);

/// Longest name, with what precedes it.
const LONGEST_NAME: usize = 300;

/// Longest message of an unknown type or topic, and longest text, that is taken for one.
const LONGEST_UNKNOWN: usize = 4096;

/// Types of messages.
const TYPES: &[u8] = b"BFIMPQARDLCSO";

/// Limits for damaged files.
const MOST_TOPICS: usize = 4096;
const MOST_FIELDS: usize = 100_000;
const MOST_PARAMETERS: usize = 100_000;

const NO_MESSAGE: &str = "no message begins here";
const ENDS: &str = "the file ends within a message (truncated, or it is still being written)";

/// Reads a ULog.
pub(crate) fn scan(input: &mut Input, sink: &mut dyn Sink) -> Result<Summary, IoError> {
    let header = input.window(FILE_HEADER)?;
    let version = header.get(7).copied();
    let (Some(version), true) = (version, header.len() >= FILE_HEADER) else {
        return Err(input.damaged("the header of this ULog is cut", "download it again from the autopilot"));
    };
    let mut reader = Reader::default();
    if version > 1 {
        reader.summary.note(format!("ULog version {version} is newer than the version that is known, 1"));
    }
    input.skip(FILE_HEADER as u64)?;
    blocks(input, sink, |block, sink| reader.block(block, sink))?;
    if reader.messages == 0 {
        input.seek((FILE_HEADER as u64).min(input.length()))?;
        return Err(input.damaged("no message of this ULog is whole", "download it again from the autopilot"));
    }
    reader.summary.utc_offset_ns = reader.offsets.median();
    Ok(reader.summary)
}

/// A topic with a plan for its data.
#[derive(Debug)]
struct Known {
    name: String,
    instance: u8,
    plan: Plan,
    /// Number for the sink and whether its rows are wanted, from the first row on.
    stated: Option<(usize, bool)>,
    /// Whether the time of UTC of its messages counts.
    utc: bool,
    rows: i64,
}

/// What the number in a message of data stands for.
#[derive(Clone, Debug)]
enum Subscription {
    /// Index of a topic.
    To(usize),
    /// Reason why the data cannot be read.
    Unreadable(String),
}

/// Whether a message can be at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Possible {
    Yes,
    /// Its type or topic is unknown, its length is small.
    Unknown,
    No,
}

/// End of the message whose header is here; behind the end of the bytes if there is none.
fn end_of(bytes: &[u8], at: usize) -> usize {
    chunk(bytes, at)
        .map_or(bytes.len() + 1, |[low, high, _]| at + HEADER + usize::from(u16::from_le_bytes([low, high])))
}

#[derive(Default)]
struct Reader {
    formats: Formats,
    /// By their numbers.
    subscriptions: Vec<Option<Subscription>>,
    known: Vec<Known>,
    /// Places in the file where data have been appended, perhaps within a message.
    appended: Vec<u64>,
    /// First byte of a part without messages, and what is wrong.
    gap: Option<(u64, &'static str)>,
    topics: usize,
    fields: usize,
    messages: u64,
    offsets: Offsets,
    values: Vec<f64>,
    summary: Summary,
}

impl Reader {
    fn block(&mut self, block: Block<'_>, sink: &mut dyn Sink) -> usize {
        let bytes = block.bytes;
        let mut at = 0;
        while at < bytes.len() && (block.last || bytes.len() - at >= MARGIN) {
            let here = block.place(at);
            let end = end_of(bytes, at);
            if end <= bytes.len() && self.accepts(&block, at, end) {
                self.close_gap(here);
                self.message(bytes[at + 2], &bytes[at + HEADER..end], here, sink);
                at = end;
                continue;
            }
            if self.gap.is_none() {
                let cut = end > bytes.len() && self.possible(bytes, at) != Possible::No;
                let cut = cut || bytes.len() - at < HEADER;
                self.gap = Some((here, if cut { ENDS } else { NO_MESSAGE }));
            }
            at += 1;
            // Only a known type ends a gap; the type is the third byte.
            let end = if block.last { bytes.len() } else { bytes.len() - MARGIN };
            while at + 2 < end && !TYPES.contains(&bytes[at + 2]) {
                at += 1;
            }
        }
        if block.last {
            self.close_gap(block.place(at));
        }
        at
    }

    fn close_gap(&mut self, end: u64) {
        if let Some((start, reason)) = self.gap.take() {
            self.summary.lose(start, end.saturating_sub(start), reason);
        }
    }

    /// Whether a message is here. After another message it must be possible and no message may begin within it,
    /// which would show that it is cut. After a gap another message must follow, because short headers also occur
    /// in data.
    fn accepts(&self, block: &Block<'_>, at: usize, end: usize) -> bool {
        let bytes = block.bytes;
        let (from, to) = (block.place(at), block.place(end));
        if self.appended.iter().any(|&place| from < place && place < to) {
            return false;
        }
        match self.possible(bytes, at) {
            Possible::Yes if self.gap.is_some() => {
                bytes[at + HEADER..].starts_with(&SYNC) || self.follows(block, end)
            }
            Possible::Yes => self.follows(block, end) || !self.begins_within(block, at, end),
            Possible::Unknown => self.gap.is_none() && self.follows(block, end),
            Possible::No => false,
        }
    }

    /// Whether a possible message follows, perhaps after a few of unknown types, or the end of the file.
    fn follows(&self, block: &Block<'_>, mut at: usize) -> bool {
        for _ in 0..8 {
            if at >= block.bytes.len() {
                return block.last;
            }
            match self.possible(block.bytes, at) {
                Possible::Yes => return true,
                Possible::Unknown => at = end_of(block.bytes, at),
                Possible::No => return false,
            }
        }
        false
    }

    /// Whether a message that another one follows begins within the message here.
    fn begins_within(&self, block: &Block<'_>, at: usize, end: usize) -> bool {
        (at + 1..end).any(|inner| {
            self.possible(block.bytes, inner) == Possible::Yes && {
                let after = end_of(block.bytes, inner);
                after <= block.bytes.len() && self.follows(block, after)
            }
        })
    }

    fn subscription(&self, id: u16) -> Option<&Subscription> {
        self.subscriptions.get(usize::from(id))?.as_ref()
    }

    /// Whether the header and data here can be those of a message.
    fn possible(&self, bytes: &[u8], at: usize) -> Possible {
        let Some([low, high, kind]) = chunk(bytes, at) else { return Possible::No };
        let length = usize::from(u16::from_le_bytes([low, high]));
        let data = bytes.get(at + HEADER..).unwrap_or_default();
        let data = &data[..data.len().min(length).min(LONGEST_NAME)];
        let key = |skip: usize| {
            let size = data.get(skip).copied().map_or(0, usize::from);
            let key = data.get(skip + 1..skip + 1 + size).unwrap_or_default();
            size > 5
                && length <= LONGEST_UNKNOWN
                && key.contains(&b' ')
                && key.iter().all(|byte| byte.is_ascii_graphic() || *byte == b' ')
        };
        // A text behind its level and, at `time`, the microseconds since the start, which do not fill 64 bits.
        let logged = |time: usize| {
            let text = data.iter().skip(time + 8).take(40);
            length >= time + 8
                && length <= LONGEST_UNKNOWN
                && data.first().is_some_and(|level| (b'0'..=b'7').contains(level))
                && data.get(time + 7).is_none_or(|&byte| byte == 0)
                && text.clone().all(|&byte| byte >= b' ' || matches!(byte, b'\n' | b'\r' | b'\t' | 0x1b | 0))
        };
        let possible = match kind {
            b'D' => match chunk(data, 0).and_then(|id| self.subscription(u16::from_le_bytes(id))) {
                Some(Subscription::To(index)) => {
                    let plan = &self.known[*index].plan;
                    // Longer data may have fields that the format lacks.
                    if length > plan.longest + 2 && length <= LONGEST_UNKNOWN {
                        return Possible::Unknown;
                    }
                    (plan.shortest + 2..=plan.longest + 2).contains(&length)
                }
                // The subscription may be lost.
                _ if (3..=LONGEST_UNKNOWN).contains(&length) => return Possible::Unknown,
                _ => false,
            },
            b'B' => (40..=LONGEST_NAME).contains(&length),
            b'F' => memchr::memchr(b':', data).is_some_and(|size| {
                size > 0 && data[..size].iter().all(|byte| byte.is_ascii_alphanumeric() || *byte == b'_')
            }),
            b'I' | b'P' => key(0),
            b'M' | b'Q' => key(1),
            b'A' => (4..LONGEST_NAME).contains(&length) && data.iter().skip(3).all(u8::is_ascii_graphic),
            b'R' | b'O' => length == 2,
            b'L' => logged(1),
            b'C' => logged(3),
            b'S' => length == SYNC.len() && SYNC.starts_with(data),
            _ if kind.is_ascii_uppercase() && (1..=LONGEST_UNKNOWN).contains(&length) => {
                return Possible::Unknown;
            }
            _ => false,
        };
        if possible { Possible::Yes } else { Possible::No }
    }

    fn message(&mut self, kind: u8, data: &[u8], place: u64, sink: &mut dyn Sink) {
        self.messages += 1;
        match kind {
            b'D' => self.data(data, place, sink),
            b'F' => {
                if let Err(reason) = self.formats.add(data) {
                    self.summary.note(reason);
                }
            }
            b'A' => self.subscribe(data),
            b'P' => self.parameter(data),
            b'O' => {
                let duration = chunk(data, 0).map_or(0, u16::from_le_bytes);
                self.summary.lose(place, 0, &format!("the logger states a dropout of {duration} ms"));
            }
            b'B' => self.flags(data),
            b'I' | b'M' | b'Q' | b'R' | b'L' | b'C' | b'S' => {}
            _ => {
                self.summary.note(format!("messages of the unknown type {} are skipped", char::from(kind)));
            }
        }
    }

    /// Message `B`: features of the file, and places where data have been appended.
    fn flags(&mut self, data: &[u8]) {
        let known = [1, 0, 0, 0, 0, 0, 0, 0];
        if (8..16).zip(known).any(|(i, known)| data.get(i).is_some_and(|flags| flags & !known != 0)) {
            self.summary.note("the file has features that are not known; its values may be wrong");
        }
        if data.get(8).is_some_and(|flags| flags & 1 != 0) {
            let places = (0..3).filter_map(|i| chunk(data, 16 + 8 * i).map(u64::from_le_bytes));
            self.appended = places.filter(|&place| place != 0).collect();
        }
    }

    fn parameter(&mut self, data: &[u8]) {
        let Some((&size, rest)) = data.split_first() else { return };
        let size = usize::from(size);
        let key = rest.get(..size).and_then(|key| std::str::from_utf8(key).ok());
        let Some((type_name, name)) = key.and_then(|key| key.split_once(' ')) else { return };
        let Some(number) = number(type_name).filter(|number| rest.len() >= size + number.size()) else {
            return;
        };
        if self.summary.parameters.len() < MOST_PARAMETERS {
            self.summary.parameters.insert(name.to_owned(), number.read(rest, size));
        }
    }

    /// Message `A`: the number of a topic.
    fn subscribe(&mut self, data: &[u8]) {
        let (Some(instance), Some(id), Some(name)) = (data.first(), chunk(data, 1), data.get(3..)) else {
            return;
        };
        let (instance, id, name) = (*instance, u16::from_le_bytes(id), String::from_utf8_lossy(name));
        let same = self.known.iter().position(|known| known.instance == instance && known.name == name);
        let subscription = match same {
            Some(index) => Subscription::To(index),
            None => match self.plan(&name) {
                Ok(plan) => {
                    for field in &plan.left_out {
                        self.summary.note(format!("{name}.{field} is left out: the array is too long"));
                    }
                    let utc = matches!(&*name, "sensor_gps" | "vehicle_gps_position");
                    let name = name.into_owned();
                    self.known.push(Known { name, instance, plan, stated: None, utc, rows: 0 });
                    Subscription::To(self.known.len() - 1)
                }
                Err(reason) => {
                    self.summary.note(format!("{name} cannot be read: {reason}"));
                    Subscription::Unreadable(format!("data of {name}: {reason}"))
                }
            },
        };
        let id = usize::from(id);
        if self.subscriptions.len() <= id {
            self.subscriptions.resize(id + 1, None);
        }
        self.subscriptions[id] = Some(subscription);
    }

    fn plan(&mut self, name: &str) -> Result<Plan, String> {
        if self.fields > MOST_FIELDS || self.known.len() >= MOST_TOPICS {
            return Err("the file has too many topics and fields".to_owned());
        }
        let plan = self.formats.plan(name);
        // A format that cannot be read costs time, too.
        self.fields += plan.as_ref().map_or(1000, |plan| plan.steps + plan.record.fields.len());
        plan
    }

    fn data(&mut self, data: &[u8], place: u64, sink: &mut dyn Sink) {
        let Some((id, data)) = data.split_first_chunk().map(|(id, data)| (u16::from_le_bytes(*id), data))
        else {
            return;
        };
        let length = (data.len() + 2 + HEADER) as u64;
        let known = match self.subscriptions.get(usize::from(id)).and_then(Option::as_ref) {
            Some(Subscription::To(index)) => &mut self.known[*index],
            Some(Subscription::Unreadable(reason)) => return self.summary.lose(place, length, reason),
            None => {
                return self.summary.lose(
                    place,
                    length,
                    &format!("data with the number {id}, which no topic has"),
                );
            }
        };
        let plan = &known.plan;
        if known.utc
            && let (Some(utc), Some(time)) = (plan.utc(data), plan.record.time(data))
        {
            self.offsets.add(utc.saturating_sub(time));
        }
        let (topic, wanted) = *known.stated.get_or_insert_with(|| {
            let instance = if known.instance == 0 { String::new() } else { format!("[{}]", known.instance) };
            let topic = plan.record.topic(format!("{}{instance}", known.name), &known.name, data);
            self.topics += 1;
            (self.topics - 1, sink.topic(self.topics - 1, &topic))
        });
        if wanted && !plan.record.give(topic, data, known.rows, &mut self.values, sink) {
            self.summary.lose(place, length, STAMP_TOO_LARGE);
        }
        known.rows += 1;
    }
}
