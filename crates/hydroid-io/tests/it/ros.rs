//! What the tests of MCAP and of the bags share: collected rows, and the content of the samples.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use hydroid_io::{IoError, Sink, Summary, Topic, scan};

/// A topic with all its rows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Rows {
    pub(crate) topic: Topic,
    /// Stamp, stamp of reception, and values as bits, because NaN is not equal to itself.
    pub(crate) rows: Vec<(i64, Option<i64>, Vec<u64>)>,
}

impl Rows {
    pub(crate) fn value(&self, row: usize, field: &str) -> f64 {
        let column = self.topic.fields.iter().position(|f| f.name == field);
        let column = column.unwrap_or_else(|| panic!("no field {field} in {:?}", self.topic.fields));
        self.rows[row].2.get(column).map_or(f64::NAN, |&bits| f64::from_bits(bits))
    }
}

/// All topics of a file.
#[derive(Default)]
pub(crate) struct All {
    pub(crate) topics: Vec<Rows>,
    /// Topics whose rows are refused.
    pub(crate) refused: Vec<&'static str>,
}

impl Sink for All {
    fn topic(&mut self, id: usize, topic: &Topic) -> bool {
        assert!(id <= self.topics.len(), "topics are numbered in order");
        if id == self.topics.len() {
            self.topics.push(Rows { topic: topic.clone(), rows: Vec::new() });
        }
        let known = &mut self.topics[id].topic;
        assert!(topic.fields.starts_with(&known.fields), "fields are added at the end");
        *known = topic.clone();
        !self.refused.contains(&topic.name.as_str())
    }

    fn row(&mut self, id: usize, stamp_ns: i64, received_ns: Option<i64>, values: &[f64]) {
        let rows = &mut self.topics[id];
        assert!(!self.refused.contains(&rows.topic.name.as_str()), "a row that is not wanted");
        assert_eq!(values.len(), rows.topic.fields.len());
        rows.rows.push((stamp_ns, received_ns, values.iter().map(|value| value.to_bits()).collect()));
    }
}

impl All {
    pub(crate) fn by_name(&self) -> BTreeMap<&str, &Rows> {
        self.topics.iter().map(|rows| (rows.topic.name.as_str(), rows)).collect()
    }

    pub(crate) fn get(&self, name: &str) -> &Rows {
        let by_name = self.by_name();
        by_name.get(name).copied().unwrap_or_else(|| panic!("no topic {name} in {:?}", by_name.keys()))
    }
}

pub(crate) fn read_all(path: &str) -> Result<(All, Summary), IoError> {
    let mut all = All::default();
    let summary = scan(path, &mut all)?;
    Ok((all, summary))
}

/// A folder of this test with a file in it.
pub(crate) struct Scratch(tempfile::TempDir, &'static str);

impl Scratch {
    pub(crate) fn new(name: &'static str) -> Self {
        Self(tempfile::tempdir().expect("a folder"), name)
    }

    pub(crate) fn path(&self) -> PathBuf {
        self.0.path().join(self.1)
    }

    pub(crate) fn read(&self, bytes: &[u8]) -> Result<(All, Summary), IoError> {
        std::fs::write(self.path(), bytes).expect("written");
        read_all(&self.path().to_string_lossy())
    }
}

/// Asserts that a damaged file gives a part of the rows of the whole file, and nothing else.
pub(crate) fn assert_part_of(part: &Result<(All, Summary), IoError>, whole: &All) {
    match part {
        Ok((part, _)) => {
            for rows in &part.topics {
                let all = whole.get(&rows.topic.name);
                assert!(rows.rows.len() <= all.rows.len());
                assert_eq!(rows.rows[..], all.rows[..rows.rows.len()], "{}", rows.topic.name);
            }
        }
        Err(error) => assert!(matches!(error, IoError::Damaged { .. } | IoError::Empty { .. }), "{error}"),
    }
}

/// Asserts what README.md and expected.json of the samples say about the messages.
pub(crate) fn assert_sample(all: &All, expected: &str, stamp_of_reception: bool) {
    let expected: serde_json::Value = serde_json::from_str(expected).expect("expected.json");
    for (topic, count) in expected["counts"]["mcap and bags"].as_object().expect("counts") {
        assert_eq!(all.get(topic).rows.len() as u64, count.as_u64().expect("a count"), "{topic}");
    }
    for (topic, messages) in expected["first_messages"].as_object().expect("messages") {
        let rows = all.get(topic);
        for (i, message) in messages.as_array().expect("messages").iter().enumerate() {
            let stamp = &message["message"]["header"]["stamp"];
            let stamp =
                stamp["sec"].as_i64().expect("s") * 1_000_000_000 + stamp["nanosec"].as_i64().expect("ns");
            assert_eq!(rows.rows[i].0, stamp, "{topic}");
            if stamp_of_reception {
                assert_eq!(rows.rows[i].1, message["log_time"].as_i64(), "{topic}");
            }
            let mut leaves = Vec::new();
            flatten(&message["message"], String::new(), &mut leaves);
            assert!(leaves.len() > 4);
            for (name, leaf) in leaves {
                if let Some(text) = leaf.as_str() {
                    if i == 0 && !text.is_empty() {
                        let texts = &rows.topic.texts;
                        assert!(
                            texts.contains(&(name.clone(), text.to_owned())),
                            "{topic} {name}: {texts:?}"
                        );
                    }
                } else if !name.starts_with("header.stamp") {
                    let value = leaf.as_f64().unwrap_or_else(|| f64::from(u8::from(leaf == true)));
                    let read = rows.value(i, &name);
                    // A number of 32 bits has six digits.
                    assert!((read - value).abs() <= 1e-6 * value.abs(), "{topic} {name}: {read} {value}");
                    if name != "battery_v" {
                        assert_eq!(read, value, "{topic} {name}");
                    }
                }
            }
        }
    }
    let altitudes = all.get("/fix");
    for row in 0..altitudes.rows.len() {
        assert_eq!(altitudes.value(row, "altitude"), 41.5);
        assert!([1.0, 2.0].contains(&altitudes.value(row, "status.status")));
    }
    for (name, type_name) in [("/odom", "Odometry"), ("/imu/data", "Imu"), ("/actuators", "MotorPwm")] {
        let topic = &all.get(name).topic;
        assert!(topic.type_name.ends_with(type_name));
        assert_eq!(topic.clock, hydroid_io::Clock::Utc);
    }
}

fn flatten<'a>(
    value: &'a serde_json::Value,
    path: String,
    leaves: &mut Vec<(String, &'a serde_json::Value)>,
) {
    if let Some(members) = value.as_object() {
        for (name, member) in members {
            let mut inner = path.clone();
            let _ = write!(inner, "{}{name}", if path.is_empty() { "" } else { "." });
            flatten(member, inner, leaves);
        }
    } else if let Some(elements) = value.as_array() {
        for (i, element) in elements.iter().enumerate() {
            flatten(element, format!("{path}[{i}]"), leaves);
        }
    } else {
        leaves.push((path, value));
    }
}

pub(crate) fn expected() -> Option<String> {
    let path = crate::sample::file("expected.json")?;
    Some(std::fs::read_to_string(path).expect("expected.json"))
}

/// A message in little-endian CDR, from parts that are aligned by the caller.
pub(crate) fn cdr(parts: &[&[u8]]) -> Vec<u8> {
    [&[0, 1, 0, 0][..], &parts.concat()].concat()
}

/// The only field of the first topic, as whole numbers.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the tests write small whole numbers"
)]
pub(crate) fn numbers(all: &All) -> Vec<u64> {
    let rows = all.topics.first().map_or(&[][..], |rows| &rows.rows);
    rows.iter().map(|row| f64::from_bits(row.2[0]) as u64).collect()
}
