//! Definitions of common types of ROS 2, for bags that have none: those of `builtin_interfaces`, `std_msgs`,
//! `geometry_msgs`, `sensor_msgs`, `nav_msgs`, `diagnostic_msgs` and `rosgraph_msgs`, without constants.

use std::fmt::Write as _;

use super::schema::{Schema, short};

/// A type a line: its name and its members.
const TYPES: &str = include_str!("common.msg");

/// All types of the table.
pub(super) fn definitions() -> Schema {
    let mut text = String::new();
    for line in TYPES.lines() {
        let (name, members) = line.split_once(' ').unwrap_or((line, ""));
        // Writing to a string cannot fail.
        let _ = write!(text, "MSG: {name}\n{}\n", members.replace(", ", "\n"));
    }
    let mut schema = Schema::parse_ros("", &text, false).expect("the table is tested");
    // The message before the first type has no name.
    schema.types.remove("");
    schema
}

/// A type of the table with its parts.
pub(super) fn definition(type_name: &str) -> Option<Schema> {
    let root = short(type_name);
    let schema = definitions();
    schema.types.contains_key(&root).then_some(Schema { root, ..schema })
}
