//! Messages of ROS: their definitions, compiled to plans, and the topics that they become.
//!
//! `schema` and `idl` read definitions, `common` has those that old bags lack, `plan` compiles them, `decode` executes
//! the plan for each message. `shape` gives types to programs that receive messages.

mod common;
mod decode;
mod idl;
mod plan;
pub(crate) mod schema;
pub(crate) mod shape;

use std::cell::Cell;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::rc::Rc;

use self::decode::{Cursor, Fault, Row};
use self::plan::{Budget, Plan};
pub(crate) use self::schema::LONGEST_DEFINITION;
use self::schema::Schema;
use super::unpack::{Codec, Unpacker, ZSTD_MAGIC};
use crate::sink::{Clock, Field, Sink, Summary, Topic};

/// Memory of all definitions and plans, in bytes.
const BUDGET: usize = 128 << 20;

/// Topics of a file, and channels, several of which may be one topic. The definition of each channel is compared with
/// the known ones.
const MOST_TOPICS: usize = 10_000;

/// Index of a topic that is left out.
const LEFT_OUT: usize = usize::MAX;

/// Bytes behind a message that are padding.
const PADDING: usize = 8;

/// What a file says about the messages of a channel. Channels that say the same are one topic.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Channel {
    pub(crate) topic: String,
    pub(crate) type_name: String,
    /// Encoding of the messages: `cdr`, `ros1`; others cannot be decoded.
    pub(crate) encoding: String,
    /// Encoding of the definition: `ros2msg`, `ros2idl`, `ros1msg`, or none.
    pub(crate) definition_encoding: String,
    pub(crate) definition: String,
    /// Units of fields, by the names of the fields.
    pub(crate) units: BTreeMap<String, String>,
}

/// Stamps of a message, and its place in the file for the statement of a loss.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Envelope {
    pub(crate) received_ns: i64,
    /// Stamp of the sender outside the message; `None` if the file has none.
    pub(crate) sent_ns: Option<i64>,
    pub(crate) offset: u64,
}

/// Where rows and losses go.
pub(crate) struct Output<'a> {
    pub(crate) sink: &'a mut dyn Sink,
    pub(crate) summary: Summary,
}

/// A topic with the plan of its messages.
struct Entry {
    topic: Topic,
    channel: Rc<Channel>,
    plan: State,
    /// Number of the topic for the sink, and whether its rows are wanted.
    stated: Option<(usize, bool)>,
    /// Whether a note says that messages have more bytes than their definition.
    longer: bool,
}

enum State {
    New,
    Undecodable,
    Ready(Box<Plan>),
}

/// The topics of a file.
pub(crate) struct Topics {
    entries: Vec<Entry>,
    known: HashMap<Rc<Channel>, usize>,
    names: HashSet<String>,
    budget: Budget,
    /// Number of channels.
    channels: usize,
    stated: usize,
    row: Row,
    /// Also for the chunks of the file: what it unpacks is limited as a whole.
    pub(crate) unpacker: Unpacker,
    unpacked: Vec<u8>,
}

impl Topics {
    /// Those of a file of this length.
    pub(crate) fn new(length: u64) -> Self {
        Self {
            entries: Vec::new(),
            known: HashMap::new(),
            names: HashSet::new(),
            budget: Rc::new(Cell::new(BUDGET)),
            channels: 0,
            stated: 0,
            row: Row::default(),
            unpacker: Unpacker::new(length),
            unpacked: Vec::new(),
        }
    }

    /// Takes memory for definitions; an error if the file has had its share.
    pub(crate) fn spend(&self, bytes: usize) -> Result<(), String> {
        plan::spend(&self.budget, bytes)
    }

    /// Index of the topic of a channel; [`LEFT_OUT`], with a note, if there are too many.
    pub(crate) fn add(&mut self, channel: Channel, summary: &mut Summary) -> usize {
        self.channels += 1;
        let known = if self.channels > MOST_TOPICS { None } else { self.known.get(&channel) };
        if let Some(&index) = known {
            return index;
        }
        let Channel { topic, type_name, encoding, definition_encoding, definition, units } = &channel;
        let texts = [topic, type_name, encoding, definition_encoding, definition];
        let size = texts.into_iter().chain(units.keys()).chain(units.values());
        let size = size.map(String::len).fold(size_of::<Entry>(), usize::saturating_add);
        let fits = channel.definition.len() <= LONGEST_DEFINITION && channel.topic.len() <= LONGEST_TOPIC;
        if self.channels > MOST_TOPICS || !fits || self.spend(size.saturating_mul(2)).is_err() {
            let name: String = channel.topic.chars().take(60).collect();
            summary.note(format!("{name} is left out: the definitions of the file are too big"));
            return LEFT_OUT;
        }
        let mut name = channel.topic.clone();
        if self.names.contains(&name) {
            name = format!("{} ({})", channel.topic, channel.type_name);
            let base = name.clone();
            let mut number = 1;
            while self.names.contains(&name) {
                number += 1;
                name = format!("{base} {number}");
            }
        }
        self.names.insert(name.clone());
        let channel = Rc::new(channel);
        self.known.insert(Rc::clone(&channel), self.entries.len());
        let topic = Topic {
            name,
            type_name: channel.type_name.clone(),
            clock: Clock::Utc,
            fields: Vec::new(),
            texts: Vec::new(),
        };
        self.entries.push(Entry { topic, channel, plan: State::New, stated: None, longer: false });
        self.entries.len() - 1
    }

    /// Whether the messages of a topic are to be decoded: its rows are wanted, or it may get more fields.
    pub(crate) fn needs(&self, index: usize) -> bool {
        self.entries.get(index).is_some_and(|entry| match &entry.plan {
            State::New => true,
            State::Undecodable => false,
            State::Ready(plan) => entry.stated.is_none_or(|(_, wanted)| wanted) || plan.grows(),
        })
    }

    /// Decodes a message of a topic, states the topic if it is new or has grown, and gives the row if it is wanted.
    pub(crate) fn message(&mut self, index: usize, data: &[u8], envelope: Envelope, output: &mut Output) {
        if !self.needs(index) {
            return;
        }
        let Some(entry) = self.entries.get_mut(index) else { return };
        if let State::New = entry.plan {
            entry.plan = match prepare(&entry.channel, &self.budget) {
                Ok(plan) => State::Ready(Box::new(plan)),
                Err(reason) => {
                    let Topic { name, type_name, .. } = &entry.topic;
                    output.summary.note(format!("{name} ({type_name}) cannot be decoded: {reason}"));
                    State::Undecodable
                }
            };
        }
        let State::Ready(plan) = &mut entry.plan else { return };
        let row = &mut self.row;
        row.changed = false;
        row.texts.clear();
        let decoded = decode(plan, &entry.channel, data, row, (&mut self.unpacker, &mut self.unpacked));
        for note in plan.notes.drain(..) {
            output.summary.note(format!("{}: {note}", entry.topic.name));
        }
        entry.topic.texts.append(&mut row.texts);
        match decoded {
            Ok(longer) if longer && !entry.longer => {
                entry.longer = true;
                output
                    .summary
                    .note(format!("{}: messages are longer than their definition", entry.topic.name));
            }
            Ok(_) => {}
            Err(reason) => {
                let reason = format!("a message of {} {reason}", entry.topic.name);
                output.summary.lose(envelope.offset, 0, &reason);
                return;
            }
        }
        // A message that could not be read to its end may have added fields too.
        let changed = row.changed || entry.topic.fields.len() != plan.fields.len();
        let (id, wanted) = match entry.stated {
            Some(stated) if !changed => stated,
            before => {
                let id = before.map_or(self.stated, |(id, _)| id);
                self.stated = self.stated.max(id + 1);
                let new = plan.fields[entry.topic.fields.len()..].iter().cloned();
                let units = &entry.channel.units;
                entry
                    .topic
                    .fields
                    .extend(new.map(|field| Field { unit: units.get(&field.name).cloned(), ..field }));
                let stated = (id, output.sink.topic(id, &entry.topic));
                entry.stated = Some(stated);
                stated
            }
        };
        if wanted {
            let Envelope { received_ns, sent_ns, .. } = envelope;
            let sent = row.stamp_ns.filter(|&stamp| stamp != 0).or(sent_ns.filter(|&stamp| stamp != 0));
            let both = plan.has_stamp || sent_ns.is_some();
            output.sink.row(id, sent.unwrap_or(received_ns), both.then_some(received_ns), &row.values);
        }
    }
}

/// Longest name of a topic, in bytes.
pub(crate) const LONGEST_TOPIC: usize = 4096;

fn prepare(channel: &Channel, budget: &Budget) -> Result<Plan, String> {
    let Channel { type_name, encoding, definition_encoding, definition, .. } = channel;
    let schema = match (encoding.as_str(), definition_encoding.as_str()) {
        ("cdr", _) if definition.trim().is_empty() => common::definition(type_name)
            .ok_or("the file does not contain its definition, and it is none of the common types")?,
        ("cdr", "ros2msg") => complete(Schema::parse_ros(type_name, definition, false)?),
        ("cdr", "ros2idl" | "omgidl") => complete(idl::parse(type_name, definition)?),
        ("ros1", _) => Schema::parse_ros(type_name, definition, true)?,
        ("cdr", other) => return Err(format!("definitions of the encoding '{other}' are not supported")),
        (other, _) => return Err(format!("messages of the encoding '{other}' are not supported")),
    };
    Plan::new(schema, Rc::clone(budget))
}

/// Adds the common types that a definition refers to but does not contain.
fn complete(mut schema: Schema) -> Schema {
    for (name, members) in common::definitions().types {
        schema.types.entry(name).or_insert(members);
    }
    schema
}

/// The beginning of a text, as long as a longest one and a byte that shows that it is too long.
pub(crate) fn text(bytes: &[u8], longest: usize) -> String {
    String::from_utf8_lossy(&bytes[..bytes.len().min(longest + 1)]).into_owned()
}

/// Decodes a message; the answer is whether it has more bytes than its definition.
fn decode<'a>(
    plan: &mut Plan,
    channel: &Channel,
    mut data: &'a [u8],
    row: &mut Row,
    (unpacker, unpacked): (&mut Unpacker, &'a mut Vec<u8>),
) -> Result<bool, String> {
    let mut cursor = if channel.encoding == "ros1" {
        Cursor::ros1(data)
    } else {
        if data.starts_with(&ZSTD_MAGIC) {
            // A bag may compress each message (rosbag2, `compression_mode: MESSAGE`).
            unpacker.unpack(Codec::Zstd, data, unpacked)?;
            data = unpacked;
        }
        Cursor::cdr(data).map_err(reason)?
    };
    let whole = plan.decode(&mut cursor, row).map_err(reason)?;
    Ok(whole && cursor.rest() >= PADDING)
}

fn reason(fault: Fault) -> String {
    match fault {
        Fault::Encapsulation => "has an encapsulation other than plain CDR".to_owned(),
        Fault::Short | Fault::Stop => "is shorter than its definition".to_owned(),
    }
}
