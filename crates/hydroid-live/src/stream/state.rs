//! State file of a stream, from which a restarted service continues exactly.
//!
//! A safetensors file, written atomically, with three tensors in double precision: `memory` (of the adapter), `clock`
//! and `commands`. The metadata entry `hydroid_stream` is a JSON [`Head`].

use std::collections::HashMap;
use std::io;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::StreamError;
use hydroid::atomic;
use hydroid::fingerprint::Fingerprint;

const KEY: &str = "hydroid_stream";
const VERSION: u32 = 12;
const HYDROID: &str = env!("CARGO_PKG_VERSION");
const MAX_BYTES: u64 = 1 << 32;
const CLOCK: usize = 7;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    version: u32,
    /// Version of hydroid; the arithmetic of another one may differ.
    hydroid: String,
    /// Fingerprint of the model's file.
    model: String,
    settings: Value,
    /// Fingerprint of the first readable data line of the session, and number of its data lines up to the state.
    first: String,
    rows: u64,
    sum: String,
}

/// Complete state of a stream.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Fingerprint of the model's file.
    pub(super) model: String,
    /// Options of the adapter and of the reading.
    pub(super) settings: Value,
    /// Fingerprint of the first readable data line of the session, and number of its data lines up to the state.
    pub(super) first: String,
    pub(super) rows: u64,
    pub(super) clock: [f64; CLOCK],
    pub(super) commands: Vec<f64>,
    pub(super) memory: Vec<f64>,
}

fn sum((first, rows): (&str, u64), clock: &[f64], commands: &[f64], memory: &[f64]) -> String {
    let mut hash = Fingerprint::new();
    hash.bytes(first.as_bytes());
    hash.word(rows);
    for part in [clock, commands, memory] {
        hash.word(part.len() as u64);
        hash.numbers(part);
    }
    hash.hex()
}

impl State {
    /// Encodes the content of a file.
    pub fn encode(&self) -> io::Result<Vec<u8>> {
        let head = Head {
            version: VERSION,
            hydroid: HYDROID.to_owned(),
            model: self.model.clone(),
            settings: self.settings.clone(),
            first: self.first.clone(),
            rows: self.rows,
            sum: sum((&self.first, self.rows), &self.clock, &self.commands, &self.memory),
        };
        let bytes = |numbers: &[f64]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
        let tensors = [
            ("clock", bytes(&self.clock)),
            ("commands", bytes(&self.commands)),
            ("memory", bytes(&self.memory)),
        ];
        let views = tensors
            .iter()
            .map(|(name, bytes)| Ok((*name, TensorView::new(Dtype::F64, vec![bytes.len() / 8], bytes)?)))
            .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
            .map_err(io::Error::other)?;
        let metadata = HashMap::from([(KEY.to_owned(), serde_json::to_string(&head)?)]);
        safetensors::serialize(views, Some(metadata)).map_err(io::Error::other)
    }

    /// Decodes the content of a file.
    ///
    /// # Errors
    /// If the bytes are not a state file, or are truncated or altered; the text is the reason.
    pub fn decode(bytes: &[u8]) -> Result<Self, String> {
        let damaged = |reason: String| {
            format!("it is damaged, or not the state of a stream ({reason}); remove it to start again")
        };
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| damaged(e.to_string()))?;
        let tensors = SafeTensors::deserialize(bytes).map_err(|e| damaged(e.to_string()))?;
        let json = metadata.metadata().as_ref().and_then(|metadata| metadata.get(KEY));
        let json = json.ok_or_else(|| damaged(format!("the entry `{KEY}` is missing")))?;
        let value: Value = serde_json::from_str(json).map_err(|e| damaged(e.to_string()))?;
        let version = value["version"].as_u64();
        if let Some(version) = version.filter(|version| *version != u64::from(VERSION)) {
            return Err(format!(
                "it is a state of format {version}, and this program reads format {VERSION}; remove it to start again"
            ));
        }
        let head: Head = serde_json::from_value(value).map_err(|e| damaged(e.to_string()))?;
        let numbers = |name: &str| -> Result<Vec<f64>, String> {
            let tensor = tensors.tensor(name).map_err(|e| damaged(e.to_string()))?;
            if tensor.dtype() != Dtype::F64 || tensor.shape().len() != 1 {
                return Err(damaged(format!("`{name}` is not a vector of numbers")));
            }
            let (numbers, _) = tensor.data().as_chunks::<8>();
            Ok(numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
        };
        let (clock, commands, memory) = (numbers("clock")?, numbers("commands")?, numbers("memory")?);
        if sum((&head.first, head.rows), &clock, &commands, &memory) != head.sum {
            return Err(damaged("the checksum does not match".to_owned()));
        }
        let clock = clock.try_into().map_err(|_| damaged("invalid clock".to_owned()))?;
        if head.hydroid != HYDROID {
            return Err(format!(
                "it was written by hydroid {}, and the results of this version ({HYDROID}) may differ; remove it to start again",
                head.hydroid
            ));
        }
        let Head { model, settings, first, rows, .. } = head;
        Ok(Self { model, settings, first, rows, clock, commands, memory })
    }

    /// Checks that the state belongs to this model and these settings; the error is the reason.
    pub(super) fn fits(&self, model: &str, settings: &Value) -> Result<(), String> {
        if self.model != model {
            return Err(
                "it belongs to another model; give the model with which it was written, or name another file"
                    .to_owned(),
            );
        }
        let mut others = Vec::new();
        differences("", &self.settings, settings, &mut others);
        if others.is_empty() {
            return Ok(());
        }
        Err(format!("it belongs to other settings ({}); give these, or name another file", others.join("; ")))
    }

    pub(super) fn read(path: &Path) -> Result<Option<Self>, StreamError> {
        let wrong = |reason: String| StreamError::State { path: path.to_owned(), reason };
        match std::fs::metadata(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(wrong(format!("the file cannot be read ({error}); name another file"))),
            Ok(metadata) if !metadata.is_file() => {
                return Err(wrong("it is a folder or a device; name a file".to_owned()));
            }
            Ok(metadata) if metadata.len() > MAX_BYTES => {
                return Err(wrong("it is too large for a state; name another file".to_owned()));
            }
            Ok(_) => {}
        }
        let bytes = std::fs::read(path)
            .map_err(|e| wrong(format!("the file cannot be read ({e}); name another file")))?;
        Self::decode(&bytes).map(Some).map_err(wrong)
    }

    pub(super) fn write(&self, path: &Path) -> Result<(), StreamError> {
        let bytes = self.encode().map_err(|source| atomic::WriteError { path: path.to_owned(), source })?;
        Ok(atomic::write(path, |out| out.write_all(&bytes))?)
    }
}

/// Lists the leaves in which two JSON values differ.
pub(crate) fn differences(name: &str, saved: &Value, asked: &Value, into: &mut Vec<String>) {
    match (saved, asked) {
        (Value::Object(a), Value::Object(b)) => {
            let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
            for key in keys {
                let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                differences(&name, &saved[key], &asked[key], into);
            }
        }
        _ if saved != asked => into.push(format!("{name}: {saved} in the file, {asked} given")),
        _ => {}
    }
}
