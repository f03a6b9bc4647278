//! The state of a training as a file, so that an interruption loses little.
//!
//! One safetensors file, written whole or not at all. With `r` restarts of `w` weights and `e` epochs of all restarts
//! together it holds, in double precision (single-precision numbers come back as they were):
//!
//! | tensor | shape | |
//! | --- | --- | --- |
//! | `weights`, `mean`, `square`, `best` | r x w | weights, Adam's moments, best weights so far |
//! | `balance` | r x n | weights of the n outputs in the next epoch's loss |
//! | `score` | r | validation error of the best weights |
//! | `history` | e x 3 | loss, validation error, step size; restart after restart |
//!
//! and in its metadata under `hydroid_training` a JSON [`Head`]. Random numbers need nothing but the number of the epoch
//! ([`random`](super::random)). Reading never panics.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use hydroid_core::math::Scalar;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use super::fingerprint::fingerprints;
use super::team::{Member, Team};
use super::{Epoch, Job, Settings, TrainError};
use crate::atomic;

const KEY: &str = "hydroid_training";
const VERSION: u32 = 2;
const TOO_LARGE: &str =
    "it would be larger than 4 GiB; give fewer restarts, a smaller network, or no checkpoint";
const HYDROID: &str = env!("CARGO_PKG_VERSION");
/// More steps than any training makes; counting on from here overflows nothing.
const MOST_STEPS: u64 = 1 << 52;
/// Larger files are no checkpoints.
const LARGEST: u64 = 1 << 32;

/// Epochs shorter than this are not each written to the disk.
const EVERY: Duration = Duration::from_millis(500);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    version: u32,
    /// Version of hydroid: another one may train otherwise.
    hydroid: String,
    settings: String,
    data: String,
    /// Epochs that are planned, and that are done.
    epochs: usize,
    epoch: usize,
    members: Vec<HeadMember>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct HeadMember {
    steps: u64,
    best_epoch: usize,
    epochs: usize,
    idle: bool,
}

/// Writes checkpoints and reads the one that is there.
#[derive(Debug)]
pub(super) struct Keeper {
    path: Option<PathBuf>,
    fingerprints: [String; 2],
    written: Instant,
    /// Bytes that are not on the disk yet.
    pending: Option<Vec<u8>>,
}

impl Keeper {
    pub(super) fn open(path: Option<&Path>, job: &Job<'_>, settings: &Settings) -> Self {
        // Nobody asks for fingerprints without a file.
        let fingerprints =
            if path.is_some() { fingerprints(job, settings) } else { [String::new(), String::new()] };
        Self { path: path.map(Path::to_owned), fingerprints, written: Instant::now(), pending: None }
    }

    /// Takes up what the file holds; gives the number of epochs that are done, or nothing where there is no file.
    pub(super) fn resume<T: Scalar>(&self, team: &mut Team<T>) -> Result<Option<usize>, TrainError> {
        let Some(path) = &self.path else { return Ok(None) };
        let wrong = |reason: String| TrainError::Checkpoint { path: path.clone(), reason };
        // The rest, a few numbers for each epoch, is looked at when it is there.
        if size(team.members.len(), team.plan.net.weights()) > LARGEST {
            return Err(wrong(TOO_LARGE.to_owned()));
        }
        let unreadable = |e: io::Error| wrong(format!("it cannot be read ({e}); name another file"));
        match std::fs::metadata(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(unreadable(error)),
            Ok(metadata) if !metadata.is_file() => {
                return Err(wrong(String::from("it is a folder or a device: name a file")));
            }
            Ok(metadata) if metadata.len() > LARGEST => {
                return Err(wrong(String::from("it is too large for a checkpoint: name another file")));
            }
            Ok(_) => {}
        }
        let bytes = std::fs::read(path).map_err(unreadable)?;
        decode(&bytes, &self.fingerprints, team).map(Some).map_err(wrong)
    }

    /// Keeps the state after so many epochs. Short epochs are not all written at once, so that at most one epoch or
    /// half a second is lost, whichever is longer.
    pub(super) fn keep<T: Scalar>(&mut self, team: &Team<T>, epoch: usize) -> Result<(), TrainError> {
        let Some(path) = &self.path else { return Ok(()) };
        let encoded = encode(team, epoch, &self.fingerprints);
        let source = |source| atomic::WriteError { path: path.clone(), source };
        let bytes = encoded.map_err(source)?;
        if bytes.len() as u64 > LARGEST {
            return Err(TrainError::Checkpoint { path: path.clone(), reason: TOO_LARGE.to_owned() });
        }
        self.pending = Some(bytes);
        if self.written.elapsed() >= EVERY { self.flush() } else { Ok(()) }
    }

    /// Writes what is not written yet.
    pub(super) fn flush(&mut self) -> Result<(), TrainError> {
        if let (Some(path), Some(bytes)) = (&self.path, self.pending.take()) {
            atomic::write(path, |out| out.write_all(&bytes))?;
            self.written = Instant::now();
        }
        Ok(())
    }
}

impl Job<'_> {
    /// Whether a file is the checkpoint of a training with these settings, and of one on these data (both false where it
    /// cannot be read as a checkpoint): to know it before time is spent on what the training needs.
    pub fn is_kept_in(&self, settings: &Settings, path: &Path) -> [bool; 2] {
        let head = || -> Option<Head> {
            if !std::fs::metadata(path).is_ok_and(|m| m.is_file() && m.len() <= LARGEST) {
                return None;
            }
            let bytes = std::fs::read(path).ok()?;
            let (_, metadata) = SafeTensors::read_metadata(&bytes).ok()?;
            serde_json::from_str(metadata.metadata().as_ref()?.get(KEY)?).ok()
        };
        let ours = fingerprints(self, settings);
        head().map_or([false; 2], |head| [head.settings == ours[0], head.data == ours[1]])
    }
}

/// Bytes of the tables of `r` restarts of `w` weights.
fn size(r: usize, w: usize) -> u64 {
    (r as u64).saturating_mul(w as u64).saturating_mul(4 * 8)
}

pub(super) fn encode<T: Scalar>(
    team: &Team<T>,
    epoch: usize,
    fingerprints: &[String; 2],
) -> io::Result<Vec<u8>> {
    let [settings, data] = fingerprints.clone();
    let members = &team.members;
    let head = Head {
        version: VERSION,
        hydroid: HYDROID.to_owned(),
        settings,
        data,
        epochs: team.plan.epochs,
        epoch,
        members: members
            .iter()
            .map(|member| HeadMember {
                steps: member.adam.steps,
                best_epoch: member.best_epoch,
                epochs: member.history.len(),
                idle: member.idle,
            })
            .collect(),
    };
    let table = |row: fn(&Member<T>) -> &[T]| -> Vec<u8> {
        members.iter().flat_map(row).flat_map(|x| x.wide().to_le_bytes()).collect()
    };
    let epochs = members.iter().flat_map(|member| &member.history);
    let history: Vec<u8> = epochs
        .clone()
        .flat_map(|epoch| [epoch.train_loss, epoch.validation, epoch.learning_rate])
        .flat_map(f64::to_le_bytes)
        .collect();
    let balance = members.iter().flat_map(|member| &member.balance);
    let balance: Vec<u8> = balance.flat_map(|x| x.to_le_bytes()).collect();
    let scores: Vec<u8> = members.iter().flat_map(|member| member.best_score.to_le_bytes()).collect();
    let (r, w) = (members.len(), team.plan.net.weights());
    let tensors = [
        ("weights", vec![r, w], table(|member| &member.weights)),
        ("mean", vec![r, w], table(|member| &member.adam.mean)),
        ("square", vec![r, w], table(|member| &member.adam.square)),
        ("best", vec![r, w], table(|member| &member.best)),
        ("balance", vec![r, team.plan.shape.outputs], balance),
        ("score", vec![r], scores),
        ("history", vec![epochs.count(), 3], history),
    ];
    let views = tensors
        .iter()
        .map(|(name, shape, bytes)| Ok((*name, TensorView::new(Dtype::F64, shape.clone(), bytes)?)))
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
        .map_err(io::Error::other)?;
    let metadata = HashMap::from([(KEY.to_owned(), serde_json::to_string(&head)?)]);
    safetensors::serialize(views, Some(metadata)).map_err(io::Error::other)
}

/// Puts the state of a checkpoint into a team of the same job, and gives the number of epochs that are done.
pub(super) fn decode<T: Scalar>(
    bytes: &[u8],
    ours: &[String; 2],
    team: &mut Team<T>,
) -> Result<usize, String> {
    let damaged = |reason: String| {
        format!("it is damaged, or no checkpoint of a training ({reason}); remove it to start anew")
    };
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| damaged(e.to_string()))?;
    let tensors = SafeTensors::deserialize(bytes).map_err(|e| damaged(e.to_string()))?;
    let json = metadata.metadata().as_ref().and_then(|m| m.get(KEY));
    let json = json.ok_or_else(|| damaged(format!("its metadata has no '{KEY}'")))?;
    let value: serde_json::Value = serde_json::from_str(json).map_err(|e| damaged(e.to_string()))?;
    if value.get("version").and_then(serde_json::Value::as_u64) != Some(u64::from(VERSION)) {
        return Err(format!(
            "it is of another version of hydroid, this one has format {VERSION}; remove it to start anew"
        ));
    }
    let head: Head = serde_json::from_value(value).map_err(|e| damaged(e.to_string()))?;
    if head.hydroid != HYDROID {
        let theirs = &head.hydroid;
        return Err(format!(
            "it is of hydroid {theirs}, this is {HYDROID}, which may train otherwise; go on with that version, or remove it to start anew"
        ));
    }
    for (what, theirs, ours) in [("settings", &head.settings, &ours[0]), ("data", &head.data, &ours[1])] {
        if theirs != ours {
            return Err(format!(
                "it is of a training with other {what}; go on with those that it began with, or remove it to start anew"
            ));
        }
    }
    let (r, w) = (team.members.len(), team.plan.net.weights());
    if head.members.len() != r || head.epoch > head.epochs || head.epochs > team.plan.settings.epochs {
        return Err(damaged(String::from("its numbers of restarts and epochs cannot be")));
    }
    let total = head.members.iter().try_fold(0usize, |sum, member| {
        let can_be =
            member.epochs <= head.epoch && member.best_epoch <= member.epochs && member.steps <= MOST_STEPS;
        if can_be { sum.checked_add(member.epochs) } else { None }
    });
    let total = total.ok_or_else(|| damaged(String::from("its epochs do not add up")))?;
    let table = |name: &str, shape: &[usize]| numbers(&tensors, name, shape).map_err(damaged);
    let [weights, mean, square, best] = [
        table("weights", &[r, w])?,
        table("mean", &[r, w])?,
        table("square", &[r, w])?,
        table("best", &[r, w])?,
    ];
    let n = team.plan.shape.outputs;
    let balance = table("balance", &[r, n])?;
    let scores = table("score", &[r])?;
    let history = table("history", &[total, 3])?;
    let mut epochs = history.chunks_exact(3).map(|row| Epoch {
        train_loss: row[0],
        validation: row[1],
        learning_rate: row[2],
    });
    for (i, (member, told)) in team.members.iter_mut().zip(&head.members).enumerate() {
        let row = |table: &[f64]| table[i * w..(i + 1) * w].iter().map(|&x| T::of(x)).collect::<Vec<T>>();
        member.weights = row(&weights);
        member.adam.mean = row(&mean);
        member.adam.square = row(&square);
        member.adam.steps = told.steps;
        member.best = row(&best);
        member.best_score = scores[i];
        member.balance.copy_from_slice(&balance[i * n..(i + 1) * n]);
        member.best_epoch = told.best_epoch;
        member.history = epochs.by_ref().take(told.epochs).collect();
        member.idle = told.idle;
    }
    team.plan.epochs = head.epochs;
    Ok(head.epoch)
}

fn numbers(tensors: &SafeTensors<'_>, name: &str, shape: &[usize]) -> Result<Vec<f64>, String> {
    let tensor = tensors.tensor(name).map_err(|_| format!("tensor '{name}' is missing"))?;
    if tensor.dtype() != Dtype::F64 || tensor.shape() != shape {
        return Err(format!(
            "tensor '{name}' is {:?} {:?}, not F64 {shape:?}",
            tensor.dtype(),
            tensor.shape()
        ));
    }
    let (chunks, _) = tensor.data().as_chunks::<8>();
    Ok(chunks.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
}
