//! The judge: errors of models and of other predictors, from the same origins.

use std::sync::{Arc, Mutex};

use hydroid::config::Horizon;
use hydroid::evaluate as judge;
use hydroid::evaluate::{DesignRange, EvaluateError, Evaluation, Options};
use hydroid::log::Trajectory;
use hydroid_core::predict::{Predictor, Workspace, plain};
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};

use crate::arrays::{rows_of, shaped};
use crate::error::{unfit, value};
use crate::log::{reading, runs};
use crate::model::Model;
use crate::{settings, work};

/// A horizon in samples (an integer) or in seconds (`"10s"`, or a float).
pub(crate) fn horizon(given: &Bound<'_, PyAny>) -> PyResult<Horizon> {
    let horizon = if let Ok(samples) = given.extract::<usize>() {
        Horizon::Samples(samples)
    } else if let Ok(text) = given.extract::<String>() {
        text.parse().map_err(value)?
    } else {
        return Err(crate::error::expected(
            "horizon",
            "samples (100) or seconds ('10s')",
            given.get_type().name()?,
        ));
    };
    Ok(horizon)
}

/// A run as arrays.
struct History {
    outputs: Py<PyArray2<f64>>,
    inputs: Py<PyArray2<f64>>,
}

/// A Python function as a predictor: `f(outputs, inputs, commands)` with all measurements up to the origin, the commands
/// before it, and the commands from it on, returns the predicted outputs.
#[derive(Clone)]
struct Function {
    call: Arc<Py<PyAny>>,
    histories: Arc<[History]>,
    /// The first exception.
    error: Arc<Mutex<Option<PyErr>>>,
    widths: [usize; 2],
    warm_up: usize,
    /// Number of the run from 1, and observed samples.
    run: usize,
    samples: usize,
}

impl Function {
    fn predict(&self, py: Python<'_>, commands: &[f64], y: &mut [f64]) -> PyResult<()> {
        let [q, m] = self.widths;
        let history = &self.histories[self.run - 1];
        let first = |array: &Py<PyArray2<f64>>, rows: usize| {
            #[allow(clippy::cast_possible_wrap, reason = "the length of an array")]
            array.bind(py).as_any().get_item(PySlice::new(py, 0, rows as isize, 1))
        };
        let past = (first(&history.outputs, self.samples)?, first(&history.inputs, self.samples - 1)?);
        let steps = commands.len().checked_div(m).unwrap_or(y.len() / q);
        let commands = rows_of(py, commands.to_vec(), steps, m)?;
        let predicted = self.call.bind(py).call1((past.0, past.1, commands))?;
        let (predicted, _) =
            shaped("the result of the function", &predicted, [Some(steps), Some(q)], "samples, outputs")?;
        y.copy_from_slice(predicted.as_slice()?);
        Ok(())
    }
}

impl Predictor for Function {
    plain!(over_ground advance_observe rollout_batch rollout_snapshots);

    fn outputs(&self) -> usize {
        self.widths[0]
    }

    fn inputs(&self) -> usize {
        self.widths[1]
    }

    fn warm_up(&self) -> usize {
        self.warm_up
    }

    fn reset(&mut self) {
        self.run += 1;
        self.samples = 0;
    }

    fn observe(&mut self, _: &[f64]) {
        self.samples += 1;
    }

    fn advance(&mut self, _: &[f64]) {}

    fn output(&self, y: &mut [f64]) {
        y.fill(f64::NAN);
    }

    fn rollout(&self, commands: &[f64], _: &mut Workspace, y: &mut [f64]) {
        y.fill(f64::NAN);
        let mut failed = self.error.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if failed.is_none() {
            *failed = Python::attach(|py| self.predict(py, commands, y)).err();
        }
    }

    fn snapshot_len(&self) -> usize {
        2
    }

    fn snapshot(&self, into: &mut [f64]) {
        into.copy_from_slice(&[self.run as f64, self.samples as f64]);
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "numbers of snapshot")]
    fn restore(&mut self, from: &[f64]) {
        (self.run, self.samples) = (from[0] as usize, from[1] as usize);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}

/// The ranges of the outputs over runs.
fn ranges(runs: &[Trajectory], outputs: usize) -> Vec<DesignRange> {
    let range = |c: usize| {
        let values = runs.iter().flat_map(|run| run.outputs.column(c)).filter(|y| y.is_finite());
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| (a.min(y), b.max(y)));
        DesignRange { low, high }
    };
    (0..outputs).map(range).collect()
}

/// Evaluates a model or a function on runs; the result is the document of `hydroid evaluate --json`.
#[pyfunction]
#[pyo3(signature = (predictor, logs, horizon, stride, options=None, name=None, warm_up=1, origin="measured", against="measurement", threads=None, progress=None))]
pub(crate) fn evaluate<'py>(
    py: Python<'py>,
    predictor: &Bound<'py, PyAny>,
    logs: &Bound<'py, PyAny>,
    horizon: &Bound<'py, PyAny>,
    stride: usize,
    options: Option<&Bound<'py, PyDict>>,
    name: Option<String>,
    warm_up: usize,
    origin: &str,
    against: &str,
    threads: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let horizon = self::horizon(horizon)?;
    let origin = match origin {
        "measured" => judge::Origin::Measured,
        "true" => judge::Origin::True,
        other => return Err(unfit("origin", "'measured' or 'true'", format!("'{other}'"))),
    };
    let against = match against {
        "measurement" => judge::Against::Measurement,
        "truth" => judge::Against::Truth,
        other => return Err(unfit("against", "'measurement' or 'truth'", format!("'{other}'"))),
    };
    let options_of = |dt: f64| Options {
        horizon: horizon.samples(dt),
        origin_stride: stride,
        warm_up: warm_up.max(1),
        origin,
        against,
        ..Options::default()
    };
    let finish =
        |evaluation: Result<Evaluation, EvaluateError>| settings::document(py, &evaluation.map_err(value)?);
    if let Ok(model) = predictor.cast::<Model>() {
        let model = Arc::clone(&model.get().model);
        let runs = runs(py, "logs", logs, &reading(Some(&model), options)?)?;
        let model = match runs.first() {
            Some(run) => model::at(&model, run)?,
            None => model,
        };
        model.check(&runs).map_err(value)?;
        let options = options_of(model.description.dt);
        return finish(work::run(py, threads, progress, move |control| {
            let runs: Vec<&Trajectory> = runs.iter().collect();
            let name = name.unwrap_or_else(|| model.description.name.clone());
            let ranges = model.output_ranges();
            let mut session = model.session();
            judge::evaluate(&name, session.as_mut(), &ranges, &runs, &options, &mut |done| {
                control.report(done)
            })
        })?);
    }
    if !predictor.is_callable() {
        let given = predictor.get_type().name()?;
        return Err(crate::error::expected("predictor", "a Model or a function", given));
    }
    let runs = runs(py, "logs", logs, &reading(None, options)?)?;
    let (q, m) = runs.first().map_or((0, 0), |run| (run.outputs.width(), run.inputs.width()));
    let history = |run: &Trajectory| {
        let whole = |table: &hydroid::log::Table| -> PyResult<Py<PyArray2<f64>>> {
            let array = rows_of(py, table.rows(0, table.len()).to_vec(), run.len(), table.width())?;
            array.call_method1("setflags", (false,))?;
            Ok(array.unbind())
        };
        Ok(History { outputs: whole(&run.outputs)?, inputs: whole(&run.inputs)? })
    };
    let error = Arc::new(Mutex::new(None));
    let mut function = Function {
        call: Arc::new(predictor.clone().unbind()),
        histories: runs.iter().map(history).collect::<PyResult<_>>()?,
        error: Arc::clone(&error),
        widths: [q, m],
        warm_up: warm_up.max(1),
        run: 0,
        samples: 0,
    };
    let name = match name {
        Some(name) => name,
        None => predictor
            .getattr("__name__")
            .and_then(|name| name.extract())
            .unwrap_or_else(|_| "function".to_owned()),
    };
    let options = options_of(runs.first().map_or(1.0, |run| run.dt));
    // Python runs one thread at a time, and the function need not be prepared for several.
    let evaluation = work::run(py, Some(1), progress, move |control| {
        let ranges = ranges(&runs, q);
        let runs: Vec<&Trajectory> = runs.iter().collect();
        let failed = Arc::clone(&function.error);
        let result = judge::evaluate(&name, &mut function, &ranges, &runs, &options, &mut |done| {
            let failed = failed.lock().is_ok_and(|failed| failed.is_some());
            if failed { std::ops::ControlFlow::Break(()) } else { control.report(done) }
        });
        Python::attach(|_| drop(function));
        result
    })?;
    if let Some(error) = error.lock().ok().and_then(|mut error| error.take()) {
        return Err(error);
    }
    finish(evaluation)
}

mod model {
    use std::sync::Arc;

    use hydroid::log::Trajectory;
    use hydroid::model::Model;
    use pyo3::PyResult;

    use crate::error::value;

    /// The model with the sample time of a run, which only vessels can change.
    pub(super) fn at(model: &Arc<Model>, run: &Trajectory) -> PyResult<Arc<Model>> {
        Model::clone(model).at_step(run.dt).map(Arc::new).map_err(value)
    }
}
