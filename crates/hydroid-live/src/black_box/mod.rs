//! The black box of a learner: a ring file with the last minutes of what it was given and what came of it, from which
//! the same can be made again, bit for bit.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`Recorded`], [`Recorder`] | the adapter on whose walk all calls are noted; what notes them |
//! | `record`, `event` | a step of the walk as a row of numbers |
//! | `head`, `ring` | the file: its head, and the ring of segments behind it |
//! | [`BlackBox`] | a file that was read; [`Step`], a row of it; [`Summary`], what is to be said of it all |
//! | [`replay`](fn@replay) | makes the adapter again, gives it the same calls, and compares |
//!
//! # File
//!
//! ```text
//! head      "HYDROBOX", format version (u32), length of the JSON (u32), its sum (u64), the JSON
//! segment   start: "SEGMENT\n", sequence, steps before it, whether it goes on where the one before ended,
//!           sum of the memory, sum of the start (six u64)
//!           memory: all that the adapter goes on from, f64
//!           steps: a row of f64 each, and its sum (u64)
//! ```
//!
//! All is little-endian; sums are XXH3 (64 bits). Segments have their places, one behind the other, and are written in turn. The sum of
//! a step depends on sequence and place, so that a row that an earlier turn has left is none of this one. A step that is not
//! whole ends its segment: the kill came there.

mod event;
mod head;
mod made;
mod read;
mod record;
mod recorded;
mod recorder;
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
pub use recorded::Recorded;
pub use recorder::{Recorder, Source};
pub use replay::{Difference, Replayed, replay};
pub use step::Step;
pub use summary::{Outcomes, Summary};

/// Minutes that a box holds where nothing else is asked for, and at the least.
pub const MINUTES: f64 = 5.0;
/// See [`MINUTES`].
pub const FEWEST_MINUTES: f64 = 2.0;
/// The most minutes that a box can hold: a week.
pub const MOST_MINUTES: f64 = 7.0 * 24.0 * 60.0;

/// Where to keep a black box, and of which model.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The file.
    pub path: PathBuf,
    /// Minutes that it holds at the least, once they have passed.
    pub minutes: f64,
    /// The model's file.
    pub model: ModelFile,
}

/// Why a black box cannot be written, read or replayed.
#[derive(Debug, thiserror::Error)]
pub enum BlackBoxError {
    /// A file that is no box, or damaged, or of another model.
    #[error("the black box {} cannot be used: {reason}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
    /// It cannot hold so much, or so little.
    #[error("a black box of {minutes} minutes: give from {FEWEST_MINUTES} to {MOST_MINUTES}")]
    Minutes {
        /// Asked for.
        minutes: f64,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The model cannot be adapted.
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
    // A pipe gives its bytes once.
    if !path.metadata().is_ok_and(|m| m.is_file()) {
        return false;
    }
    let mut magic = [0; head::MAGIC.len()];
    std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok()
        && magic == *head::MAGIC
}

/// [`adapt`](fn@hydroid::adapt::adapt) with an adapter that has learned the runs of `shore`, and with a recording of the
/// adapter if `recording` says where.
///
/// # Errors
/// If the model cannot be adapted on these runs, or the recording cannot be written.
pub fn adapt_recorded(
    model: &Model,
    shore: &TrainingRuns,
    runs: &[&Trajectory],
    options: &Options,
    recording: Option<&Settings>,
    progress: Progress<'_>,
) -> Result<Adapted, BlackBoxError> {
    let (mut adapter, used) = adapter(model, options, runs)?;
    shore.remember(adapter.as_mut());
    let frozen = Frozen::evaluate(model, &used, runs, options, progress)?;
    let recorder = match recording {
        Some(settings) => {
            let described = serde_json::json!({ "learning": used });
            Some(Recorder::new(settings, model, adapter.as_ref(), options, &described, Source::Runs(runs))?)
        }
        None => None,
    };
    let mut adapter = Recorded::new(adapter, recorder);
    let adapted = adapt_by(model, &mut adapter, used, frozen, runs, options, progress)?;
    adapter.finish()?;
    Ok(adapted)
}
