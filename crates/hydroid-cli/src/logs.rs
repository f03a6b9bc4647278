//! Reading of the logs that the command line names.

use std::path::{Path, PathBuf};

use anyhow::Context;
use hydroid::adapt::TrainingRuns;
use hydroid::log::{self, LogError, Prepared, RawLog, Trajectory};
use hydroid::model::{Model, Reading};

use crate::args::{Global, LogArgs};
use crate::ui;

/// Reading options: `base` (defaults, configuration file or model), overridden by the command line.
pub fn reading(base: Reading, args: &LogArgs) -> Result<Reading, LogError> {
    let mut reading = base;
    let selection = &mut reading.selection;
    if let Some(time) = &args.time {
        selection.time = Some(time.clone());
    }
    if let Some(outputs) = &args.outputs {
        selection.outputs = log::ChannelSpec::parse_list(outputs)?;
    }
    if let Some(inputs) = &args.inputs {
        selection.inputs = log::ChannelSpec::parse_list(inputs)?;
    }
    if let Some(heading) = &args.heading {
        selection.heading = Some(heading.parse()?);
    }
    if let Some(wind) = &args.wind {
        selection.wind = Some(wind.parse()?);
    }
    let options = &mut reading.options;
    options.dt = args.dt.or(options.dt);
    options.max_gap_s = args.max_gap.or(options.max_gap_s);
    options.command_timing = args.command_timing.unwrap_or(options.command_timing);
    options.input_delay = args.input_delay.unwrap_or(options.input_delay);
    options.keep_towed |= args.keep_towed;
    Ok(reading)
}

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

pub fn prepare(files: &[PathBuf], reading: &Reading) -> Result<(Vec<RawLog>, Prepared), LogError> {
    let raw = files.iter().map(|file| log::read(file)).collect::<Result<Vec<_>, _>>()?;
    let prepared = log::prepare(&raw, &reading.selection, &reading.options)?;
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
    for file in files {
        let (_, prepared) =
            prepare(std::slice::from_ref(file), reading).with_context(|| cannot_use(path, model))?;
        ui::print_notes(&prepared.notes, global);
        model.check(&prepared.runs)?;
        training.replayed.extend(log::beginning(&prepared.runs, seconds));
        training.rehearsed.extend(prepared.runs);
    }
    Ok(training)
}
