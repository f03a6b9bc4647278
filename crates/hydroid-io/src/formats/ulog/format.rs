//! Formats of ULog messages and their decoding (PX4 Guide, "ULog File Format", section "F: Format Message").

use std::collections::HashMap;

use crate::LONGEST_ARRAY;
use crate::formats::number::Number;
use crate::formats::record::{Record, Scale};
use crate::sink::Field;

/// Depth of nested formats.
const DEEPEST: usize = 8;

/// Longest part of a text that is kept.
const LONGEST_TEXT: usize = 1024;

/// Longest data of a message.
const LONGEST: usize = u16::MAX as usize;

/// Limit for the text of all formats of a damaged file; those of PX4 have some 50 kB.
const MOST_TEXT: usize = 16 << 20;

#[derive(Clone, Debug, PartialEq)]
struct Member {
    type_name: String,
    /// Elements of an array.
    count: Option<usize>,
    name: String,
}

/// The formats of a file by their names.
#[derive(Debug, Default)]
pub(super) struct Formats {
    by_name: HashMap<String, Vec<Member>>,
    text: usize,
}

impl Formats {
    /// Adds the format of a message `F`: `name:type field;type field;`. The answer is what is wrong with it.
    pub(super) fn add(&mut self, message: &[u8]) -> Result<(), String> {
        let message = String::from_utf8_lossy(message);
        let Some((name, members)) = message.split_once(':').filter(|(name, _)| !name.is_empty()) else {
            return Err("a format has no name".to_owned());
        };
        self.text += message.len();
        if self.text > MOST_TEXT {
            return Err("the file has too many formats".to_owned());
        }
        let members: Option<Vec<Member>> = members
            .trim_end_matches('\0')
            .split(';')
            .filter(|member| !member.trim().is_empty())
            .map(member)
            .collect();
        let Some(members) = members else {
            return Err(format!("the format of {name} cannot be read"));
        };
        if let Some(before) = self.by_name.get(name) {
            return if *before == members {
                Ok(())
            } else {
                Err(format!("{name} has a second format, which is ignored"))
            };
        }
        self.by_name.insert(name.to_owned(), members);
        Ok(())
    }

    /// The columns of the messages of a format, or why there are none.
    pub(super) fn plan(&self, name: &str) -> Result<Plan, String> {
        let mut plan = Plan::default();
        let mut builder = Builder { formats: self, plan: &mut plan, at: 0, steps: 0, padding: 0 };
        builder.members(name, "", 0)?;
        let Builder { at, padding, steps, .. } = builder;
        (plan.shortest, plan.longest, plan.steps) = (at - padding, at, steps);
        Ok(plan)
    }
}

fn member(text: &str) -> Option<Member> {
    let (type_name, name) = text.trim().split_once(' ')?;
    let name = name.trim();
    // Names are repeated for each element of an array of formats.
    if name.is_empty() || name.len() > 128 {
        return None;
    }
    let (type_name, count) = match type_name.split_once('[') {
        Some((type_name, count)) => {
            let count = count.strip_suffix(']')?.parse().ok().filter(|&count: &usize| count <= LONGEST)?;
            (type_name, Some(count))
        }
        None => (type_name, None),
    };
    Some(Member { type_name: type_name.to_owned(), count, name: name.to_owned() })
}

/// What is read of the messages of a format.
#[derive(Debug, Default)]
pub(super) struct Plan {
    pub(super) record: Record,
    /// Place of `time_utc_usec`.
    utc: Option<(usize, Number)>,
    /// Length without the padding at the end, which PX4 does not write.
    pub(super) shortest: usize,
    pub(super) longest: usize,
    /// Members that have been looked at.
    pub(super) steps: usize,
    /// Arrays that are left out.
    pub(super) left_out: Vec<String>,
}

impl Plan {
    /// UTC \[ns\] that a GNSS receiver states; `None` as long as it has none.
    pub(super) fn utc(&self, data: &[u8]) -> Option<i64> {
        let (at, number) = self.utc?;
        number.integer(data, at).filter(|&time| time > 0)?.checked_mul(1000)
    }
}

struct Builder<'a> {
    formats: &'a Formats,
    plan: &'a mut Plan,
    at: usize,
    /// Members that have been looked at. Arrays of formats without content do not add to the length.
    steps: usize,
    /// Bytes of padding at the end so far.
    padding: usize,
}

impl Builder<'_> {
    fn members(&mut self, format: &str, prefix: &str, depth: usize) -> Result<(), String> {
        let Some(members) = self.formats.by_name.get(format) else {
            return Err(format!("the format of {format} is missing"));
        };
        if depth > DEEPEST {
            return Err(format!("formats are nested more than {DEEPEST} deep"));
        }
        for member in members {
            self.step()?;
            let path = format!("{prefix}{}", member.name);
            if let ("char", Some(count)) = (&*member.type_name, member.count) {
                self.plan.record.texts.push((path, self.at, count.min(LONGEST_TEXT)));
                self.advance(count, false)?;
            } else if let Some(number) = number(&member.type_name) {
                self.numbers(member, path, number)?;
            } else if let Some(count) = member.count {
                for i in 0..count {
                    self.step()?;
                    self.members(&member.type_name, &format!("{path}[{i}]."), depth + 1)?;
                }
            } else {
                self.members(&member.type_name, &format!("{path}."), depth + 1)?;
            }
        }
        Ok(())
    }

    fn numbers(&mut self, member: &Member, path: String, number: Number) -> Result<(), String> {
        let size = number.size();
        let count = member.count.unwrap_or(1);
        if member.name.starts_with("_padding") {
            return self.advance(size * count, true);
        }
        if path == "timestamp" && member.count.is_none() {
            self.plan.record.time = Some((self.at, number, 1000));
            return self.advance(size, false);
        }
        if path == "time_utc_usec" && member.count.is_none() {
            self.plan.utc = Some((self.at, number));
        }
        if count > LONGEST_ARRAY {
            self.plan.left_out.push(path);
            return self.advance(size * count, false);
        }
        let unit = unit(&member.name);
        for i in 0..count {
            let name = if member.count.is_some() { format!("{path}[{i}]") } else { path.clone() };
            self.plan.record.fields.push(Field { name, unit: unit.map(str::to_owned) });
            self.plan.record.columns.push((self.at, number, Scale::One));
            self.advance(size, false)?;
        }
        Ok(())
    }

    fn step(&mut self) -> Result<(), String> {
        self.steps += 1;
        if self.steps > LONGEST { Err("the format has too many fields".to_owned()) } else { Ok(()) }
    }

    fn advance(&mut self, bytes: usize, padding: bool) -> Result<(), String> {
        self.at += bytes;
        self.padding = if padding { self.padding + bytes } else { 0 };
        if self.at > LONGEST { Err("the format is longer than a message can be".to_owned()) } else { Ok(()) }
    }
}

pub(super) fn number(type_name: &str) -> Option<Number> {
    Some(match type_name {
        "int8_t" => Number::I8,
        "uint8_t" | "bool" | "char" => Number::U8,
        "int16_t" => Number::I16,
        "uint16_t" => Number::U16,
        "int32_t" => Number::I32,
        "uint32_t" => Number::U32,
        "int64_t" => Number::I64,
        "uint64_t" => Number::U64,
        "float" => Number::F32,
        "double" => Number::F64,
        _ => return None,
    })
}

/// Unit by the end of a name, as the names of PX4's messages have it; the longest first. A single `_s` is left
/// out: it also ends names in the plural or of a side.
const UNITS: [(&str, &str); 14] = [
    ("_m_s2", "m/s2"),
    ("_m_s", "m/s"),
    ("_rad_s", "rad/s"),
    ("_deg_s", "deg/s"),
    ("_rad", "rad"),
    ("_deg", "deg"),
    ("_rpm", "rpm"),
    ("_usec", "us"),
    ("_us", "us"),
    ("_ms", "ms"),
    ("_hz", "Hz"),
    ("_pa", "Pa"),
    ("_celsius", "degC"),
    ("_m", "m"),
];

fn unit(name: &str) -> Option<&'static str> {
    match name {
        // A rate, in spite of its name (msg/SensorCombined.msg).
        "gyro_rad" => Some("rad/s"),
        "timestamp_sample" => Some("us"),
        _ => UNITS.iter().find(|(end, _)| name.ends_with(end)).map(|&(_, unit)| unit),
    }
}
