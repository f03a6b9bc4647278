//! Definitions of messages: ROS message files (ROS 2 documentation, "Interfaces", and ROS 1 wiki, "msg") with the
//! definitions of their parts behind them, as MCAP ("Appendix: `ros2msg`, `ros1msg`") and bags store them.

use std::collections::HashMap;

/// Longest definition of a message with its parts, in bytes.
pub(crate) const LONGEST_DEFINITION: usize = 1 << 20;

/// Longest name of a member or type; it bounds the paths of nested fields.
const LONGEST_NAME: usize = 255;

/// A number of the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names of ROS 2: bool, int8, …")]
pub enum RosNumber {
    Bool,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl RosNumber {
    /// Bytes on the wire.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Names in ROS message files.
    const NAMES: [(&str, Self); 11] = [
        ("bool", Self::Bool),
        ("int8", Self::I8),
        ("uint8", Self::U8),
        ("int16", Self::I16),
        ("uint16", Self::U16),
        ("int32", Self::I32),
        ("uint32", Self::U32),
        ("int64", Self::I64),
        ("uint64", Self::U64),
        ("float32", Self::F32),
        ("float64", Self::F64),
    ];

    /// A number of a ROS message file. `ros1` distinguishes `byte`, which has a sign there.
    pub(crate) fn of_ros(name: &str, ros1: bool) -> Option<Self> {
        let name = match name {
            "byte" if ros1 => "int8",
            "char" | "byte" => "uint8",
            name => name,
        };
        Self::NAMES.iter().find(|(of, _)| *of == name).map(|(_, number)| *number)
    }

    /// Its name in ROS message files.
    pub(crate) fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, number)| *number == self).map_or("", |(name, _)| name)
    }
}

/// Number of elements of a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Count {
    /// No array.
    One,
    /// An array of fixed length.
    Fixed(u32),
    /// A sequence, with its length on the wire.
    Any,
}

/// Type of a member.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Type {
    Number(RosNumber),
    Text,
    /// A type whose size on the wire is not known; nothing behind it can be read.
    Unreadable(String),
    /// Another definition, by its name as it is written.
    Named(String),
}

/// A member of a struct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Member {
    /// Empty for the elements of an array that has a name of its own (a `typedef` of IDL).
    pub(crate) name: String,
    pub(crate) of: Type,
    pub(crate) count: Count,
}

/// A message type with the types of its parts.
#[derive(Debug)]
pub(crate) struct Schema {
    /// Name of the message type.
    pub(crate) root: String,
    /// Whether the wire is that of ROS 1.
    pub(crate) ros1: bool,
    /// Members of each type, by its short name.
    pub(crate) types: HashMap<String, Vec<Member>>,
}

/// `std_msgs/msg/Header` and `std_msgs::msg::Header` as `std_msgs/Header`.
pub(crate) fn short(name: &str) -> String {
    name.trim().trim_start_matches("::").replace("::", "/").replace("/msg/", "/")
}

impl Schema {
    /// Reads a ROS message file and those of its parts, which follow behind lines of `=` and `MSG: name`.
    pub(crate) fn parse_ros(type_name: &str, text: &str, ros1: bool) -> Result<Self, String> {
        if !type_name.is_empty() {
            check_name(type_name.trim())?;
        }
        let mut schema = Self { root: short(type_name), ros1, types: HashMap::new() };
        let mut current = schema.root.clone();
        let mut members = Vec::new();
        for line in text.lines() {
            if line.len() >= 10 && line.bytes().all(|byte| byte == b'=') {
                continue;
            }
            if let Some(name) = line.strip_prefix("MSG:") {
                schema.define(&current, std::mem::take(&mut members));
                check_name(name.trim())?;
                current = short(name);
            } else if let Some(member) = member_of_line(line, ros1)? {
                members.push(member);
            }
        }
        schema.define(&current, members);
        if ros1 {
            for (name, seconds) in [("time", RosNumber::U32), ("duration", RosNumber::I32)] {
                schema.define(name, time_members(seconds));
            }
        }
        Ok(schema)
    }

    /// Adds a type; an empty one does not replace another.
    pub(crate) fn define(&mut self, name: &str, members: Vec<Member>) {
        if !members.is_empty() || !self.types.contains_key(name) {
            self.types.insert(name.to_owned(), members);
        }
    }

    /// The full name of a type as it is written in another one: in the same package, else anywhere.
    pub(crate) fn resolve(&self, name: &str, scope: &str) -> Option<&str> {
        let name = short(name);
        let find = |name: &str| self.types.get_key_value(name).map(|(key, _)| key.as_str());
        let mut package = scope;
        while let Some((outer, _)) = package.rsplit_once('/') {
            if let Some(found) = find(&format!("{outer}/{name}")) {
                return Some(found);
            }
            package = outer;
        }
        if let Some(found) = find(&name) {
            return Some(found);
        }
        if name == "Header" {
            return find("std_msgs/Header");
        }
        None
    }
}

fn time_members(seconds: RosNumber) -> Vec<Member> {
    [("sec", seconds), ("nanosec", RosNumber::U32)]
        .map(|(name, kind)| Member { name: name.to_owned(), of: Type::Number(kind), count: Count::One })
        .into()
}

/// A member of a line `type name`, or `None` for a comment, a constant (`type NAME=value`) or an empty line. What
/// follows the name (a default, a comment) is not needed.
fn member_of_line(line: &str, ros1: bool) -> Result<Option<Member>, String> {
    let line = line.split('#').next().unwrap_or_default().trim();
    if line.is_empty() {
        return Ok(None);
    }
    let wrong = || format!("the line '{}' of the definition cannot be understood", cut(line));
    let (written, rest) = line.split_once([' ', '\t']).ok_or_else(wrong)?;
    let rest = rest.trim_start();
    let end = rest.find([' ', '\t', '=']).unwrap_or(rest.len());
    let (name, behind) = rest.split_at(end);
    if behind.trim_start().starts_with('=') {
        return Ok(None);
    }
    check_name(name)?;
    let (element, count) = match written.split_once('[') {
        None => (written, Count::One),
        Some((element, length)) => {
            let length = length.strip_suffix(']').ok_or_else(wrong)?;
            let count = if length.is_empty() || length.starts_with("<=") {
                Count::Any
            } else {
                Count::Fixed(length.parse().map_err(|_| wrong())?)
            };
            (element, count)
        }
    };
    // A bound of a text changes nothing on the wire.
    let of = match element.split("<=").next().unwrap_or_default() {
        "string" => Type::Text,
        "wstring" => Type::Unreadable("wstring".to_owned()),
        name => {
            if let Some(kind) = RosNumber::of_ros(name, ros1) {
                Type::Number(kind)
            } else {
                check_name(name)?;
                Type::Named(name.to_owned())
            }
        }
    };
    Ok(Some(Member { name: name.to_owned(), of, count }))
}

/// Whether a name can be one.
pub(crate) fn check_name(name: &str) -> Result<(), String> {
    let fits = |c: char| c.is_alphanumeric() || c == '_' || c == '/' || c == ':';
    if name.is_empty() || name.len() > LONGEST_NAME || !name.chars().all(fits) {
        return Err(format!("'{}' in the definition is not a name", cut(name)));
    }
    Ok(())
}

/// The first characters of a text, for a message.
pub(crate) fn cut(text: &str) -> String {
    text.chars().take(60).collect()
}
