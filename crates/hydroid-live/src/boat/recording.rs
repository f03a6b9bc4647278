//! The recording of a session: its file, and the topics that hydroid adds to those of the link.

use std::io;
use std::path::{Path, PathBuf};

use crate::link::{Field, Topic};
use crate::record::{Channel, Health, Recorder};

/// What hydroid adds: the estimate of the motion.
const ESTIMATE: Topic = Topic {
    name: "/hydroid/estimate",
    fields: &[
        Field { name: "north", unit: "m" },
        Field { name: "east", unit: "m" },
        Field { name: "psi", unit: "rad" },
        Field { name: "u", unit: "m/s" },
        Field { name: "v", unit: "m/s" },
        Field { name: "r", unit: "rad/s" },
        Field { name: "deviation_u", unit: "m/s" },
        Field { name: "deviation_v", unit: "m/s" },
        Field { name: "deviation_r", unit: "rad/s" },
    ],
    messages: None,
};

/// The prediction of a model at its longest horizon.
const PREDICTION: Topic = Topic {
    name: "/hydroid/prediction",
    fields: &[
        Field { name: "horizon", unit: "s" },
        Field { name: "north", unit: "m" },
        Field { name: "east", unit: "m" },
        Field { name: "psi", unit: "rad" },
        Field { name: "deviation_position", unit: "m" },
        Field { name: "deviation_psi", unit: "rad" },
    ],
    messages: None,
};

/// A recording that is being written.
pub(super) struct Recording {
    recorder: Recorder,
    channels: Vec<Channel>,
    /// Whether a topic of the link is recorded as its messages.
    has_messages: Vec<bool>,
    pub(super) begun_ns: i64,
}

impl Recording {
    /// Begins a file in a folder, with the time in its name.
    pub(super) fn begin(folder: &Path, topics: &[Topic], now_ns: i64) -> io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        let all: Vec<Topic> = topics.iter().copied().chain([ESTIMATE, PREDICTION]).collect();
        let path = free_name(folder, now_ns);
        let (recorder, channels) = Recorder::create(&path, &all)?;
        let has_messages = topics.iter().map(|topic| topic.messages.is_some()).collect();
        Ok(Self { recorder, channels, has_messages, begun_ns: now_ns })
    }

    pub(super) fn path(&self) -> &Path {
        self.recorder.path()
    }

    pub(super) fn health(&self) -> Health {
        self.recorder.health()
    }

    pub(super) fn row(&self, topic: usize, received_ns: i64, sent_ns: i64, values: &[f64]) {
        if self.has_messages.get(topic) == Some(&false) {
            self.recorder.numbers(self.channels[topic], received_ns, sent_ns, values.to_vec());
        }
    }

    pub(super) fn message(&self, topic: usize, received_ns: i64, sent_ns: i64, bytes: Vec<u8>) {
        if self.has_messages.get(topic) == Some(&true) {
            self.recorder.message(self.channels[topic], received_ns, sent_ns, bytes);
        }
    }

    pub(super) fn estimate(&self, now_ns: i64, at_ns: i64, values: Vec<f64>) {
        self.recorder.numbers(self.channels[self.has_messages.len()], now_ns, at_ns, values);
    }

    pub(super) fn prediction(&self, now_ns: i64, at_ns: i64, values: Vec<f64>) {
        self.recorder.numbers(self.channels[self.has_messages.len() + 1], now_ns, at_ns, values);
    }

    pub(super) fn event(&self, now_ns: i64, text: &str) {
        self.recorder.text(now_ns, text);
    }

    pub(super) fn finish(self) -> io::Result<()> {
        self.recorder.finish()
    }
}

/// `boat-2026-11-26T21-05-00Z.mcap`, or with a number if it exists.
fn free_name(folder: &Path, now_ns: i64) -> PathBuf {
    let text = hydroid::recording::time_text((now_ns / 1_000_000_000) as f64);
    let stamp = text.split('.').next().unwrap_or_default().replace(':', "-");
    let named = |suffix: &str| folder.join(format!("boat-{stamp}Z{suffix}.mcap"));
    let mut all = std::iter::once(named("")).chain((2..10_000).map(|k| named(&format!("-{k}"))));
    all.find(|path| !path.exists()).unwrap_or_else(|| named("-x"))
}
