//! Vessels, simulated logs and manoeuvring trials.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use hydroid::atomic::{self, Lock};
use hydroid::config::{self, Drive, Plan, Plant, SettingError};
use hydroid::craft::BUILT_IN;
use hydroid::log::Note;
use hydroid::manoeuvre::{self, Comparison, Figure, ManoeuvreError, Track};
use hydroid::model as library;
use hydroid::plant::{InputMap, member_tracks};
use hydroid_report::{ComparisonReport, FolderError, ManoeuvreReport};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use serde::Serialize;
use serde_json::{Value, json};

use crate::arrays::table;
use crate::error::{expected, internal, os, unfit, value};
use crate::log::{Log, of_log, reading, runs, table_of, warn};
use crate::model::{Model, of_model};
use crate::{settings, work};

fn of_setting(error: SettingError) -> PyErr {
    match error {
        SettingError::Log(error) => of_log(error),
        SettingError::Model(error) => of_model(error),
        SettingError::UnknownPlant { name } => {
            let known = BUILT_IN.join(", ");
            let known = format!("{known}, a vessel file (.toml), a model file (.safetensors) or a Model");
            unfit("plant", known, format!("'{name}'"))
        }
        error => value(error),
    }
}

/// A model, or the name or path of one.
enum Given {
    Model(Arc<library::Model>),
    Name(String),
}

impl Given {
    fn new(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(model) = given.cast::<Model>() {
            return Ok(Self::Model(Arc::clone(&model.get().model)));
        }
        if let Ok(path) = given.extract::<PathBuf>() {
            return Ok(Self::Name(path.display().to_string()));
        }
        let wanted = "a Model, the name of a built-in vessel or the path of a file";
        Err(expected(argument, wanted, given.get_type().name()?))
    }

    fn plant(self) -> Result<Plant, SettingError> {
        match self {
            Self::Model(model) => Ok(Plant::of(library::Model::clone(&model))),
            Self::Name(name) => Plant::read(&name),
        }
    }

    /// The model, with its name as given.
    fn model(self) -> PyResult<(Arc<library::Model>, String)> {
        match self {
            Self::Model(model) => {
                let name = model.description.name.clone();
                Ok((model, name))
            }
            Self::Name(name) => Ok((Arc::new(library::read(Path::new(&name)).map_err(of_model)?), name)),
        }
    }
}

/// Names of the built-in vessels.
#[pyfunction]
pub(crate) fn vessels() -> Vec<&'static str> {
    BUILT_IN.to_vec()
}

/// The text of the file of a vessel.
#[pyfunction]
pub(crate) fn vessel_toml(vessel: &Bound<'_, PyAny>) -> PyResult<String> {
    let plant = Given::new("vessel", vessel)?.plant().map_err(of_setting)?;
    plant
        .vessel_text()
        .map_err(|_| unfit("vessel", "a vessel", format!("the identified model '{}'", plant.name)))
}

/// A simulated log. `options` are those of [`config::Simulate`].
#[pyfunction]
#[pyo3(signature = (plant, excitation, options, name=None, figure=None, progress=None))]
pub(crate) fn simulate(
    py: Python<'_>,
    plant: &Bound<'_, PyAny>,
    excitation: &Bound<'_, PyAny>,
    options: &Bound<'_, PyDict>,
    name: Option<String>,
    figure: Option<PathBuf>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Log> {
    let settings: config::Simulate = settings::of(options)?;
    let plant = Given::new("plant", plant)?.plant().map_err(of_setting)?;
    let named = excitation.cast::<PyString>().ok().map(ToString::to_string);
    let drive = match named.filter(|text| Path::new(text).extension().is_none()) {
        Some(kind) => Drive::Kind(kind),
        None => Drive::Log(table_of("excitation", excitation)?),
    };
    if figure.is_some() && matches!(plant.kind, config::PlantKind::Vessel(_)) {
        return Err(unfit("figure", "an identified model", format!("the vessel '{}'", plant.name)));
    }
    let done = work::run(py, None, progress, move |control| -> Result<_, SettingError> {
        let progress = &mut |fraction| control.report(fraction);
        let log_name = |default: String| name.unwrap_or_else(|| format!("{default}-seed{}", settings.seed));
        Ok(match settings.plan(&plant, &drive)? {
            Plan::Vessel { options, label } => {
                let simulated = hydroid::simulate::simulate(&options, progress)?;
                let name = log_name(format!("{}-{label}", options.vessel.name));
                (simulated.to_log(&name), Vec::new(), None)
            }
            Plan::Model(plan) => {
                let record = plan.run(progress)?;
                let drawn = match figure {
                    Some(path) => {
                        let members = member_tracks(&plan.model, &plan.options(), &record.commands)?;
                        let measured = plan.measured();
                        let measured = measured.as_ref().map(|track| track.eta.as_slice());
                        Some((path, hydroid_report::simulated_track(&record.eta, &members, measured)))
                    }
                    None => None,
                };
                let name = log_name(format!("{}-simulated", plan.model.description.name));
                (record.to_log(&name), plan.notes, drawn)
            }
        })
    })?;
    let (log, notes, drawn) = done.map_err(of_setting)?;
    if let Some((path, figure)) = drawn {
        let figure = figure.map_err(internal)?;
        atomic::write(&path, |out| out.write_all(figure.as_bytes())).map_err(os)?;
    }
    warn(py, &notes)?;
    Ok(Log::of(log))
}

/// Time since the order, north, east, heading, velocities over ground, commands.
type Arrays<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Option<Bound<'py, PyArray2<f64>>>,
);

fn arrays<'py>(py: Python<'py>, track: &Track, map: Option<&InputMap>) -> PyResult<Arrays<'py>> {
    let pose = |i: usize| PyArray1::from_iter(py, track.eta.iter().map(move |eta| eta[i]));
    let commands = map.map(|map| {
        let mut rows = vec![0.0; track.len() * map.names.len()];
        for (row, steering) in rows.chunks_exact_mut(map.names.len()).zip(&track.steering) {
            map.write_command(track.propulsion, *steering, row);
        }
        table(py, rows, map.names.len())
    });
    Ok((
        PyArray1::from_iter(py, (0..track.len()).map(|k| track.time_s(k))),
        pose(0),
        pose(1),
        pose(2),
        table(py, track.nu.concat(), 3)?,
        commands.transpose()?,
    ))
}

/// Writes a folder that no other run writes.
fn save(
    py: Python<'_>,
    folder: PathBuf,
    write: impl FnOnce(&Path) -> Result<(), FolderError> + Send + 'static,
) -> PyResult<()> {
    let written = work::run(py, None, None, move |_| {
        atomic::probe(&folder)?;
        let _lock = Lock::new(&folder)?;
        write(&folder)
    })?;
    written.map_err(|error| match error {
        FolderError::Write(error) => os(error),
        error @ FolderError::Report(_) => internal(error),
    })
}

fn of_manoeuvre(error: ManoeuvreError) -> PyErr {
    of_setting(error.into())
}

/// Manoeuvring trials. The Python class around it has the documented interface.
#[pyclass(frozen, module = "hydroid._hydroid")]
pub(crate) struct Trials {
    trials: Arc<manoeuvre::Trials>,
    model: Arc<library::Model>,
    document: Arc<Value>,
}

/// A figure of a trial.
#[derive(Serialize)]
struct TrialFigure<'a> {
    trial: usize,
    title: String,
    figure: &'a str,
    unit: &'static str,
    value: Option<f64>,
    low: Option<f64>,
    high: Option<f64>,
    extrapolated: bool,
    not_valid: Option<&'a str>,
    limit: Option<f64>,
    passed: Option<bool>,
    certain: Option<bool>,
}

fn ends(figure: &Figure) -> (Option<f64>, Option<f64>) {
    (figure.interval.map(|[low, _]| low), figure.interval.map(|[_, high]| high))
}

#[pymethods]
impl Trials {
    fn document<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        settings::document(py, &*self.document)
    }

    /// Names and units of the inputs.
    fn inputs(&self) -> (Vec<String>, Vec<String>) {
        (self.trials.inputs.names.clone(), self.trials.inputs.units.clone())
    }

    fn passed(&self) -> bool {
        self.trials.passed()
    }

    /// One record for each figure of each trial.
    fn figures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut records = Vec::new();
        for (number, trial) in self.trials.trials.iter().enumerate() {
            for figure in &trial.figures {
                let (low, high) = ends(figure);
                records.push(TrialFigure {
                    trial: number,
                    title: trial.kind.title(&self.trials.inputs),
                    figure: &figure.name,
                    unit: figure.name_and_unit().1,
                    value: figure.value,
                    low,
                    high,
                    extrapolated: figure.extrapolated,
                    not_valid: figure.not_valid.as_deref(),
                    limit: figure.criterion.map(|criterion| criterion.limit),
                    passed: figure.criterion.map(|criterion| criterion.passed),
                    certain: figure.criterion.and_then(|criterion| criterion.is_certain),
                });
            }
        }
        settings::document(py, &records)
    }

    /// Number and title of the trial and arrays of each track, as in `tracks.csv`.
    fn tracks<'py>(&self, py: Python<'py>) -> PyResult<Vec<(usize, String, Arrays<'py>)>> {
        let inputs = &self.trials.inputs;
        let mut tracks = Vec::new();
        for (number, trial) in self.trials.trials.iter().enumerate() {
            for track in &trial.tracks {
                tracks.push((number, trial.kind.title(inputs), arrays(py, track, Some(inputs))?));
            }
        }
        Ok(tracks)
    }

    fn report(&self, py: Python<'_>, command: String) -> PyResult<String> {
        let (model, trials) = (Arc::clone(&self.model), Arc::clone(&self.trials));
        let page = work::run(py, None, None, move |_| {
            let report = ManoeuvreReport { command: &command, model: &model, trials: &trials };
            hydroid_report::manoeuvres(&report)
        })?;
        page.map_err(internal)
    }

    fn save(&self, py: Python<'_>, folder: PathBuf, command: String) -> PyResult<()> {
        let (model, trials) = (Arc::clone(&self.model), Arc::clone(&self.trials));
        let document = Arc::clone(&self.document);
        save(py, folder, move |folder| {
            let report = ManoeuvreReport { command: &command, model: &model, trials: &trials };
            report.write(folder, &document)
        })
    }
}

/// Runs manoeuvring trials. `options` are those of [`config::Manoeuvre`].
#[pyfunction]
#[pyo3(signature = (model, options, threads=None, progress=None))]
pub(crate) fn manoeuvres(
    py: Python<'_>,
    model: &Bound<'_, PyAny>,
    options: &Bound<'_, PyDict>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Trials> {
    let settings: config::Manoeuvre = settings::of(options)?;
    let (model, name) = Given::new("model", model)?.model()?;
    let of = Arc::clone(&model);
    let trials = work::run(py, threads, progress, move |control| -> Result<_, SettingError> {
        Ok(settings.plan(&of)?.run(&of, &mut |fraction| control.report(fraction))?)
    })?
    .map_err(of_setting)?;
    // After an interrupt nobody waits for the trials.
    let trials = trials.ok_or_else(|| internal("the trials were cancelled"))?;
    let outside = trials.trials.iter().flat_map(|trial| {
        let title = trial.kind.title(&trials.inputs);
        let not_valid = trial.not_valid.iter().map(|reason| format!("not valid {reason}"));
        let outside = trial.outside.iter().map(ToString::to_string);
        not_valid.chain(outside).map(move |text| format!("{title}: {text}"))
    });
    let notes: Vec<Note> = trials.notes.iter().cloned().chain(outside).map(Note::warning).collect();
    warn(py, &notes)?;
    let document = Arc::new(trials.document(&name, &model));
    Ok(Trials { trials: Arc::new(trials), model, document })
}

/// Trials in logs beside their predictions. The Python class around it has the documented interface.
#[pyclass(frozen, module = "hydroid._hydroid")]
pub(crate) struct Comparisons {
    comparisons: Arc<Vec<Comparison>>,
    model: Arc<library::Model>,
    document: Arc<Value>,
}

/// A figure of a trial in a log, and its prediction.
#[derive(Serialize)]
struct ComparedFigure<'a> {
    trial: usize,
    run: &'a str,
    at_s: f64,
    title: String,
    in_training: bool,
    figure: &'a str,
    unit: &'static str,
    measured: Option<f64>,
    predicted: Option<f64>,
    not_valid: Option<&'a str>,
    low: Option<f64>,
    high: Option<f64>,
    measured_low: Option<f64>,
    measured_high: Option<f64>,
    error: Option<f64>,
    uncertainty: Option<f64>,
}

#[pymethods]
impl Comparisons {
    fn document<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        settings::document(py, &*self.document)
    }

    /// One record for each figure of each trial.
    fn figures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut records = Vec::new();
        for (number, comparison) in self.comparisons.iter().enumerate() {
            for (measured, predicted) in comparison.measured.iter().zip(&comparison.predicted) {
                let ((low, high), (measured_low, measured_high)) = (ends(predicted), ends(measured));
                let error = comparison.errors.iter().find(|error| error.name == measured.name);
                records.push(ComparedFigure {
                    trial: number,
                    run: &comparison.run,
                    at_s: comparison.at_s,
                    title: comparison.trial.title(),
                    in_training: comparison.in_training,
                    figure: &measured.name,
                    unit: measured.name_and_unit().1,
                    measured: measured.value,
                    predicted: predicted.value,
                    not_valid: predicted.not_valid.as_deref(),
                    low,
                    high,
                    measured_low,
                    measured_high,
                    error: error.map(|error| error.error),
                    uncertainty: error.and_then(|error| error.uncertainty),
                });
            }
        }
        settings::document(py, &records)
    }

    /// Number and title of the trial, and arrays of the measured and of the predicted track.
    fn tracks<'py>(&self, py: Python<'py>) -> PyResult<Vec<(usize, String, Arrays<'py>, Arrays<'py>)>> {
        let comparisons = self.comparisons.iter().enumerate();
        let tracks = comparisons.map(|(number, comparison)| {
            let [measured, predicted] = &comparison.tracks;
            let title = comparison.trial.title();
            Ok((number, title, arrays(py, measured, None)?, arrays(py, predicted, None)?))
        });
        tracks.collect()
    }

    fn report(&self, py: Python<'_>, command: String) -> PyResult<String> {
        let (model, comparisons) = (Arc::clone(&self.model), Arc::clone(&self.comparisons));
        let page = work::run(py, None, None, move |_| {
            let report = ComparisonReport { command: &command, model: &model, comparisons: &comparisons };
            hydroid_report::comparisons(&report)
        })?;
        page.map_err(internal)
    }

    fn save(&self, py: Python<'_>, folder: PathBuf, command: String) -> PyResult<()> {
        let (model, comparisons) = (Arc::clone(&self.model), Arc::clone(&self.comparisons));
        let document = Arc::clone(&self.document);
        save(py, folder, move |folder| {
            let report = ComparisonReport { command: &command, model: &model, comparisons: &comparisons };
            report.write(folder, &document)
        })
    }
}

/// Trials of logs beside their predictions by a model.
#[pyfunction]
#[pyo3(signature = (model, logs, options=None, threads=None, progress=None))]
pub(crate) fn compare_manoeuvres(
    py: Python<'_>,
    model: &Bound<'_, PyAny>,
    logs: &Bound<'_, PyAny>,
    options: Option<&Bound<'_, PyDict>>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Comparisons> {
    let (model, name) = Given::new("model", model)?.model()?;
    let runs = runs(py, "logs", logs, &reading(Some(&model), options)?)?;
    let model = library::Model::clone(&model).for_runs(&runs).map_err(value)?;
    let model = Arc::new(model);
    let of = Arc::clone(&model);
    let comparisons = work::run(py, threads, progress, move |control| {
        manoeuvre::compare(&of, &runs, &mut |fraction| control.report(fraction))
    })?
    .map_err(of_manoeuvre)?;
    let mut document = json!({ "plant": name, "comparisons": comparisons });
    if let Some(scale) = model.description.boat.particulars.scale.filter(|scale| *scale != 1.0) {
        document["scale"] = json!(scale);
    }
    let document = Arc::new(document);
    Ok(Comparisons { comparisons: Arc::new(comparisons), model, document })
}
