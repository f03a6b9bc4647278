//! The head of the file: of which model, how it learns, and the sizes of all that follows.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::record::Places;
use hydroid::adapt::Options;
use hydroid::fingerprint::Fingerprint;
use hydroid::log::Channel;

pub(super) const MAGIC: &[u8; 8] = b"HYDROBOX";
const VERSION: u32 = 1;
/// Bytes before the JSON.
const BEFORE: usize = 24;
/// Sizes beyond these are none of a box.
const MOST_HORIZONS: usize = 64;
const FARTHEST: usize = 10_000;
const MOST_STEPS: usize = 1 << 30;
/// Time of the walk \[s\] that a kill may cost at the most.
const WRITTEN_EVERY_S: f64 = 1.0;
/// Seconds of steps that are written at once at the most: where a gap is walked over.
const ROOM: usize = 8;
/// Numbers of a segment's start.
pub(super) const START: usize = 6;

/// A model's file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelFile {
    /// Its name.
    pub file: String,
    /// Its [`fingerprint`](crate::stream::fingerprint).
    pub fingerprint: String,
}

/// What a box is of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Head {
    /// Version of hydroid that wrote it: another one may learn otherwise.
    pub hydroid: String,
    /// The model.
    pub model: ModelFile,
    /// Name and kind of the model.
    pub named: [String; 2],
    /// Where the samples came from: names of the runs, or of the stream.
    pub runs: Vec<String>,
    /// How the model learned and how the samples were read, as in the state of a stream.
    pub settings: Value,
    /// The options of which the adapter can be made again, as TOML: it has infinite numbers, and JSON has not.
    pub(super) options: String,
    /// Sample time \[s\].
    pub dt: f64,
    /// Outputs.
    pub outputs: Vec<Channel>,
    /// Inputs.
    pub inputs: Vec<Channel>,
    /// Horizons of the predictions \[samples\].
    pub horizons: Vec<usize>,
    /// Numbers of the adapter's memory.
    pub memory: usize,
    /// Segments of the ring.
    pub segments: usize,
    /// Steps that a segment holds.
    pub steps: usize,
}

impl Head {
    /// How the steps' numbers are laid out.
    pub(super) fn places(&self) -> Places {
        Places::new(self.outputs.len(), self.inputs.len(), self.horizons.len())
    }

    /// Bytes of a segment.
    pub(super) fn segment_len(&self) -> usize {
        8 * (START + self.memory + self.steps * (self.places().len() + 1))
    }

    /// Steps after which they are written.
    pub(super) fn every(&self) -> usize {
        // Casts saturate; a step of no time is refused, and none is so short.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let every = (WRITTEN_EVERY_S / self.dt * (1.0 + 1e-9)).floor().clamp(1.0, 1e6) as usize;
        every
    }

    /// Steps that are written at once at the most.
    pub(super) fn room(&self) -> usize {
        ROOM * self.every()
    }

    /// Names of outputs, then inputs.
    pub(super) fn names(&self) -> Vec<String> {
        self.outputs.iter().chain(&self.inputs).map(|channel| channel.name.clone()).collect()
    }

    pub(super) fn options(&self) -> Result<Options, String> {
        toml::from_str(&self.options).map_err(|e| e.message().to_owned())
    }

    /// As the first bytes of a file.
    pub(super) fn encode(&self) -> Result<Vec<u8>, serde_json::Error> {
        let json = serde_json::to_vec(self)?;
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        // No head has 4 GB.
        bytes.extend(u32::try_from(json.len()).unwrap_or(u32::MAX).to_le_bytes());
        bytes.extend(sum(&json).to_le_bytes());
        bytes.extend(json);
        Ok(bytes)
    }

    /// From the bytes of a file; gives where the ring begins as well.
    pub(super) fn decode(bytes: &[u8]) -> Result<(Self, usize), String> {
        let damaged = |reason: &str| {
            format!("its head is damaged ({reason}); copy it anew from where it was written, or remove it")
        };
        let Some((before, rest)) = bytes.split_first_chunk::<BEFORE>().filter(|_| bytes.starts_with(MAGIC))
        else {
            return Err("it is no black box: give a file that --black-box has written".to_owned());
        };
        let word =
            |at: usize| u32::from_le_bytes([before[at], before[at + 1], before[at + 2], before[at + 3]]);
        let version = word(8);
        if version != VERSION {
            return Err(format!(
                "it has format {version}, and this program reads format {VERSION}; read it with the version of hydroid that wrote it"
            ));
        }
        let len = usize::try_from(word(12)).unwrap_or(usize::MAX);
        let json = rest.get(..len).ok_or_else(|| damaged("it was cut short"))?;
        if before[16..] != sum(json).to_le_bytes() {
            return Err(damaged("its sum is another"));
        }
        let head: Self = serde_json::from_slice(json).map_err(|e| damaged(&e.to_string()))?;
        head.check().map_err(damaged)?;
        Ok((head, BEFORE + len))
    }

    /// Whether all sizes can be: then none of what is made of them overflows.
    pub(super) fn check(&self) -> Result<(), &'static str> {
        let sound = self.dt > 0.0
            && self.dt.is_finite()
            && !self.outputs.is_empty()
            && self.outputs.len().max(self.inputs.len()) <= FARTHEST
            && self.horizons.len() <= MOST_HORIZONS
            && self.horizons.windows(2).all(|pair| pair[0] < pair[1])
            && self.horizons.iter().all(|h| (1..=FARTHEST).contains(h))
            && (1..=FARTHEST).contains(&self.segments)
            && self.steps.max(self.memory) <= MOST_STEPS
            && self.segment_len().checked_mul(self.segments).is_some();
        if sound { Ok(()) } else { Err("sizes that none has") }
    }
}

pub(super) fn sum(bytes: &[u8]) -> u64 {
    let mut hash = Fingerprint::new();
    hash.bytes(bytes);
    hash.value()
}
