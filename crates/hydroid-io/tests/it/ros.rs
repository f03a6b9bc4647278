//! What the tests of MCAP and of the bags share: the content of the samples.

use std::fmt::Write as _;

use crate::recorder::Recorder;

/// Asserts what README.md and expected.json of the samples say about the messages.
pub(crate) fn assert_sample(all: &Recorder, expected: &str, stamp_of_reception: bool) {
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
pub(crate) fn numbers(all: &Recorder) -> Vec<u64> {
    let rows = all.topics.first().map_or(&[][..], |rows| &rows.rows);
    rows.iter().map(|row| f64::from_bits(row.2[0]) as u64).collect()
}
