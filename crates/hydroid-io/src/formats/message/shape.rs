//! Types of messages of ROS 2 as trees, for programs that receive and send messages.

use std::fmt::Write as _;

use super::common;
use super::schema::{Count, RosNumber, Schema, Type, short};

/// Types within types.
const DEEPEST: usize = 32;

/// Nodes of a tree.
const MOST_NODES: usize = 10_000;

/// A type of messages, or of a part of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RosShape {
    /// A number.
    Number(RosNumber),
    /// A text.
    Text,
    /// Any number of parts.
    Sequence(Box<RosShape>),
    /// A fixed number of parts.
    Array(Box<RosShape>, usize),
    /// Parts with names. The name of the type is that without `msg`, as in `std_msgs/Header`.
    Struct(String, Vec<(String, RosShape)>),
}

/// A type of messages of ROS 2.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RosType {
    /// Name with its package, for example `nav_msgs/msg/Odometry`.
    pub name: String,
    /// Its parts.
    pub shape: RosShape,
    /// Definition with those of its parts behind it, as MCAP stores it (`ros2msg`).
    pub definition: String,
}

impl RosType {
    /// A type of the packages `std_msgs`, `geometry_msgs`, `sensor_msgs`, `nav_msgs` and `diagnostic_msgs`, or one whose
    /// definition is given.
    ///
    /// # Errors
    /// If it is none of the common types, or the definition cannot be read: the reason.
    pub fn new(name: &str, definition: Option<&str>) -> Result<Self, String> {
        let schema = match definition {
            Some(text) => super::complete(Schema::parse_ros(name, text, false)?),
            None => common::definition(name)
                .ok_or_else(|| format!("{name} is none of the common types: its definition is needed"))?,
        };
        let root = schema.root.clone();
        let (package, of) = root
            .split_once('/')
            .ok_or_else(|| format!("{name} has no package, as in std_msgs/msg/{name}"))?;
        let mut builder = Builder { schema: &schema, nodes: 0, named: Vec::new() };
        let shape = builder.structure(&root, 0)?;
        let mut text = String::new();
        for name in &builder.named {
            if *name != root {
                // Writing to a string cannot fail.
                let _ = writeln!(text, "{}\nMSG: {name}", "=".repeat(80));
            }
            for member in schema.types.get(name).into_iter().flatten() {
                let count = match member.count {
                    Count::One => String::new(),
                    Count::Any => "[]".to_owned(),
                    Count::Fixed(count) => format!("[{count}]"),
                };
                let _ = writeln!(text, "{}{count} {}", written(&schema, &member.of, name), member.name);
            }
        }
        Ok(Self { name: format!("{package}/msg/{of}"), shape, definition: text })
    }
}

/// A type as it is written in a definition, with its package.
fn written(schema: &Schema, of: &Type, scope: &str) -> String {
    match of {
        Type::Number(number) => number.name().to_owned(),
        Type::Text => "string".to_owned(),
        Type::Unreadable(name) => name.clone(),
        Type::Named(name) => schema.resolve(name, scope).unwrap_or(name).to_owned(),
    }
}

struct Builder<'a> {
    schema: &'a Schema,
    nodes: usize,
    /// Types in the order of their appearance.
    named: Vec<String>,
}

impl Builder<'_> {
    fn structure(&mut self, name: &str, depth: usize) -> Result<RosShape, String> {
        self.nodes += 1;
        if depth > DEEPEST || self.nodes > MOST_NODES {
            return Err("its types are nested too deep".to_owned());
        }
        let members = self.schema.types.get(name).ok_or_else(|| format!("the type {name} is not defined"))?;
        if !self.named.iter().any(|named| named == name) {
            self.named.push(name.to_owned());
        }
        let mut parts = Vec::with_capacity(members.len());
        for member in members {
            let part = match &member.of {
                Type::Number(number) => RosShape::Number(*number),
                Type::Text => RosShape::Text,
                Type::Unreadable(of) => return Err(format!("{of} cannot be decoded")),
                Type::Named(of) => {
                    let full = self.schema.resolve(of, name).map(str::to_owned);
                    let full = full.ok_or_else(|| format!("the type {of} is not defined"))?;
                    self.structure(&full, depth + 1)?
                }
            };
            let part = match member.count {
                Count::One => part,
                Count::Any => RosShape::Sequence(Box::new(part)),
                Count::Fixed(count) => RosShape::Array(Box::new(part), count as usize),
            };
            parts.push((member.name.clone(), part));
        }
        // The wire has a byte for a struct without members.
        if parts.is_empty() {
            parts.push(("structure_needs_at_least_one_member".to_owned(), RosShape::Number(RosNumber::U8)));
        }
        Ok(RosShape::Struct(short(name), parts))
    }
}
