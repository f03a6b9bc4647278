//! Earlier contents of the output folder: checkpoints of interrupted trainings, and models of other jobs.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use hydroid::identify::{IdentifyError, IdentifyResult, Job, Method};
use hydroid::log::Note;
use hydroid::train::{TrainError, refit_checkpoint};

pub fn model_file(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}.safetensors"))
}

/// Renames models of an earlier job whose method gave no model in this one, so that they do not pass for its results.
pub fn move_stale_models(folder: &Path, job: &Job, identified: &IdentifyResult) -> anyhow::Result<Vec<Note>> {
    let mut notes = Vec::new();
    for method in &job.methods {
        let file = model_file(folder, method.name());
        let made = identified.candidates.iter().any(|c| c.model.description.name == method.name());
        if made || !file.exists() {
            continue;
        }
        let old = file.with_extension("safetensors.old");
        std::fs::rename(&file, &old).with_context(|| {
            format!(
                "{} belongs to an earlier job and cannot be renamed: move it to another folder",
                file.display()
            )
        })?;
        notes.push(Note::info(format!(
            "{} belongs to an earlier job, and this job gave no model by that method; it was renamed to {}",
            file.display(),
            old.display()
        )));
    }
    Ok(notes)
}

pub fn checkpoints(job: &Job) -> impl Iterator<Item = PathBuf> {
    let networks = job.methods.iter().copied().filter(|method| method.cell().is_some());
    let files = networks.filter_map(|method: Method| job.networks.checkpoint(method));
    files.flat_map(|file| [refit_checkpoint(&file), file]).filter(|file| file.exists())
}

/// Adds the remedy of resuming the training, if a checkpoint exists.
pub fn with_resume_hint(error: anyhow::Error, job: &Job) -> anyhow::Error {
    // This error has its own remedy.
    let refused = matches!(
        error.downcast_ref(),
        Some(IdentifyError::Train { error: TrainError::Checkpoint { .. }, .. })
    );
    if refused || checkpoints(job).next().is_none() {
        return error;
    }
    error.context(
        "the training was saved after its last epoch; run the same command again to continue it (--resume makes this mandatory)",
    )
}
