//! Models, and sessions of a model on one run.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use hydroid::model::{self, ModelError};
use hydroid_core::model::sparse::Jacobian;
use hydroid_core::predict::{Predictor, Workspace};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::{PyFileNotFoundError, PyNotImplementedError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use safetensors::{Dtype, SafeTensors};

use crate::arrays::{doubles, shaped, table};
use crate::error::{internal, os, unfit, value};
use crate::log::{self, reading};
use crate::work;

#[pyclass(frozen, module = "hydroid")]
pub(crate) struct Model {
    pub(crate) model: Arc<model::Model>,
}

impl Model {
    pub(crate) fn of(model: model::Model) -> Self {
        Self { model: Arc::new(model) }
    }

    fn named(&self, what: &str) -> PyResult<model::NamedEquations<'_>> {
        self.model.equations().ok_or_else(|| {
            PyNotImplementedError::new_err(format!(
                "{what}: the model '{}' of kind {} has no equations",
                self.model.description.name,
                self.model.kind()
            ))
        })
    }

    fn names(ports: &[model::Port]) -> Vec<&str> {
        ports.iter().map(|port| port.channel.name.as_str()).collect()
    }
}

pub(crate) fn of_model(error: ModelError) -> PyErr {
    match error {
        ModelError::Read { ref source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
            PyFileNotFoundError::new_err(error.to_string())
        }
        ModelError::Read { .. } => os(error),
        error => value(error),
    }
}

#[pymethods]
impl Model {
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        model::read(&path).map(Self::of).map_err(of_model)
    }

    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        model::decode(bytes, Path::new("bytes")).map(Self::of).map_err(of_model)
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &model::encode(&self.model).map_err(value)?))
    }

    fn save(&self, path: PathBuf) -> PyResult<()> {
        model::write(&self.model, &path).map_err(os)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        Ok((py.get_type::<Self>().getattr("from_bytes")?, (self.to_bytes(py)?,)))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| other.get().model == self.model)
    }

    fn __hash__(&self) -> u64 {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        self.model.description.name.hash(&mut hasher);
        self.model.weights().hash(&mut hasher);
        hasher.finish()
    }

    #[getter]
    fn name(&self) -> &str {
        &self.model.description.name
    }

    #[getter]
    fn kind(&self) -> &str {
        self.model.kind()
    }

    #[getter]
    fn dt(&self) -> f64 {
        self.model.description.dt
    }

    #[getter]
    fn output_names(&self) -> Vec<&str> {
        Self::names(&self.model.description.outputs)
    }

    #[getter]
    fn input_names(&self) -> Vec<&str> {
        Self::names(&self.model.description.inputs)
    }

    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let units = PyDict::new(py);
        let d = &self.model.description;
        for port in d.outputs.iter().chain(&d.inputs) {
            units.set_item(&port.channel.name, &port.channel.unit)?;
        }
        Ok(units)
    }

    #[getter]
    fn ranges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let ranges = PyDict::new(py);
        let d = &self.model.description;
        for port in d.outputs.iter().chain(&d.inputs) {
            ranges.set_item(&port.channel.name, (port.range.low, port.range.high))?;
        }
        Ok(ranges)
    }

    /// Number of weights.
    #[getter]
    fn size(&self) -> usize {
        self.model.weights()
    }

    #[getter]
    fn warm_up(&self) -> usize {
        self.model.session().warm_up()
    }

    fn equations(&self) -> PyResult<Vec<String>> {
        Ok(self.named("equations")?.equations_text())
    }

    fn latex(&self) -> PyResult<String> {
        Ok(self.named("latex")?.equations_latex())
    }

    /// Rows `(output, term, value, standard error, unit)`.
    fn coefficients(&self) -> PyResult<Vec<(String, String, f64, Option<f64>, String)>> {
        let all = self.named("coefficients")?.coefficients();
        Ok(all.into_iter().map(|c| (c.output, c.term, c.value, c.standard_error, c.unit)).collect())
    }

    /// `A = df/dy` and `B = df/dc` at an operating point.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        outputs: &Bound<'py, PyAny>,
        inputs: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
        let equations = self.named("jacobian")?;
        let equations = equations.equations();
        let (q, m) = (equations.outputs(), equations.inputs());
        let (y, _) = shaped("outputs", outputs, [Some(q)], "outputs")?;
        let (c, _) = shaped("inputs", inputs, [Some(m)], "inputs")?;
        let jacobian = Jacobian::new(equations).map_err(value)?;
        let (a, b) = jacobian.matrices(y.as_slice()?, c.as_slice()?);
        let states = a.len().isqrt();
        Ok((table(py, a, states)?, table(py, b, m)?))
    }

    /// The tensors of the model file.
    fn weights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let bytes = model::encode(&self.model).map_err(value)?;
        let weights = PyDict::new(py);
        let Ok(tensors) = SafeTensors::deserialize(&bytes) else { return Ok(weights) };
        let numpy = py.import("numpy")?;
        for (name, tensor) in tensors.tensors() {
            let dtype = match tensor.dtype() {
                Dtype::F64 => "<f8",
                Dtype::F32 => "<f4",
                Dtype::U8 => "u1",
                Dtype::U16 => "<u2",
                Dtype::U32 => "<u4",
                Dtype::U64 => "<u8",
                Dtype::I64 => "<i8",
                other => return Err(internal(format!("tensor {name} of type {other:?}"))),
            };
            let flat = numpy.call_method1("frombuffer", (PyBytes::new(py, tensor.data()), dtype))?;
            weights.set_item(name, flat.call_method1("reshape", (tensor.shape().to_vec(),))?)?;
        }
        Ok(weights)
    }

    /// The model whose sessions do not learn.
    fn frozen(&self) -> Self {
        Self::of(self.model.frozen())
    }

    fn session(&self) -> Session {
        Session::of(self.model.session())
    }

    /// Rollouts from origins along runs: for each run the origins and `origins x horizon x outputs`.
    #[pyo3(signature = (logs, horizon, stride, options=None))]
    fn rollouts<'py>(
        &self,
        py: Python<'py>,
        logs: &Bound<'py, PyAny>,
        horizon: usize,
        stride: usize,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Vec<(log::Run, Bound<'py, PyArray1<usize>>, Bound<'py, PyArray3<f64>>)>> {
        if horizon == 0 || stride == 0 {
            return Err(unfit("horizon and stride", "at least 1 sample", format!("{horizon} and {stride}")));
        }
        let runs = log::runs(py, "logs", logs, &reading(Some(&self.model.description.reading), options)?)?;
        self.model.check(&runs).map_err(value)?;
        let model = Arc::clone(&self.model);
        let rolled = work::run(py, None, None, move |control| {
            runs.into_iter()
                .map(|run| {
                    let (origins, y) = follow(&model, &run, horizon, stride, control);
                    (run, origins, y)
                })
                .collect::<Vec<_>>()
        })?;
        let q = self.model.description.outputs.len();
        let array = |(run, origins, y): (hydroid::log::Trajectory, Vec<usize>, Vec<f64>)| {
            let shape = [origins.len(), horizon, q];
            Ok((
                log::Run::of(run),
                PyArray1::from_vec(py, origins),
                PyArray1::from_vec(py, y).reshape(shape)?,
            ))
        };
        rolled.into_iter().map(array).collect()
    }

    fn __repr__(&self) -> String {
        let d = &self.model.description;
        format!(
            "Model('{}', {}, {} weights, dt = {} s: outputs {}; inputs {})",
            d.name,
            self.model.kind(),
            self.model.weights(),
            d.dt,
            Self::names(&d.outputs).join(", "),
            Self::names(&d.inputs).join(", ")
        )
    }
}

/// Origins of a run from the warm-up on, and the predictions from them under the commands of the run.
fn follow(
    model: &model::Model,
    run: &hydroid::log::Trajectory,
    horizon: usize,
    stride: usize,
    control: &work::Control,
) -> (Vec<usize>, Vec<f64>) {
    let mut session = model.session();
    let (q, warm_up, mut work) = (session.outputs(), session.warm_up().max(1), Workspace::new());
    let (mut origins, mut all) = (Vec::new(), Vec::new());
    session.reset();
    for k in 0..run.len().saturating_sub(horizon) {
        session.observe_heading(run.heading_at(k));
        session.observe(run.outputs.row(k));
        if k + 1 >= warm_up && (k + 1 - warm_up).is_multiple_of(stride) {
            let at = all.len();
            all.resize(at + horizon * q, 0.0);
            session.rollout(run.inputs.rows(k, k + horizon), &mut work, &mut all[at..]);
            origins.push(k);
        }
        if control.report(0.0).is_break() {
            break;
        }
        session.advance(run.inputs.row(k));
    }
    (origins, all)
}

/// A session of a model on one run.
#[pyclass(module = "hydroid")]
pub(crate) struct Session {
    pub(crate) session: Box<dyn Predictor>,
    work: Workspace,
}

impl Session {
    fn of(session: Box<dyn Predictor>) -> Self {
        Self { session, work: Workspace::new() }
    }
}

#[pymethods]
impl Session {
    fn reset(&mut self) {
        self.session.reset();
    }

    #[pyo3(signature = (outputs, heading=None))]
    fn observe(&mut self, outputs: &Bound<'_, PyAny>, heading: Option<f64>) -> PyResult<()> {
        let (y, _) = shaped("outputs", outputs, [Some(self.session.outputs())], "outputs")?;
        if let Some(heading) = heading {
            self.session.observe_heading(heading);
        }
        self.session.observe(y.as_slice()?);
        Ok(())
    }

    fn advance(&mut self, command: &Bound<'_, PyAny>) -> PyResult<()> {
        let (c, _) = shaped("command", command, [Some(self.session.inputs())], "inputs")?;
        self.session.advance(c.as_slice()?);
        Ok(())
    }

    #[getter]
    fn output<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let mut y = vec![0.0; self.session.outputs()];
        self.session.output(&mut y);
        PyArray1::from_vec(py, y)
    }

    fn rollout<'py>(
        &mut self,
        py: Python<'py>,
        commands: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (c, [steps, _]) =
            shaped("commands", commands, [None, Some(self.session.inputs())], "samples, inputs")?;
        let (q, c, Self { session, work }) = (self.session.outputs(), c.as_slice()?, self);
        let mut y = vec![0.0; steps * q];
        py.detach(|| session.rollout(c, work, &mut y));
        table(py, y, q)
    }

    fn rollout_batch<'py>(
        &mut self,
        py: Python<'py>,
        commands: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let inputs = self.session.inputs();
        let (c, [count, steps, _]) =
            shaped("commands", commands, [None, None, Some(inputs)], "sequences, samples, inputs")?;
        let (q, c, Self { session, work }) = (self.session.outputs(), c.as_slice()?, self);
        let mut y = vec![0.0; count * steps * q];
        py.detach(|| session.rollout_batch(count, c, work, &mut y));
        PyArray1::from_vec(py, y).reshape([count, steps, q])
    }

    fn fork(&self) -> Self {
        Self::of(self.session.fork())
    }

    fn snapshot<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let mut numbers = vec![0.0; self.session.snapshot_len()];
        self.session.snapshot(&mut numbers);
        PyArray1::from_vec(py, numbers)
    }

    fn restore(&mut self, snapshot: &Bound<'_, PyAny>) -> PyResult<()> {
        let numbers = doubles("snapshot", snapshot)?;
        let numbers = numbers.as_slice()?;
        if numbers.len() != self.session.snapshot_len() {
            let expected = format!("{} numbers of a session of the same model", self.session.snapshot_len());
            return Err(unfit("snapshot", expected, numbers.len()));
        }
        self.session.restore(numbers);
        Ok(())
    }
}
