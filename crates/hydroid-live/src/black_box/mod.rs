//! Black box of an adapter: a ring file with the calls and results of the last minutes, which can be replayed bit for
//! bit.
//!
//! | part | content |
//! | --- | --- |
//! | [`RecordingAdapter`], [`Recorder`] | wrapper around an adapter; writer of its calls |
//! | `record`, `event` | a step as a row of numbers |
//! | `head`, `ring` | header of the file, and ring of segments |
//! | [`BlackBox`] | a file that was read; [`Step`], one of its rows; [`Summary`] of all rows |
//! | [`replay`](fn@replay) | rebuilds the adapter, repeats the calls, and compares the results |
//!
//! # File
//!
//! ```text
//! head      "HYDROBOX", format version (u32), length of the JSON (u32), its sum (u64), the JSON
//! segment   start: "SEGMENT\n", sequence, steps before it, whether it continues the previous one,
//!           sum of the memory, sum of the start (six u64)
//!           memory: state of the adapter, f64
//!           steps: a row of f64 each, and its sum (u64)
//! ```
//!
//! All numbers are little-endian, and sums are XXH3 (64 bits). Segments are written in turn. The sum of a step depends
//! on sequence and position, so that rows of an earlier turn are recognized. An incomplete step ends its segment.

#[doc(hidden)]
pub mod event;
mod head;
mod read;
mod rebuild;
mod record;
mod recorder;
mod recording_adapter;
mod replay;
mod ring;
mod step;
mod summary;

use std::path::{Path, PathBuf};

use hydroid::adapt::{AdaptError, Adapted, Frozen, Options, TrainingRuns, adapt_by, adapter};
use hydroid::atomic::WriteError;
use hydroid::log::Trajectory;
use hydroid::model::Model;
use hydroid::progress::Progress;

pub use head::{Head, ModelFile};
pub use read::BlackBox;
pub use recorder::{Recorder, Source};
pub use recording_adapter::RecordingAdapter;
pub use replay::{Difference, Replayed, replay};
pub use step::Step;
pub use summary::{Outcomes, Summary};

/// Default duration of a recording \[min\].
pub const DEFAULT_MINUTES: f64 = 5.0;
/// Least duration of a recording \[min\].
pub const MIN_MINUTES: f64 = 2.0;
/// Largest duration of a recording \[min\]: a week.
pub const MAX_MINUTES: f64 = 7.0 * 24.0 * 60.0;

/// Options of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingOptions {
    pub path: PathBuf,
    /// Least duration that the file holds \[min\].
    pub minutes: f64,
    pub model: ModelFile,
}

/// Errors of a black box.
#[derive(Debug, thiserror::Error)]
pub enum BlackBoxError {
    /// The file is not a black box, or is damaged, or belongs to another model.
    #[error("the black box {} cannot be used: {reason}", path.display())]
    Unusable { path: PathBuf, reason: String },
    #[error("a black box of {minutes} minutes is not possible; give {MIN_MINUTES} to {MAX_MINUTES}")]
    Minutes { minutes: f64 },
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error(transparent)]
    Adapt(#[from] AdaptError),
}

impl BlackBoxError {
    fn unusable(path: &Path, reason: impl Into<String>) -> Self {
        Self::Unusable { path: path.to_owned(), reason: reason.into() }
    }
}

/// Whether a file is a black box, by its first bytes.
pub fn is_black_box(path: &Path) -> bool {
    use std::io::Read as _;
    // A pipe can be read only once.
    if !path.metadata().is_ok_and(|m| m.is_file()) {
        return false;
    }
    let mut magic = [0; head::MAGIC.len()];
    std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok()
        && magic == *head::MAGIC
}

/// [`adapt`](fn@hydroid::adapt::adapt) with an adapter that has learned from the `training` runs, with an optional
/// recording of the adapter.
///
/// # Errors
/// If the model cannot be adapted on these runs, or the recording cannot be written.
pub fn adapt_recorded(
    model: &Model,
    training: &TrainingRuns,
    runs: &[&Trajectory],
    options: &Options,
    recording: Option<&RecordingOptions>,
    progress: Progress<'_>,
) -> Result<Adapted, BlackBoxError> {
    let (mut adapter, used) = adapter(model, options, runs)?;
    training.remember(adapter.as_mut());
    let frozen = Frozen::evaluate(model, &used, runs, options, progress)?;
    let recorder = match recording {
        Some(settings) => {
            let described = serde_json::json!({ "learning": used });
            Some(Recorder::new(settings, model, adapter.as_mut(), options, &described, Source::Runs(runs))?)
        }
        None => None,
    };
    let mut adapter = RecordingAdapter::new(adapter, recorder);
    let adapted = adapt_by(model, &mut adapter, used, frozen, runs, options, progress)?;
    adapter.finish()?;
    Ok(adapted)
}
