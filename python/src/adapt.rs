//! Online adaptation, sample by sample.

use std::sync::Arc;

use hydroid::adapt::{self, BAND_80, BAND_95, Options, ResolvedOptions};
use hydroid::config::Adapt;
use hydroid::fingerprint::Fingerprint;
use hydroid::model;
use hydroid_core::adapt::{Adapter as Learns, Outcome, Rejection};
use hydroid_core::memory::Memory;
use hydroid_core::predict::Workspace;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::{row, shaped, table};
use crate::error::{expected, internal, unfit, value};
use crate::log::{reading, runs};
use crate::model::Model;
use crate::{settings, work};

/// First bytes of a saved state.
const MAGIC: &[u8; 8] = b"hydroid1";

#[pyclass(module = "hydroid")]
pub(crate) struct Adapter {
    model: Arc<model::Model>,
    options: Options,
    used: ResolvedOptions,
    learner: Box<dyn Learns>,
    work: Workspace,
    estimate: Vec<f64>,
}

/// The argument `guard`.
pub(crate) enum Guarding {
    Default,
    None,
    /// Options over the defaults.
    Options(toml::Value),
}

impl Guarding {
    pub(crate) fn of(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(wanted) = given.extract::<bool>() {
            return Ok(if wanted { Self::Default } else { Self::None });
        }
        let py = given.py();
        if !given.is_instance(&py.import("hydroid")?.getattr("Guard")?)? {
            return Err(expected("guard", "True, False or a Guard", given.get_type().name()?));
        }
        let fields = py.import("dataclasses")?.call_method1("asdict", (given,))?;
        settings::table(fields.cast::<PyDict>()?).map(Self::Options)
    }
}

/// Options with those of a guard.
pub(crate) fn with_guard(options: Options, guarding: &Guarding) -> PyResult<Options> {
    let Guarding::Options(given) = guarding else { return Ok(options) };
    merged(&options, toml::Table::from_iter([("guard".to_owned(), given.clone())]).into())
}

/// Options of the adaptation of a model.
fn options(
    model: &model::Model,
    guarding: &Guarding,
    given: Option<&Bound<'_, PyDict>>,
) -> PyResult<Options> {
    let mut asked: Adapt = given.map(settings::of).transpose()?.unwrap_or_default();
    asked.no_guard |= matches!(guarding, Guarding::None);
    with_guard(asked.options(model).map_err(value)?, guarding)
}

fn merged(options: &Options, given: toml::Value) -> PyResult<Options> {
    // TOML has infinite numbers, and leaves out what is not set.
    let mut all = toml::Value::try_from(options).map_err(internal)?;
    settings::merge(&mut all, given);
    settings::read(all)
}

impl Adapter {
    /// A fingerprint of model and options, without which a state means nothing.
    fn fingerprint(&self) -> PyResult<[u8; 8]> {
        let mut fingerprint = Fingerprint::new();
        fingerprint.bytes(&model::encode(&self.model).map_err(value)?);
        fingerprint.text(&toml::to_string(&self.options).map_err(internal)?);
        Ok(fingerprint.value().to_le_bytes())
    }
}

#[pymethods]
impl Adapter {
    #[new]
    #[pyo3(signature = (model, *, guard=None, noise_logs=None, **options))]
    fn new(
        py: Python<'_>,
        model: PyRef<'_, Model>,
        guard: Option<&Bound<'_, PyAny>>,
        noise_logs: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let model = Arc::clone(&model.model);
        let guarding = guard.map_or(Ok(Guarding::Default), Guarding::of)?;
        let options = self::options(&model, &guarding, options)?;
        let given = match noise_logs {
            Some(logs) => runs(py, "noise_logs", logs, &reading(Some(&model), None)?)?,
            None => Vec::new(),
        };
        let (of, with) = (Arc::clone(&model), options.clone());
        let made = work::run(py, None, None, move |_| {
            adapt::adapter(&of, &with, &given.iter().collect::<Vec<_>>()).map_err(|error| error.to_string())
        })?;
        let (learner, used) = made.map_err(value)?;
        let estimate = vec![f64::NAN; model.description.outputs.len()];
        Ok(Self { model, options, used, learner, work: Workspace::new(), estimate })
    }

    /// Advances under the command since the last sample, and learns from the measurement now.
    #[pyo3(signature = (command, output, heading=None))]
    fn step(
        &mut self,
        command: Option<&Bound<'_, PyAny>>,
        output: &Bound<'_, PyAny>,
        heading: Option<f64>,
    ) -> PyResult<Step> {
        if let Some(command) = command {
            let inputs = self.learner.inputs();
            row("command", command, inputs, |c| self.learner.advance(c))?;
        }
        if let Some(heading) = heading {
            self.learner.observe_heading(heading);
        }
        let outputs = self.learner.outputs();
        row("output", output, outputs, |y| self.learner.observe(y))?;
        self.learner.output(&mut self.estimate);
        Ok(Step {
            outcome: self.learner.outcome(),
            estimate: self.estimate.clone(),
            innovations: self.learner.innovations().iter().map(|i| [i.value, i.deviation]).collect(),
            predicted_by: self.learner.guard().map(|guard| guard.active().name()),
        })
    }

    /// Predictions under commands from the present on, with the deviations of the measurements around them.
    fn predict(
        &mut self,
        py: Python<'_>,
        commands: &Bound<'_, PyAny>,
        horizons: Vec<usize>,
    ) -> PyResult<Prediction> {
        let Self { learner, work, .. } = self;
        let (q, last) = (learner.outputs(), horizons.last().copied().unwrap_or(0));
        if horizons.is_empty() || horizons[0] == 0 || !horizons.is_sorted_by(|a, b| a < b) {
            return Err(unfit("horizons", "samples from 1 on, ascending", format!("{horizons:?}")));
        }
        let (c, [steps, inputs]) =
            shaped("commands", commands, [None, Some(learner.inputs())], "samples, inputs")?;
        if steps < last {
            return Err(unfit("commands", format!("a row for each of {last} samples"), steps));
        }
        let c = &c.as_slice()?[..last * inputs];
        let (mut y, mut deviations) = (vec![0.0; last * q], vec![0.0; horizons.len() * q]);
        py.detach(|| {
            learner.rollout(c, work, &mut y);
            learner.deviations(c, &horizons, work, &mut deviations);
        });
        let outputs = horizons.iter().flat_map(|h| y[(h - 1) * q..h * q].iter().copied()).collect();
        Ok(Prediction { horizons, outputs, deviations })
    }

    /// Starts a run; what was learned stays.
    fn reset(&mut self) {
        self.learner.reset();
    }

    /// Stops or resumes learning.
    fn freeze(&mut self, frozen: bool) {
        self.learner.freeze(frozen);
    }

    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.learner.weights())
    }

    /// The model with the learned weights.
    #[pyo3(signature = (runs=Vec::new()))]
    fn model(&self, runs: Vec<String>) -> PyResult<Model> {
        let names: Vec<&str> = runs.iter().map(String::as_str).collect();
        adapt::learned(&self.model, &self.options, self.learner.weights(), &names, &self.used)
            .map(Model::of)
            .map_err(value)
    }

    #[getter]
    fn state<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let numbers = Memory::saved(|memory| self.learner.visit_state(memory));
        let mut bytes = MAGIC.to_vec();
        bytes.extend(self.fingerprint()?);
        bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        Ok(PyBytes::new(py, &bytes))
    }

    #[setter]
    fn set_state(&mut self, state: &[u8]) -> PyResult<()> {
        let wrong =
            |found: &str| unfit("state", "the state of an adapter of the same model and options", found);
        let rest = state.strip_prefix(MAGIC).ok_or_else(|| wrong("other bytes"))?;
        let rest = rest
            .strip_prefix(&self.fingerprint()?)
            .ok_or_else(|| wrong("that of another model or of other options"))?;
        let (numbers, left) = rest.as_chunks::<8>();
        let numbers: Vec<f64> = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        if numbers.len() != self.learner.memory_len() || !left.is_empty() {
            return Err(wrong("a damaged one"));
        }
        let before = Memory::saved(|memory| self.learner.visit_state(memory));
        self.learner.load(&numbers);
        if !self.learner.is_sound() {
            self.learner.load(&before);
            return Err(wrong("numbers that no adapter has"));
        }
        Ok(())
    }

    fn __repr__(&self) -> String {
        format!("Adapter of {}", self.model.description.name)
    }
}

/// Predicted outputs at horizons.
#[pyclass(frozen, module = "hydroid")]
pub(crate) struct Prediction {
    horizons: Vec<usize>,
    /// `horizons x outputs`, as the deviations.
    outputs: Vec<f64>,
    deviations: Vec<f64>,
}

#[pymethods]
impl Prediction {
    #[getter]
    fn horizons(&self) -> Vec<usize> {
        self.horizons.clone()
    }

    #[getter]
    fn outputs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.table(py, self.outputs.clone())
    }

    #[getter]
    fn std<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.table(py, self.deviations.clone())
    }

    /// Lower and upper ends of the band that contains the measurement with a probability of 80 or 95 %.
    #[pyo3(signature = (level=0.8))]
    fn band<'py>(
        &self,
        py: Python<'py>,
        level: f64,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
        let half = match level {
            0.8 => BAND_80,
            0.95 => BAND_95,
            other => return Err(unfit("level", "0.8 or 0.95", other)),
        };
        let end = |sign: f64| {
            let pairs = self.outputs.iter().zip(&self.deviations);
            self.table(py, pairs.map(|(y, deviation)| y + sign * half * deviation).collect())
        };
        Ok((end(-1.0)?, end(1.0)?))
    }

    fn __repr__(&self) -> String {
        format!("Prediction at {:?} samples", self.horizons)
    }
}

impl Prediction {
    fn table<'py>(&self, py: Python<'py>, values: Vec<f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        table(py, values, self.outputs.len() / self.horizons.len())
    }
}

/// What a sample did.
#[pyclass(frozen, module = "hydroid")]
pub(crate) struct Step {
    outcome: Outcome,
    estimate: Vec<f64>,
    innovations: Vec<[f64; 2]>,
    predicted_by: Option<&'static str>,
}

#[pymethods]
impl Step {
    #[getter]
    fn status(&self) -> &'static str {
        match self.outcome {
            Outcome::Waiting => "waiting",
            Outcome::Accepted => "accepted",
            Outcome::Inflated { .. } => "inflated",
            Outcome::Rejected(_) => "rejected",
            Outcome::RolledBack => "rolled_back",
        }
    }

    /// Why the sample had less than full weight.
    #[getter]
    fn reason(&self) -> Option<String> {
        match self.outcome {
            Outcome::Inflated { deviations, weight } => {
                Some(format!("innovation of {deviations:.1} standard deviations, weight {weight:.2}"))
            }
            Outcome::Rejected(Rejection::Outlier { deviations }) => {
                Some(format!("innovation of {deviations:.1} standard deviations"))
            }
            Outcome::Rejected(Rejection::NotFinite) => Some("a value is not finite".to_owned()),
            _ => None,
        }
    }

    #[getter]
    fn estimate<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.estimate)
    }

    #[getter]
    fn innovation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.innovations.iter().map(|i| i[0]))
    }

    #[getter]
    fn innovation_std<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.innovations.iter().map(|i| i[1]))
    }

    #[getter]
    fn predicted_by(&self) -> Option<&'static str> {
        self.predicted_by
    }

    fn __repr__(&self) -> String {
        format!("Step({}, estimate {:?})", self.status(), self.estimate)
    }
}
