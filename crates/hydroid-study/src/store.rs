//! Store of results, each under a fingerprint of its dependencies.
//!
//! A result is read back if it was computed before with the same options, records, models and program. Files are
//! written atomically, so that a killed process leaves no partial file; an unreadable file is computed again.

use std::fmt::Debug;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::StudyError;
use hydroid::atomic;
use hydroid::fingerprint::Fingerprint;
use hydroid::model::{self, Model};

/// Fingerprint of a result and its dependencies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub(super) struct Key(u64);

/// A folder of stored results.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
    program: u64,
}

impl Store {
    /// Opens a folder; `program` is a fingerprint of the program.
    pub fn new(folder: impl Into<PathBuf>, program: u64) -> Self {
        Self { folder: folder.into(), program }
    }

    /// Key of a result described by `what` with dependencies `on`. It hashes the `Debug` text, because JSON has no
    /// infinity.
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

    /// The result of a key, computed if it is not stored.
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
        // Reading back the file reveals non-finite numbers at once, and not in a later run.
        kept(&path).ok_or_else(|| {
            StudyError::Result(format!(
                "the result '{name}' contains numbers that cannot be stored (NaN or infinite)"
            ))
        })
    }

    /// The model of a key with its training data, computed if they are not stored.
    pub(super) fn model<T: Serialize + DeserializeOwned>(
        &self,
        name: &str,
        key: Key,
        make: impl FnOnce() -> Result<(Model, T), StudyError>,
    ) -> Result<(Model, T), StudyError> {
        let (path, about_path) = (self.path(name, key, "safetensors"), self.path(name, key, "json"));
        if let (Some(about), Ok(model)) = (kept(&about_path), model::read(&path)) {
            return Ok((model, about));
        }
        let (made, about) = make()?;
        model::write(&made, &path)?;
        write(&about_path, &about)?;
        // Reading back the file makes first and later runs identical.
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

/// Fingerprint of the running program: hash of its executable.
pub fn program() -> u64 {
    let mut hash = Fingerprint::new();
    hash.text(env!("CARGO_PKG_VERSION"));
    if let Ok(bytes) = std::env::current_exe().and_then(std::fs::read) {
        hash.bytes(&bytes);
    } else {
        // Unknown executable: only results of this process are reused.
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        hash.text(&format!("{now:?} {}", std::process::id()));
    }
    hash.value()
}
