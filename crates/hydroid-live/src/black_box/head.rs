//! Header of the file: model, options of the adapter, and sizes.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::record::RowLayout;
use hydroid::adapt::Options;
use hydroid::fingerprint::Fingerprint;
use hydroid::log::Channel;

pub(super) const MAGIC: &[u8; 8] = b"HYDROBOX";
const VERSION: u32 = 4;
const BEFORE: usize = 24;
const MAX_HORIZONS: usize = 64;
const MAX_SIZE: usize = 10_000;
const MAX_STEPS: usize = 1 << 30;
/// Longest recorded time that a kill loses \[s\].
const WRITE_INTERVAL_S: f64 = 1.0;
/// Capacity of the write buffer \[write intervals\], for steps over a gap.
const BUFFER_INTERVALS: usize = 8;
pub(super) const START: usize = 6;

/// A model's file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelFile {
    pub file: String,
    /// Its [`fingerprint`](crate::stream::fingerprint).
    pub fingerprint: String,
}

/// Header of a black box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Head {
    /// Version of hydroid that wrote the file; the arithmetic of another one may differ.
    pub hydroid: String,
    pub model: ModelFile,
    /// Name and kind of the model.
    pub named: [String; 2],
    /// Names of the runs, or of the stream.
    pub runs: Vec<String>,
    /// Settings of adaptation and reading, as in the state file of a stream.
    pub settings: Value,
    /// Options with which the adapter is rebuilt, as TOML, which has infinite numbers.
    pub(super) options: String,
    /// Sample time \[s\].
    pub dt: f64,
    pub outputs: Vec<Channel>,
    pub inputs: Vec<Channel>,
    /// Horizons of the predictions \[samples\].
    pub horizons: Vec<usize>,
    /// Number of values of the adapter's state.
    pub memory: usize,
    /// Segments of the ring.
    pub segments: usize,
    /// Steps in a segment.
    pub steps: usize,
}

impl Head {
    pub(super) fn layout(&self) -> RowLayout {
        RowLayout::new(self.outputs.len(), self.inputs.len(), self.horizons.len())
    }

    /// Numbers of a step.
    #[doc(hidden)]
    pub fn row_len(&self) -> usize {
        self.layout().len()
    }

    pub(super) fn segment_len(&self) -> usize {
        8 * (START + self.memory + self.steps * (self.layout().len() + 1))
    }

    pub(super) fn every(&self) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 1 and 1,000,000
        let every = (WRITE_INTERVAL_S / self.dt * (1.0 + 1e-9)).floor().clamp(1.0, 1e6) as usize;
        every
    }

    /// Steps of a minute.
    pub(super) fn minute(&self) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive; a cast saturates
        let steps = (60.0 / self.dt).ceil() as usize;
        steps.min(self.steps)
    }

    pub(super) fn buffer_steps(&self) -> usize {
        BUFFER_INTERVALS * self.every()
    }

    pub(super) fn names(&self) -> Vec<String> {
        self.outputs.iter().chain(&self.inputs).map(|channel| channel.name.clone()).collect()
    }

    pub(super) fn options(&self) -> Result<Options, String> {
        toml::from_str(&self.options).map_err(|e| e.message().to_owned())
    }

    pub(super) fn encode(&self) -> Result<Vec<u8>, serde_json::Error> {
        let json = serde_json::to_vec(self)?;
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(u32::try_from(json.len()).unwrap_or(u32::MAX).to_le_bytes());
        bytes.extend(sum(&json).to_le_bytes());
        bytes.extend(json);
        Ok(bytes)
    }

    /// Decodes the header; also returns the offset of the ring.
    pub(super) fn decode(bytes: &[u8]) -> Result<(Self, usize), String> {
        let damaged = |reason: &str| {
            format!("the header is damaged ({reason}); copy the file again from its origin, or remove it")
        };
        let Some((before, rest)) = bytes.split_first_chunk::<BEFORE>().filter(|_| bytes.starts_with(MAGIC))
        else {
            return Err(
                "it is not a black box: give a file that hydroid has written as a black box".to_owned()
            );
        };
        let word =
            |at: usize| u32::from_le_bytes([before[at], before[at + 1], before[at + 2], before[at + 3]]);
        let version = word(8);
        if version != VERSION {
            return Err(format!(
                "the file has format {version}, and this program reads format {VERSION}; read it with the version of hydroid that wrote it"
            ));
        }
        let len = usize::try_from(word(12)).unwrap_or(usize::MAX);
        let json = rest.get(..len).ok_or_else(|| damaged("it was cut short"))?;
        if before[16..] != sum(json).to_le_bytes() {
            return Err(damaged("the checksum does not match"));
        }
        let head: Self = serde_json::from_slice(json).map_err(|e| damaged(&e.to_string()))?;
        head.check().map_err(damaged)?;
        Ok((head, BEFORE + len))
    }

    /// Checks the sizes, so that their products do not overflow.
    pub(super) fn check(&self) -> Result<(), &'static str> {
        let sound = self.dt > 0.0
            && self.dt.is_finite()
            && !self.outputs.is_empty()
            && self.outputs.len().max(self.inputs.len()) <= MAX_SIZE
            && self.horizons.len() <= MAX_HORIZONS
            && self.horizons.windows(2).all(|pair| pair[0] < pair[1])
            && self.horizons.iter().all(|h| (1..=MAX_SIZE).contains(h))
            && (1..=MAX_SIZE).contains(&self.segments)
            && self.steps.max(self.memory) <= MAX_STEPS
            && self.segment_len().checked_mul(self.segments).is_some();
        if sound { Ok(()) } else { Err("invalid sizes") }
    }
}

pub(super) fn sum(bytes: &[u8]) -> u64 {
    let mut hash = Fingerprint::new();
    hash.bytes(bytes);
    hash.value()
}
