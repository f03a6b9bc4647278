//! Simulated closed loops.

use std::path::PathBuf;
use std::sync::Arc;

use hydroid::closed_loop::{ControlMethod, TunedAutopilot};
use hydroid::config::control::{ClosedLoopOptions, NamedModel, Setup, SetupError, Simulated};
use hydroid::log::Note;
use hydroid_report::ClosedLoopReport;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::adapt::{Guarding, with_guard};
use crate::arrays::table;
use crate::error::{chain, expected, internal, value};
use crate::log::{Run, items, runs, warn};
use crate::model::{Model, of_model};
use crate::{settings, work};

/// Result of a simulation. The Python class around it has the documented interface.
#[pyclass(frozen, module = "hydroid._hydroid")]
pub(crate) struct ClosedLoop {
    setup: Setup,
    tuned: Option<TunedAutopilot>,
    simulated: Simulated,
}

#[pymethods]
impl ClosedLoop {
    /// The document of `hydroid control --json`.
    fn document<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        settings::document(py, &self.setup.document(&self.simulated, self.tuned.as_ref()))
    }

    /// The text of `control.json`.
    fn json(&self) -> PyResult<String> {
        let document = self.setup.document(&self.simulated, self.tuned.as_ref());
        Ok(serde_json::to_string_pretty(&document).map_err(internal)? + "\n")
    }

    /// Metrics of the run.
    fn metrics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        settings::document(py, &self.simulated.metrics)
    }

    fn held(&self) -> bool {
        self.simulated.is_sound()
    }

    /// The content of `track.csv`.
    fn csv(&self) -> PyResult<String> {
        let mut bytes = Vec::new();
        self.simulated.run.write_csv(&mut bytes).map_err(internal)?;
        String::from_utf8(bytes).map_err(internal)
    }

    fn report(&self, py: Python<'_>, command: &str) -> PyResult<String> {
        let Self { setup, tuned, simulated } = self;
        let page = py.detach(|| {
            hydroid_report::closed_loop(&ClosedLoopReport {
                title: &setup.title(),
                command,
                facts: &setup.facts(simulated),
                path: &setup.scenario.track.path,
                run: &simulated.run,
                metrics: &simulated.metrics,
                trials: simulated.trials.as_ref(),
                outside: &simulated.outside,
                tuned: tuned.as_ref(),
            })
            .map_err(|error| error.to_string())
        });
        page.map_err(internal)
    }

    fn run(&self) -> Run {
        Run::of(self.simulated.run.trajectory())
    }

    /// Arrays of the track by name.
    fn track<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let run = &self.simulated.run;
        let samples = &run.samples;
        let arrays = PyDict::new(py);
        let of = |number: fn(&hydroid::closed_loop::Sample) -> f64| {
            PyArray1::from_iter(py, samples.iter().map(number))
        };
        arrays.set_item("t", of(|sample| sample.t))?;
        arrays.set_item("pose", table(py, samples.iter().flat_map(|s| s.eta).collect(), 3)?)?;
        arrays.set_item("velocities", table(py, samples.iter().flat_map(|s| s.nu).collect(), 3)?)?;
        let measured = (0..samples.len()).flat_map(|k| run.measured(k).iter().copied()).collect();
        arrays.set_item("outputs", table(py, measured, run.measured_outputs)?)?;
        arrays.set_item("commands", table(py, run.commands.clone(), run.inputs.len())?)?;
        let reference = samples.iter().flat_map(|s| {
            let [x, y] = s.reference.position;
            [x, y, s.reference.course]
        });
        arrays.set_item("reference", table(py, reference.collect(), 3)?)?;
        arrays.set_item("reference_speed", of(|sample| sample.reference.speed))?;
        arrays.set_item("distance", of(|sample| sample.distance))?;
        arrays.set_item("cross_track", of(|sample| sample.cross_track))?;
        arrays.set_item("speed_error", of(|sample| sample.speed_error))?;
        arrays.set_item("status", samples.iter().map(|s| s.status.name()).collect::<Vec<_>>())?;
        arrays.set_item("output_names", names(&run.outputs[..run.measured_outputs]))?;
        arrays.set_item("input_names", names(&run.inputs))?;
        Ok(arrays)
    }
}

fn names(channels: &[hydroid::log::Channel]) -> Vec<&str> {
    channels.iter().map(|channel| channel.name.as_str()).collect()
}

/// A model, or the file of a model or vessel.
pub(crate) fn named(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<NamedModel> {
    if let Ok(model) = given.cast::<Model>() {
        let model = &*model.get().model;
        return Ok(NamedModel { name: model.description.name.clone(), model: model.clone() });
    }
    let Ok(path) = given.extract::<PathBuf>() else {
        return Err(expected(argument, "a Model or a path", given.get_type().name()?));
    };
    let model = hydroid::model::read(&path).map_err(of_model)?;
    Ok(NamedModel { name: path.display().to_string(), model })
}

/// Runs of training logs, those of each log together.
pub(crate) fn training(
    py: Python<'_>,
    model: &hydroid::model::Model,
    given: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<Vec<hydroid::log::Trajectory>>> {
    let Some(given) = given else { return Ok(Vec::new()) };
    let mut all = Vec::new();
    for log in items(given)? {
        let runs = runs(py, "training_log", &log, &model.description.reading)?;
        model.check(&runs).map_err(value)?;
        all.push(runs);
    }
    Ok(all)
}

/// The beginning of each training log.
pub(crate) fn beginnings(
    logs: &[Vec<hydroid::log::Trajectory>],
    seconds: f64,
) -> Vec<hydroid::log::Trajectory> {
    logs.iter().flat_map(|runs| hydroid::log::beginning(runs, seconds)).collect()
}

/// Options of the loop, and those of its guard.
pub(crate) fn options(
    given: &Bound<'_, PyDict>,
    guard: &Bound<'_, PyAny>,
    training_log: Option<&Bound<'_, PyAny>>,
) -> PyResult<(ClosedLoopOptions, Guarding)> {
    let mut options: ClosedLoopOptions = settings::of(given)?;
    let guarding = Guarding::of(guard)?;
    for (name, is_given) in
        [("guard", !matches!(guarding, Guarding::Default)), ("training_log", training_log.is_some())]
    {
        if is_given && !options.adapt {
            let message = format!("{name} is an option of the adaptation: add adapt=True, or leave it out");
            return Err(value(message));
        }
    }
    options.no_guard = matches!(guarding, Guarding::None);
    Ok((options, guarding))
}

/// The setup, made without the interpreter's lock.
pub(crate) fn setup(
    py: Python<'_>,
    options: ClosedLoopOptions,
    guarding: &Guarding,
    model: Option<NamedModel>,
    plant: Option<NamedModel>,
) -> PyResult<Setup> {
    let mut setup = work::run(py, None, None, move |_| Setup::new(options, model, plant))?
        .map_err(|error| chain(&error))?;
    let notes: Vec<Note> = setup.notes().into_iter().map(Note::warning).collect();
    warn(py, &notes)?;
    if let Some(adapt) = setup.controller.adapt.take() {
        setup.controller.adapt = Some(with_guard(adapt, guarding)?);
    }
    Ok(setup)
}

/// Simulates a closed loop. `options` are those of [`ClosedLoopOptions`].
#[pyfunction]
#[pyo3(signature = (plant, model, options, guard, training_log=None, training_time=200.0, threads=None, progress=None))]
pub(crate) fn control(
    py: Python<'_>,
    plant: &Bound<'_, PyAny>,
    model: Option<&Bound<'_, PyAny>>,
    options: &Bound<'_, PyDict>,
    guard: &Bound<'_, PyAny>,
    training_log: Option<&Bound<'_, PyAny>>,
    training_time: f64,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<ClosedLoop> {
    let (options, guarding) = self::options(options, guard, training_log)?;
    options.check_simulated().map_err(|error| chain(&error))?;
    let plant = named("plant", plant)?;
    let (model, plant) = match model {
        Some(model) => (named("model", model)?, Some(plant)),
        None => (plant, None),
    };
    let mut setup = setup(py, options, &guarding, Some(model), plant)?;
    let training = training(py, &setup.model, training_log)?;
    setup.controller.rehearsal = Arc::from(beginnings(&training, training_time));
    let simulated = work::run(py, threads, progress, move |control| -> Result<ClosedLoop, SetupError> {
        // Tuning, trials and the run have equal shares of the progress.
        let before = [setup.options.controller == ControlMethod::Autopilot, setup.options.runs() != 1];
        let [tuning, trials] = before.map(|has| f64::from(u8::from(has)));
        let parts = tuning + trials + 1.0;
        let report = |part: f64| move |done: f64| control.report((part + done) / parts);
        let tuned = setup.tune(&mut report(0.0))?;
        let mut controller = setup.controller.controller(setup.conditions.seed)?;
        let all = setup.trials(&mut report(tuning))?;
        let simulated = setup.simulate(controller.as_mut(), all, &mut report(tuning + trials))?;
        Ok(ClosedLoop { setup, tuned, simulated })
    })?;
    let simulated = simulated.map_err(|error| chain(&error))?;
    let beyond: Vec<Note> = simulated.simulated.extrapolations().map(Note::warning).collect();
    warn(py, &beyond)?;
    Ok(simulated)
}
