//! Identification.

use std::path::PathBuf;
use std::sync::Arc;

use hydroid::config::{Logs, Split};
use hydroid::identify::{IdentifyResult, identify as identify_job};
use hydroid::log::{self, Note};
use hydroid_report::Context;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{internal, unfit, value};
use crate::log::{Given, logs, of_log, tables, warn};
use crate::model::Model;
use crate::settings;
use crate::work::{self, Control};

/// Result of an identification. The Python class around it has the documented interface.
#[pyclass(frozen, module = "hydroid._hydroid")]
pub(crate) struct Identification {
    result: Arc<IdentifyResult>,
    split: Arc<log::Split>,
    notes: Vec<Note>,
    sources: Vec<String>,
    seed: u64,
}

#[pymethods]
impl Identification {
    fn models(&self) -> Vec<Model> {
        self.result.candidates.iter().map(|candidate| Model::of(candidate.model.clone())).collect()
    }

    fn best(&self) -> Option<usize> {
        self.result.best
    }

    /// The document of `hydroid identify --json` without the files of the models.
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        settings::document(py, &self.result.summary(&self.notes))
    }

    /// The report, an HTML page.
    #[pyo3(signature = (title, command))]
    fn report(&self, py: Python<'_>, title: Option<String>, command: String) -> PyResult<String> {
        let context = Context {
            command,
            sources: self.sources.clone(),
            notes: self.notes.clone(),
            seed: self.seed,
            ..Context::default()
        };
        let context = match title {
            Some(title) => Context { title, ..context },
            None => context,
        };
        let (result, split) = (Arc::clone(&self.result), Arc::clone(&self.split));
        let page = work::run(py, None, None, move |_| {
            hydroid_report::identification(&result, &split, &context).map_err(|error| error.to_string())
        })?;
        page.map_err(internal)
    }
}

/// Identifies models. `options` are sections of `hydroid.toml`, over those of the file `config`.
#[pyfunction]
#[pyo3(signature = (train, validate, test, options, config=None, vessel=None, threads=None, progress=None))]
pub(crate) fn identify(
    py: Python<'_>,
    train: &Bound<'_, PyAny>,
    validate: &Bound<'_, PyAny>,
    test: &Bound<'_, PyAny>,
    options: &Bound<'_, PyDict>,
    config: Option<PathBuf>,
    vessel: Option<PathBuf>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Identification> {
    let mut config = settings::config(config.as_deref(), options)?;
    let mut reading = config.reading().map_err(value)?;
    let mut given = Logs {
        train: logs("logs", train)?,
        validate: logs("validate", validate)?,
        test: logs("test", test)?,
    };
    let Split { train, validate, test } = std::mem::take(&mut config.split);
    for (given, files) in
        [(&mut given.train, train), (&mut given.validate, validate), (&mut given.test, test)]
    {
        if given.is_empty() {
            given.extend(files.into_iter().map(Given::Path));
        }
    }
    let vessel = match vessel {
        Some(path) => {
            let model = hydroid::model::read(&path).map_err(value)?;
            let Some(file) = model.craft_file() else {
                return Err(unfit("vessel", "a vessel file with actuators", path.display()));
            };
            Some(file.clone())
        }
        None => None,
    };
    // Velocities from sensors take about as long as the models.
    let share = if reading.selection.sensors.is_some() { 0.5 } else { 0.0 };
    let reading_logs = move |control: &Control, done: f64| control.report(share * done);
    let (raw, mut notes) =
        tables(py, &given.all().collect::<Vec<_>>(), &mut reading, progress, reading_logs)?;
    let sources = raw.iter().map(|log| log.path.clone()).collect();
    let mut raw = raw.into_iter();
    let raw = given.map(|_| raw.next().expect("one table for each log"));
    let (job, found) =
        work::run(py, threads, None, move |_| config.job(reading, &raw, vessel))?.map_err(of_log)?;
    notes.extend(found);
    warn(py, &notes)?;
    let seed = job.seed;
    let (result, split) = work::run(py, threads, progress, move |control| {
        let result = identify_job(&job, &mut |done| control.report(share + (1.0 - share) * done));
        (result, job.split)
    })?;
    let result = result.map_err(value)?;
    warn(py, &result.warnings)?;
    Ok(Identification { result: Arc::new(result), split: Arc::new(split), notes, sources, seed })
}
