//! Reader of ArduPilot DataFlash logs (`.BIN`; ArduPilot, `libraries/AP_Logger`, and its developer documentation,
//! "Adding a new log message").
//!
//! A message is A3 95, a type, and the fields that the FMT message of the type lists. `TimeUS` is the stamp and no
//! field. Factors are applied: a field `GMS` in milliseconds has seconds if its unit is `s` with the factor 0.001.
//! Units and instances of a type are those known at its first message. Instance 0 of GPS is the topic `GPS`,
//! instance 1 is `GPS[1]`. PARM gives parameters and no topic.

mod format;

use std::collections::HashSet;

use self::format::{Definition, FMT_LENGTH, HEADER, Key, Plan, Tables, UnitLetters};
use super::stream::{Block, blocks};
use super::time::{Offsets, STAMP_TOO_LARGE, gps_utc_ns};
use crate::error::IoError;
use crate::input::Input;
use crate::sink::{Sink, Summary};

const MAGIC: [u8; 2] = [0xa3, 0x95];
const FMT: u8 = 0x80;

/// Bytes that must follow in a block so that a message and the header after a message within it can be seen.
const MARGIN: usize = 1024;

/// Limits for damaged files: an ArduPilot log has some 200 types and 3,000 fields.
const MOST_TOPICS: usize = 4096;
const MOST_FIELDS: usize = 200_000;
const MOST_PARAMETERS: usize = 100_000;

/// Why no message is read at a place.
#[derive(Clone, Copy, Debug)]
enum Reason {
    NoHeader,
    NoFormat(u8),
    Cut,
    Ends,
}

impl Reason {
    fn text(self) -> String {
        match self {
            Self::NoHeader => "no message begins here".to_owned(),
            Self::NoFormat(kind) => format!("messages of type {kind}, whose format is missing"),
            Self::Cut => "a message is cut".to_owned(),
            Self::Ends => {
                "the file ends within a message (truncated, or it is still being written)".to_owned()
            }
        }
    }
}

/// Whether a file is a DataFlash log: it begins with the header of a message, or its beginning has a whole FMT
/// message.
pub(crate) fn begins(head: &[u8]) -> bool {
    head.starts_with(&[MAGIC[0], MAGIC[1], FMT])
        || memchr::memmem::find_iter(head, &[MAGIC[0], MAGIC[1], FMT]).any(|at| {
            head.get(at + HEADER..at + FMT_LENGTH).is_some_and(|body| Definition::parse(body).is_ok())
        })
}

/// Reads a DataFlash log.
pub(crate) fn scan(input: &mut Input, sink: &mut dyn Sink) -> Result<Summary, IoError> {
    let mut reader = Reader::new();
    blocks(input, sink, |block, sink| reader.block(block, sink))?;
    if reader.messages == 0 {
        input.seek(0)?;
        return Err(input
            .damaged("no message of this DataFlash log is whole", "download it again from the autopilot"));
    }
    reader.summary.utc_offset_ns = reader.offsets.median();
    Ok(reader.summary)
}

/// A kind of message.
#[derive(Debug)]
struct Kind {
    definition: Definition,
    role: Role,
    letters: UnitLetters,
    plan: Option<Plan>,
    /// Instances with the number of their topic, and whether its rows are wanted.
    instances: Vec<(Key, Option<usize>, bool)>,
    /// Rows without time.
    rows: i64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Format,
    Unit,
    Factor,
    Units,
    Parameter,
    Rows,
    /// Defined a second time in another way.
    Refused,
}

/// Bytes without messages.
#[derive(Debug)]
struct Gap {
    offset: u64,
    reason: Reason,
    /// Whether all of them are zero.
    zero: bool,
}

#[derive(Default)]
struct Reader {
    kinds: Vec<Option<Box<Kind>>>,
    names: HashSet<String>,
    tables: Tables,
    gap: Option<Gap>,
    topics: usize,
    fields: usize,
    messages: u64,
    offsets: Offsets,
    values: Vec<f64>,
    summary: Summary,
}

impl Reader {
    fn new() -> Self {
        let mut reader =
            Self { kinds: (0..256).map(|_| None).collect(), tables: Tables::new(), ..Self::default() };
        // The FMT message of FMT itself, in case it is lost.
        let mut body = [0; FMT_LENGTH - HEADER];
        body[..11].copy_from_slice(b"\x80\x59FMT\0BBnNZ");
        body[22..56].copy_from_slice(b"Type,Length,Name,Format,Columns\0\0\0");
        reader.define(&body);
        reader
    }

    fn block(&mut self, block: Block<'_>, sink: &mut dyn Sink) -> usize {
        let bytes = block.bytes;
        let mut at = 0;
        while at < bytes.len() && (block.last || bytes.len() - at >= MARGIN) {
            let reason = match self.length(bytes, at) {
                Ok(length) if self.plausible(&block, at, length) => {
                    self.close_gap(block.place(at));
                    let place = block.place(at);
                    self.message(bytes[at + 2], &bytes[at + HEADER..at + length], place, sink);
                    at += length;
                    continue;
                }
                Ok(length) if at + length > bytes.len() => Reason::Ends,
                Ok(_) => Reason::Cut,
                Err(reason) => reason,
            };
            let from = at;
            at = memchr::memchr(MAGIC[0], &bytes[at + 1..]).map_or(bytes.len(), |next| at + 1 + next);
            if !block.last {
                at = at.min(bytes.len() - MARGIN + 1);
            }
            let offset = block.place(from);
            let gap = self.gap.get_or_insert(Gap { offset, reason, zero: true });
            gap.zero &= bytes[from..at].iter().all(|&byte| byte == 0);
        }
        if block.last {
            // A log in blocks of flash memory ends with zeros: they are not a loss.
            if self.gap.as_ref().is_some_and(|gap| gap.zero) {
                self.gap = None;
            }
            self.close_gap(block.place(at));
        }
        at
    }

    fn close_gap(&mut self, end: u64) {
        if let Some(gap) = self.gap.take() {
            self.summary.lose(gap.offset, end.saturating_sub(gap.offset), &gap.reason.text());
        }
    }

    /// Length of the message whose header is here, or why none is.
    fn length(&self, bytes: &[u8], at: usize) -> Result<usize, Reason> {
        match bytes.get(at..(at + HEADER).min(bytes.len())) {
            Some([first, second, kind]) if [*first, *second] == MAGIC => self.kinds[usize::from(*kind)]
                .as_ref()
                .map(|kind| kind.definition.length)
                .ok_or(Reason::NoFormat(*kind)),
            Some(rest)
                if !rest.is_empty()
                    && rest.len() < HEADER
                    && MAGIC.starts_with(&rest[..rest.len().min(2)]) =>
            {
                Err(Reason::Ends)
            }
            _ => Err(Reason::NoHeader),
        }
    }

    /// Whether the message at a header is one. After another message it is, unless a message begins within it.
    /// After a gap a header must follow it, because A3 95 also occurs in data.
    fn plausible(&self, block: &Block<'_>, at: usize, length: usize) -> bool {
        let bytes = block.bytes;
        if at + length > bytes.len() {
            return false;
        }
        if follows(block, at + length) {
            return true;
        }
        self.gap.is_none()
            && !memchr::memmem::find_iter(&bytes[at + 1..at + length], &MAGIC).any(|inner| {
                let inner = at + 1 + inner;
                self.length(bytes, inner)
                    .is_ok_and(|length| inner + length <= bytes.len() && follows(block, inner + length))
            })
    }

    fn message(&mut self, kind: u8, body: &[u8], place: u64, sink: &mut dyn Sink) {
        self.messages += 1;
        let Some(known) = self.kinds[usize::from(kind)].as_deref_mut() else { return };
        match known.role {
            Role::Rows => self.row(kind, body, place, sink),
            Role::Format => self.define(body),
            Role::Refused => {}
            Role::Unit => {
                let letter = known.definition.number(body, "Id").and_then(byte);
                if let (Some(letter), Some(label)) = (letter, known.definition.text(body, "Label")) {
                    self.tables.set_unit(letter, &label);
                }
            }
            Role::Factor => {
                let letter = known.definition.number(body, "Id").and_then(byte);
                if let (Some(letter), Some(factor)) = (letter, known.definition.number(body, "Mult")) {
                    self.tables.factors[usize::from(letter)] = factor;
                }
            }
            Role::Units => {
                let definition = &known.definition;
                let letters = UnitLetters {
                    units: definition.text(body, "UnitIds").unwrap_or_default(),
                    factors: definition.text(body, "MultIds").unwrap_or_default(),
                };
                if let Some(target) = definition.number(body, "FmtType").and_then(byte)
                    && let Some(target) = self.kinds[usize::from(target)].as_deref_mut()
                    && target.letters != letters
                {
                    if target.plan.is_some() {
                        let name = &target.definition.name;
                        self.summary.note(format!(
                            "units of {name} that are stated after its first message are ignored"
                        ));
                    } else {
                        target.letters = letters;
                    }
                }
            }
            Role::Parameter => {
                let value = known.definition.number(body, "Value");
                if let (Some(name), Some(value)) = (known.definition.text(body, "Name"), value)
                    && !name.is_empty()
                    && self.summary.parameters.len() < MOST_PARAMETERS
                {
                    self.summary.parameters.insert(name, value);
                }
            }
        }
    }

    /// Reads a FMT message.
    fn define(&mut self, body: &[u8]) {
        let (kind, definition) = match Definition::parse(body) {
            Ok(parsed) => parsed,
            Err(reason) => return self.summary.note(format!("{reason}: its messages are left out")),
        };
        let place = &mut self.kinds[usize::from(kind)];
        if place.as_ref().is_some_and(|known| known.definition == definition) {
            return;
        }
        let used = place.as_ref().is_some_and(|known| known.plan.is_some() || known.role == Role::Format);
        // A type that is left out has not the name.
        if let Some(known) = place.as_ref().filter(|known| !used && known.role != Role::Refused) {
            self.names.remove(&known.definition.name);
        }
        // Another type may have the name.
        let refused = used || !self.names.insert(definition.name.clone());
        let role = match definition.name.as_str() {
            _ if refused => Role::Refused,
            "FMT" => Role::Format,
            "UNIT" => Role::Unit,
            "MULT" => Role::Factor,
            "FMTU" => Role::Units,
            "PARM" => Role::Parameter,
            _ => Role::Rows,
        };
        if refused {
            let name = &definition.name;
            self.summary
                .note(format!("{name} is defined again in another way: its later messages are left out"));
        }
        if used && kind == FMT {
            return;
        }
        let letters = place.take().map(|known| known.letters).unwrap_or_default();
        *place =
            Some(Box::new(Kind { definition, role, letters, plan: None, instances: Vec::new(), rows: 0 }));
    }

    fn row(&mut self, kind: u8, body: &[u8], place: u64, sink: &mut dyn Sink) {
        let Some(known) = self.kinds[usize::from(kind)].as_deref_mut() else { return };
        let plan =
            known.plan.get_or_insert_with(|| Plan::new(&known.definition, &known.letters, &self.tables));
        let key = plan.instance(body);
        let instance = known.instances.iter().find(|(of, ..)| *of == key).copied();
        let (_, topic, wanted) = instance.unwrap_or_else(|| {
            let fits = self.topics < MOST_TOPICS && self.fields + plan.record.fields.len() <= MOST_FIELDS;
            let mut stated = (key, None, false);
            if fits {
                let name = &known.definition.name;
                let topic = plan.record.topic(format!("{name}{}", plan.instance_name(body)), name, body);
                stated = (key, Some(self.topics), sink.topic(self.topics, &topic));
                self.topics += 1;
                self.fields += plan.record.fields.len();
            }
            if fits || known.instances.len() < MOST_TOPICS {
                known.instances.push(stated);
            }
            stated
        });
        if let (Some((week, millisecond)), Some(time)) = (plan.gps_time(body), plan.record.time(body))
            && let Some(utc) = gps_utc_ns(week, millisecond)
        {
            self.offsets.add(utc.saturating_sub(time));
        }
        match topic {
            None => self.summary.note("the file has more topics than are read; the last ones are left out"),
            Some(topic) => {
                if wanted && !plan.record.give(topic, body, known.rows, &mut self.values, sink) {
                    self.summary.lose(place, (HEADER + body.len()) as u64, STAMP_TOO_LARGE);
                }
            }
        }
        known.rows += 1;
    }
}

/// Whether a message can end here: a header, the end of the file, or zeros follow.
fn follows(block: &Block<'_>, at: usize) -> bool {
    let rest = block.bytes.get(at..).unwrap_or_default();
    let zeros = &rest[..rest.len().min(MARGIN / 4)];
    match rest {
        [] => block.last,
        [first] => block.last && *first == MAGIC[0],
        [first, second, ..] => [*first, *second] == MAGIC || zeros.iter().all(|&byte| byte == 0),
    }
}

fn byte(number: f64) -> Option<u8> {
    // A letter is a signed character in the file.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the range is checked")]
    (-128.0..256.0).contains(&number).then_some(number as i16 as u8)
}
