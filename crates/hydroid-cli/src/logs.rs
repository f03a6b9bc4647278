//! Reading of the logs that the command line names.

use std::path::{Path, PathBuf};

use anyhow::Context;
use hydroid::adapt::TrainingRuns;
use hydroid::log::{self, LogError, Note, Prepared, RawLog, Trajectory};
use hydroid::model::{Model, Reading};
use hydroid::recording;

use crate::args::Global;
use crate::ui;

/// The model with the sample time of the runs, which only vessels can change.
pub fn with_step_of(model: Model, runs: &[Trajectory]) -> anyhow::Result<Model> {
    Ok(match runs.first() {
        Some(run) => model.at_step(run.dt)?,
        None => model,
    })
}

/// The model with an estimate of the current, if one is requested. A model with such an estimate needs a heading.
pub fn with_current(model: Model, deviation_m_s: Option<f64>, runs: &[Trajectory]) -> anyhow::Result<Model> {
    let model = match deviation_m_s {
        Some(deviation_m_s) => model.with_current(deviation_m_s)?,
        None => model,
    };
    model.check_heading(runs)?;
    Ok(model)
}

/// Context of an error of a log that does not fit a model.
pub fn cannot_use(path: &Path, model: &Model) -> String {
    if model.is_vessel() {
        return format!("a log for the vessel {} cannot be used", path.display());
    }
    format!("a log for {} (sample time {} s) cannot be used", path.display(), model.description.dt)
}

/// The tables of logs of any format. What is found out about sensors is filled in the options.
pub fn read<P: AsRef<Path>>(
    files: &[P],
    reading: &mut Reading,
    global: Global,
) -> Result<(Vec<RawLog>, Vec<Note>), LogError> {
    let bar = ui::Bar::new("reading", global);
    recording::read_logs(files, &mut reading.selection, &reading.options, &mut bar.callback())
}

pub fn prepare(
    files: &[PathBuf],
    reading: &mut Reading,
    global: Global,
) -> Result<(Vec<RawLog>, Prepared), LogError> {
    let (raw, notes) = read(files, reading, global)?;
    let mut prepared = log::prepare(&raw, &reading.selection, &reading.options)?;
    prepared.notes.splice(0..0, notes);
    Ok((raw, prepared))
}

/// Training logs of a model, and the first `seconds` of each, which the filter processes.
pub fn training_logs(
    files: &[PathBuf],
    seconds: f64,
    (path, model): (&Path, &Model),
    reading: &Reading,
    global: Global,
) -> anyhow::Result<TrainingRuns> {
    let mut training = TrainingRuns::default();
    let mut reading = reading.clone();
    for file in files {
        let (_, prepared) = prepare(std::slice::from_ref(file), &mut reading, global)
            .with_context(|| cannot_use(path, model))?;
        ui::print_notes(&prepared.notes, global);
        model.check(&prepared.runs)?;
        training.replayed.extend(log::beginning(&prepared.runs, seconds));
        training.rehearsed.extend(prepared.runs);
    }
    Ok(training)
}
