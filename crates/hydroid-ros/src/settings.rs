//! The section `[ros]` of the configuration file.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, anyhow, ensure};
use hydroid::config;
use hydroid_io::{RosShape, RosType};
use hydroid_live::link::{Definition, Field, Topic};
use serde::Deserialize;

use crate::value::{Fields, Value};

/// Topics of the graph.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Ros {
    /// Types of the topics that are subscribed to, by their names.
    pub topics: BTreeMap<String, String>,
    /// Definitions of types that are none of the common ones.
    pub types: BTreeMap<String, String>,
    /// Topic of a `std_msgs/msg/Bool` that permits commands while it is true and newer than a second.
    pub enable: Option<String>,
    /// Frame of the published poses, with axes to the east, to the north and up.
    pub map_frame: Option<String>,
    /// Frame of the vessel, with axes forward, to port and up.
    pub base_frame: Option<String>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct File {
    ros: Ros,
}

/// A topic with the type of its messages. It lives as long as the program.
#[derive(Clone, Copy, Debug)]
pub struct Subscribed {
    /// Name in the configuration.
    pub name: &'static str,
    /// Type of its messages.
    pub of: &'static RosType,
    pub fields: &'static Fields,
}

impl Subscribed {
    fn new(name: &str, of: RosType) -> Self {
        let fields = Fields::of(&of.shape);
        Self {
            name: Box::leak(name.into()),
            of: Box::leak(Box::new(of)),
            fields: Box::leak(Box::new(fields)),
        }
    }

    /// The numbers of a message. A position without a fix is none.
    pub fn row(&self, message: &Value) -> Vec<f64> {
        let mut row = self.fields.row(message);
        if self.of.name == "sensor_msgs/msg/NavSatFix" {
            let names = self.fields.names();
            let at = |name: &str| names.iter().position(|field| field == name);
            // STATUS_NO_FIX is -1.
            if at("status.status").is_some_and(|at| row[at] < 0.0) {
                for place in ["latitude", "longitude"].into_iter().filter_map(at) {
                    row[place] = f64::NAN;
                }
            }
        }
        row
    }

    /// As a topic of a link.
    pub fn topic(&self) -> Topic {
        let names = self.fields.names();
        let fields: Vec<Field> = names.iter().map(|name| Field { name, unit: "" }).collect();
        Topic {
            name: self.name,
            fields: fields.leak(),
            messages: Some(Definition { name: &self.of.name, text: &self.of.definition }),
        }
    }
}

impl Ros {
    /// Reads the section.
    pub fn read(file: &Path) -> anyhow::Result<Self> {
        // Every other section is checked, too.
        config::read(file).context("the configuration file cannot be used")?;
        let File { ros } = hydroid::toml_file::read(file).context("the configuration file cannot be used")?;
        ensure!(
            !ros.topics.is_empty(),
            "{}: the section [ros] names no topics: write topics = {{ \"/odom\" = \"nav_msgs/msg/Odometry\" }}; \
             `hydroid-ros --print-config` writes an example",
            file.display()
        );
        Ok(ros)
    }

    /// The topics in the order of their names, that of `enable` among them.
    pub fn subscribed(&self) -> anyhow::Result<Vec<Subscribed>> {
        let mut topics = self.topics.clone();
        if let Some(enable) = &self.enable {
            let of = topics.entry(enable.clone()).or_insert_with(|| "std_msgs/msg/Bool".to_owned());
            ensure!(
                matches!(of.as_str(), "std_msgs/msg/Bool" | "std_msgs/Bool"),
                "[ros] enable: {enable} has the type {of}, and std_msgs/msg/Bool is needed"
            );
        }
        let of = |(name, of): (&String, &String)| {
            let given = self.types.get(of).map(String::as_str);
            let of = RosType::new(of, given).map_err(|error| {
                anyhow!("[ros] topic {name}: {error}; write definitions as types = {{ \"{of}\" = \"float64 left\\nfloat64 right\" }}")
            })?;
            ensure!(
                matches!(of.shape, RosShape::Struct(..)),
                "[ros] topic {name}: {} is not a message",
                of.name
            );
            Ok(Subscribed::new(name, of))
        };
        topics.iter().map(of).collect()
    }
}
