//! What stands in the folder of -o from before: trainings that were interrupted, models of earlier jobs.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use hydroid::identify::{Identified, IdentifyError, Job, Method};
use hydroid::log::Note;
use hydroid::train::{TrainError, refit_checkpoint};

/// Where the model of a method is written.
pub fn model_file(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}.safetensors"))
}

/// The model of an earlier job would pass for one of this: where a method gave none, it gets out of the way.
pub fn stale(folder: &Path, job: &Job, identified: &Identified) -> anyhow::Result<Vec<Note>> {
    let mut notes = Vec::new();
    for method in &job.methods {
        let file = model_file(folder, method.name());
        let made = identified.candidates.iter().any(|c| c.model.description.name == method.name());
        if made || !file.exists() {
            continue;
        }
        let old = file.with_extension("safetensors.old");
        std::fs::rename(&file, &old).with_context(|| {
            format!("{} is of an earlier job and cannot be renamed: move it away", file.display())
        })?;
        notes.push(Note::info(format!(
            "{} was of an earlier job, and this one gave no model by that method: it is now {}",
            file.display(),
            old.display()
        )));
    }
    Ok(notes)
}

/// Trainings that are kept.
pub fn kept(job: &Job) -> impl Iterator<Item = PathBuf> {
    let networks = job.methods.iter().copied().filter(|method| method.cell().is_some());
    let files = networks.filter_map(|method: Method| job.networks.checkpoint(method));
    files.flat_map(|file| [refit_checkpoint(&file), file]).filter(|file| file.exists())
}

/// An error after which something is there to go on from says so.
pub fn resumable(error: anyhow::Error, job: &Job) -> anyhow::Error {
    // Whoever insisted in vain is told what to do by the error.
    let in_vain = matches!(
        error.downcast_ref(),
        Some(IdentifyError::Train { error: TrainError::Checkpoint { .. }, .. })
    );
    if in_vain || kept(job).next().is_none() {
        return error;
    }
    error.context(
        "what was trained is kept up to its last epoch: the same command goes on from there (with --resume it insists)",
    )
}
