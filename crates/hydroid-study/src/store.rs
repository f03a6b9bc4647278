//! Results that are kept, each under a fingerprint of all that it depends on.
//!
//! A result is read back instead of made where the same was made before: of the same settings, from the same records and
//! models, by the same program. Files are written whole or not at all, so that whatever is there can be trusted after a
//! process was killed; one that cannot be read is made again.

use std::fmt::Debug;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::StudyError;
use hydroid::atomic;
use hydroid::fingerprint::Fingerprint;
use hydroid::model::{self, Model};

/// A fingerprint of a result and all that it depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Key(u64);

/// A folder of results.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
    program: u64,
}

impl Store {
    /// In a folder; `program` is a fingerprint of what makes the results.
    pub fn new(folder: impl Into<PathBuf>, program: u64) -> Self {
        Self { folder: folder.into(), program }
    }

    /// The key of something that is described by `what` and depends on others.
    ///
    /// It is made of the words of `Debug`: JSON knows no infinity.
    pub(super) fn key(&self, kind: &str, what: &impl Debug, on: &[Key]) -> Key {
        let mut hash = Fingerprint::new();
        hash.word(self.program);
        hash.text(kind);
        hash.text(&format!("{what:?}"));
        for key in on {
            hash.word(key.0);
        }
        Key(hash.value())
    }

    fn path(&self, name: &str, key: Key, extension: &str) -> PathBuf {
        self.folder.join(format!("{name}-{:016x}.{extension}", key.0))
    }

    /// The result under a key, made if it is not there.
    pub(super) fn get<T: Serialize + DeserializeOwned>(
        &self,
        name: &str,
        key: Key,
        make: impl FnOnce() -> Result<T, StudyError>,
    ) -> Result<T, StudyError> {
        let path = self.path(name, key, "json");
        if let Some(kept) = kept(&path) {
            return Ok(kept);
        }
        let made = make()?;
        write(&path, &made)?;
        // What is read back is what others will see: a number that JSON has not would show here and not a run later.
        kept(&path).ok_or_else(|| {
            StudyError::Result(format!(
                "the result '{name}' has numbers that cannot be kept (NaN or infinite)"
            ))
        })
    }

    /// The model under a key with what is told of it, made if they are not there.
    pub(super) fn model<T: Serialize + DeserializeOwned>(
        &self,
        name: &str,
        key: Key,
        make: impl FnOnce() -> Result<(Model, T), StudyError>,
    ) -> Result<(Model, T), StudyError> {
        let (path, told) = (self.path(name, key, "safetensors"), self.path(name, key, "json"));
        if let (Some(told), Ok(model)) = (kept(&told), model::read(&path)) {
            return Ok((model, told));
        }
        let (made, about) = make()?;
        model::write(&made, &path)?;
        write(&told, &about)?;
        // The same from a file as from memory: a second run must not differ.
        let model = model::read(&path).map_err(|error| StudyError::Result(error.to_string()))?;
        Ok((model, about))
    }
}

fn write(path: &Path, value: &impl Serialize) -> Result<(), StudyError> {
    let bytes = serde_json::to_vec(value).map_err(|error| StudyError::Result(error.to_string()))?;
    atomic::write(path, |out| out.write_all(&bytes))?;
    Ok(())
}

fn kept<T: DeserializeOwned>(path: &Path) -> Option<T> {
    serde_json::from_slice(&std::fs::read(path).ok()?).ok()
}

/// A fingerprint of the program that runs: its own file, byte for byte.
pub fn program() -> u64 {
    let mut hash = Fingerprint::new();
    hash.text(env!("CARGO_PKG_VERSION"));
    if let Ok(bytes) = std::env::current_exe().and_then(std::fs::read) {
        hash.bytes(&bytes);
    } else {
        // Not known: then no result is of this program but those that it makes now.
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        hash.text(&format!("{now:?} {}", std::process::id()));
    }
    hash.value()
}
