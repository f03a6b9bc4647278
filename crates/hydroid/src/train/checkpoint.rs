//! Checkpoints of a training.
//!
//! One safetensors file, written atomically. For `r` restarts of `w` weights and `e` epochs of all restarts together it
//! holds in double precision (single precision is converted without loss):
//!
//! | tensor | shape | |
//! | --- | --- | --- |
//! | `weights`, `mean`, `square`, `best` | r x w | weights, Adam's moments, best weights so far |
//! | `balance` | r x n | weights of the n outputs in the next epoch's loss |
//! | `score` | r | validation error of the best weights |
//! | `history` | e x 3 | loss, validation error, step size; restart after restart |
//!
//! and in its metadata under `hydroid_training` a JSON [`Head`]. The state of the random streams follows from the epoch
//! ([`random`](super::random)). Reading never panics.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use hydroid_core::math::Scalar;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use web_time::Instant;

use super::fingerprint::fingerprints;
use super::restarts::{Restart, Restarts};
use super::{Epoch, Job, TrainError, TrainOptions};
use crate::atomic;

const KEY: &str = "hydroid_training";
const VERSION: u32 = 2;
const TOO_LARGE: &str =
    "it would be larger than 4 GiB; give fewer restarts, a smaller network, or no checkpoint";
const HYDROID: &str = env!("CARGO_PKG_VERSION");
/// Upper bound of the optimizer steps in a file, so that counting on does not overflow.
const MOST_STEPS: u64 = 1 << 52;
/// Largest size of a checkpoint \[bytes\].
const LARGEST: u64 = 1 << 32;

/// Least time between two writes.
const EVERY: Duration = Duration::from_millis(500);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    version: u32,
    /// Version of hydroid; another version may compute other values.
    hydroid: String,
    options: String,
    data: String,
    /// Planned and completed epochs.
    epochs: usize,
    epoch: usize,
    members: Vec<HeadRestart>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct HeadRestart {
    steps: u64,
    best_epoch: usize,
    epochs: usize,
    idle: bool,
}

/// Writes checkpoints and resumes from an existing one.
#[derive(Debug)]
pub(super) struct CheckpointWriter {
    path: Option<PathBuf>,
    fingerprints: [String; 2],
    written: Instant,
    /// Encoded state that is not yet on disk.
    pending: Option<Vec<u8>>,
}

impl CheckpointWriter {
    pub(super) fn open(path: Option<&Path>, job: &Job<'_>, options: &TrainOptions) -> Self {
        let fingerprints =
            if path.is_some() { fingerprints(job, options) } else { [String::new(), String::new()] };
        Self { path: path.map(Path::to_owned), fingerprints, written: Instant::now(), pending: None }
    }

    /// Resumes from the file; returns the number of completed epochs, or `None` without a file.
    pub(super) fn resume<T: Scalar>(&self, restarts: &mut Restarts<T>) -> Result<Option<usize>, TrainError> {
        let Some(path) = &self.path else { return Ok(None) };
        let wrong = |reason: String| TrainError::Checkpoint { path: path.clone(), reason };
        // The history is checked when it is read.
        if size(restarts.members.len(), restarts.plan.net.weights()) > LARGEST {
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
        decode(&bytes, &self.fingerprints, restarts).map(Some).map_err(wrong)
    }

    /// Stores the state after `epoch` epochs; writes are at least half a second apart.
    pub(super) fn keep<T: Scalar>(&mut self, restarts: &Restarts<T>, epoch: usize) -> Result<(), TrainError> {
        let Some(path) = &self.path else { return Ok(()) };
        let encoded = encode(restarts, epoch, &self.fingerprints);
        let source = |source| atomic::WriteError { path: path.clone(), source };
        let bytes = encoded.map_err(source)?;
        if bytes.len() as u64 > LARGEST {
            return Err(TrainError::Checkpoint { path: path.clone(), reason: TOO_LARGE.to_owned() });
        }
        self.pending = Some(bytes);
        if self.written.elapsed() >= EVERY { self.flush() } else { Ok(()) }
    }

    pub(super) fn flush(&mut self) -> Result<(), TrainError> {
        if let (Some(path), Some(bytes)) = (&self.path, self.pending.take()) {
            atomic::write(path, |out| out.write_all(&bytes))?;
            self.written = Instant::now();
        }
        Ok(())
    }
}

impl Job<'_> {
    /// Whether a readable file is the checkpoint of a training with these options, and with these data.
    pub fn is_kept_in(&self, options: &TrainOptions, path: &Path) -> [bool; 2] {
        let head = || -> Option<Head> {
            if !std::fs::metadata(path).is_ok_and(|m| m.is_file() && m.len() <= LARGEST) {
                return None;
            }
            let bytes = std::fs::read(path).ok()?;
            let (_, metadata) = SafeTensors::read_metadata(&bytes).ok()?;
            serde_json::from_str(metadata.metadata().as_ref()?.get(KEY)?).ok()
        };
        let ours = fingerprints(self, options);
        head().map_or([false; 2], |head| [head.options == ours[0], head.data == ours[1]])
    }
}

/// Bytes of the tables of `r` restarts of `w` weights.
fn size(r: usize, w: usize) -> u64 {
    (r as u64).saturating_mul(w as u64).saturating_mul(4 * 8)
}

pub(super) fn encode<T: Scalar>(
    restarts: &Restarts<T>,
    epoch: usize,
    fingerprints: &[String; 2],
) -> io::Result<Vec<u8>> {
    let [options, data] = fingerprints.clone();
    let members = &restarts.members;
    let head = Head {
        version: VERSION,
        hydroid: HYDROID.to_owned(),
        options,
        data,
        epochs: restarts.plan.epochs,
        epoch,
        members: members
            .iter()
            .map(|member| HeadRestart {
                steps: member.adam.steps,
                best_epoch: member.best_epoch,
                epochs: member.history.len(),
                idle: member.idle,
            })
            .collect(),
    };
    let table = |row: fn(&Restart<T>) -> &[T]| -> Vec<u8> {
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
    let (r, w) = (members.len(), restarts.plan.net.weights());
    let tensors = [
        ("weights", vec![r, w], table(|member| &member.weights)),
        ("mean", vec![r, w], table(|member| &member.adam.mean)),
        ("square", vec![r, w], table(|member| &member.adam.square)),
        ("best", vec![r, w], table(|member| &member.best)),
        ("balance", vec![r, restarts.plan.shape.outputs], balance),
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

/// Restores the state of a checkpoint of the same job; returns the number of completed epochs.
pub(super) fn decode<T: Scalar>(
    bytes: &[u8],
    ours: &[String; 2],
    restarts: &mut Restarts<T>,
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
            "it is of hydroid {theirs}, this is {HYDROID}, which may give other weights; resume with that version, or remove it to start anew"
        ));
    }
    for (what, theirs, ours) in [("options", &head.options, &ours[0]), ("data", &head.data, &ours[1])] {
        if theirs != ours {
            return Err(format!(
                "it is of a training with other {what}; resume with the original {what}, or remove it to start anew"
            ));
        }
    }
    let (r, w) = (restarts.members.len(), restarts.plan.net.weights());
    if head.members.len() != r || head.epoch > head.epochs || head.epochs > restarts.plan.options.epochs {
        return Err(damaged(String::from("its numbers of restarts and epochs are invalid")));
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
    let n = restarts.plan.shape.outputs;
    let balance = table("balance", &[r, n])?;
    let scores = table("score", &[r])?;
    let history = table("history", &[total, 3])?;
    let mut epochs = history.chunks_exact(3).map(|row| Epoch {
        train_loss: row[0],
        validation: row[1],
        learning_rate: row[2],
    });
    for (i, (member, told)) in restarts.members.iter_mut().zip(&head.members).enumerate() {
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
        if !is_sound(member) {
            return Err(damaged(format!(
                "the best weights of restart {} are not those of a training",
                i + 1
            )));
        }
    }
    restarts.plan.epochs = head.epochs;
    Ok(head.epoch)
}

/// Whether the best weights are numbers with a score, or there are none yet. The others may have diverged.
fn is_sound<T: Scalar>(member: &Restart<T>) -> bool {
    if member.best_epoch == 0 {
        return member.best_score == f64::INFINITY;
    }
    member.best_score.is_finite() && member.best.iter().all(|weight| weight.wide().is_finite())
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
