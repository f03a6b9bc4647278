//! Models, and sessions of a model on one run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use hydroid::craft::CraftFileError;
use hydroid::model::{self, ModelError};
use hydroid::plant::find_roles;
use hydroid::toml_file::TomlError;
use hydroid_core::model::sparse::{EquationsSession, Jacobian, Shape, Signal};
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

/// Whether the file of a vessel does not exist.
fn is_missing(error: &ModelError) -> bool {
    let ModelError::Craft(CraftFileError::File(toml)) = error else {
        return false;
    };
    matches!(toml, TomlError::Read { source, .. } if source.kind() == std::io::ErrorKind::NotFound)
}

pub(crate) fn of_model(error: ModelError) -> PyErr {
    match error {
        ref error if is_missing(error) => PyFileNotFoundError::new_err(error.to_string()),
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

    /// Roles of the inputs, as far as they are known.
    #[getter]
    fn roles(&self) -> BTreeMap<String, &'static str> {
        let boat = find_roles(&self.model);
        boat.inputs.into_iter().filter_map(|(name, input)| Some((name, input.role?.name()))).collect()
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

    /// `dy/dt` at the samples of a run, shape `(samples, outputs)`.
    #[pyo3(signature = (outputs, inputs=None))]
    fn derivative<'py>(
        &self,
        py: Python<'py>,
        outputs: &Bound<'py, PyAny>,
        inputs: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let equations = self.named("derivative")?;
        let equations = equations.equations();
        let (q, m) = (equations.outputs(), equations.inputs());
        let (y, [samples, _]) = shaped("outputs", outputs, [None, Some(q)], "samples, outputs")?;
        let c = commands("inputs", inputs, samples, m)?;
        let mut session = EquationsSession::new(Arc::clone(equations));
        let mut slots = vec![0.0; equations.slots()];
        let mut all = vec![0.0; samples * q];
        let y = y.as_slice()?;
        for k in 0..samples {
            let (y, c) = (&y[k * q..(k + 1) * q], &c[k * m..(k + 1) * m]);
            session.observe(y);
            equations.load(session.state(), c, &mut slots);
            equations.derivative(&mut slots, &mut all[k * q..(k + 1) * q]);
            session.advance(c);
        }
        table(py, all, q)
    }

    /// The equations as data: for each output its terms, `(coefficient, [(variable, function, parameters)])`, and the
    /// signals, `(name, kind, source, number)`.
    fn terms(&self) -> PyResult<(Vec<Vec<Product>>, Vec<(String, &'static str, String, f64)>)> {
        let named = self.named("terms")?;
        let equations = named.equations();
        let names = named.variable_names();
        let product = |output: usize, j: usize| {
            let factor = |factor: &hydroid_core::model::sparse::Factor| {
                let (function, parameters) = function(factor.shape);
                (names[usize::from(factor.variable)].clone(), function, parameters)
            };
            let coefficient = equations.coefficient(output, j);
            (coefficient, equations.terms()[j].factors().iter().map(factor).collect())
        };
        let terms = 0..equations.terms().len();
        let of_output = |i: usize| {
            terms.clone().map(|j| product(i, j)).filter(|(coefficient, _)| *coefficient != 0.0).collect()
        };
        let first = equations.outputs() + equations.inputs();
        let signal = |(index, signal): (usize, &Signal)| {
            let (kind, number) = match *signal {
                Signal::Lag { time_constant_s, .. } => ("lag", time_constant_s.0),
                Signal::Past { samples, .. } => ("past", f64::from(samples) * equations.dt()),
            };
            (names[first + index].clone(), kind, names[usize::from(signal.source())].clone(), number)
        };
        let signals = equations.signals().iter().enumerate().map(signal).collect();
        Ok(((0..equations.outputs()).map(of_output).collect(), signals))
    }

    /// The equations as expressions of `SymPy`.
    fn to_sympy(slf: Bound<'_, Self>) -> PyResult<Bound<'_, PyAny>> {
        slf.py().import("hydroid._symbols")?.call_method1("to_sympy", (slf,))
    }

    fn _repr_html_(slf: Bound<'_, Self>) -> PyResult<Bound<'_, PyAny>> {
        slf.py().import("hydroid._html")?.call_method1("of_model", (slf,))
    }

    /// Predicts the outputs under commands, after the measurements and commands before them.
    fn predict<'py>(
        &self,
        py: Python<'py>,
        outputs: &Bound<'py, PyAny>,
        inputs: Option<&Bound<'py, PyAny>>,
        commands: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let mut session = self.model.session();
        let (q, m) = (session.outputs(), session.inputs());
        let (y, [samples, _]) = shaped("outputs", outputs, [None, Some(q)], "samples, outputs")?;
        if samples == 0 {
            return Err(unfit("outputs", "at least one measurement", 0));
        }
        let before = self::commands("inputs", inputs, samples - 1, m)?;
        let (c, [steps, _]) = shaped("commands", commands, [None, Some(m)], "horizon, inputs")?;
        let (y, c) = (y.as_slice()?, c.as_slice()?);
        let mut predicted = vec![0.0; steps * q];
        py.detach(|| {
            session.observe(&y[..q]);
            for k in 1..samples {
                session.advance_observe(&before[(k - 1) * m..k * m], &y[k * q..(k + 1) * q]);
            }
            session.rollout(c, &mut Workspace::new(), &mut predicted);
        });
        table(py, predicted, q)
    }

    /// Simulates the outputs from `start` under commands; row 0 is `start`, and the last command is not used.
    #[pyo3(signature = (start, inputs=None, *, samples=None))]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        start: &Bound<'py, PyAny>,
        inputs: Option<&Bound<'py, PyAny>>,
        samples: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let mut session = self.model.session();
        let (q, m) = (session.outputs(), session.inputs());
        let (y, _) = shaped("start", start, [Some(q)], "outputs")?;
        let samples = match (samples, inputs) {
            (Some(samples), _) => samples,
            (None, Some(inputs)) => inputs.len()?,
            (None, None) => return Err(unfit("samples", "a number of samples, or inputs", "None")),
        };
        let c = commands("inputs", inputs, samples, m)?;
        let mut all = vec![0.0; samples * q];
        if samples > 0 {
            let y = y.as_slice()?;
            all[..q].copy_from_slice(y);
            py.detach(|| {
                session.observe(y);
                session.rollout(&c[..(samples - 1) * m], &mut Workspace::new(), &mut all[q..]);
            });
        }
        table(py, all, q)
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
        Session::of(&self.model, self.model.session())
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
        let runs = log::runs(py, "logs", logs, &reading(Some(&self.model), options)?)?;
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

/// A coefficient and its factors: variable, function, parameters.
type Product = (f64, Vec<(String, &'static str, Vec<f64>)>);

fn function(shape: Shape) -> (&'static str, Vec<f64>) {
    match shape {
        Shape::Power(n) => ("power", vec![f64::from(n)]),
        Shape::Abs => ("abs", vec![]),
        Shape::Sign => ("sign", vec![]),
        Shape::Sin => ("sin", vec![]),
        Shape::Cos => ("cos", vec![]),
        Shape::Reciprocal => ("reciprocal", vec![]),
        Shape::Log => ("log", vec![]),
        Shape::Above(gate) => ("above", vec![gate.centre.0, gate.slope.0]),
        Shape::Below(gate) => ("below", vec![gate.centre.0, gate.slope.0]),
    }
}

/// Commands `(samples, inputs)`; they may be left out for a model without inputs.
fn commands(
    argument: &str,
    given: Option<&Bound<'_, PyAny>>,
    samples: usize,
    inputs: usize,
) -> PyResult<Vec<f64>> {
    match given {
        Some(given) => {
            let (c, _) = shaped(argument, given, [Some(samples), Some(inputs)], "samples, inputs")?;
            Ok(c.as_slice()?.to_vec())
        }
        None if inputs == 0 => Ok(Vec::new()),
        None => Err(unfit(argument, format!("shape (samples = {samples}, inputs = {inputs})"), "None")),
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
    model: Arc<model::Model>,
}

impl Session {
    fn of(model: &Arc<model::Model>, session: Box<dyn Predictor>) -> Self {
        Self { session, work: Workspace::new(), model: Arc::clone(model) }
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
        let (q, c, Self { session, work, .. }) = (self.session.outputs(), c.as_slice()?, self);
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
        let (q, c, Self { session, work, .. }) = (self.session.outputs(), c.as_slice()?, self);
        let mut y = vec![0.0; count * steps * q];
        py.detach(|| session.rollout_batch(count, c, work, &mut y));
        PyArray1::from_vec(py, y).reshape([count, steps, q])
    }

    /// Shortest time of a batch of rollouts without Python, for the benchmark of the package \[s\].
    fn _seconds_of_rollout_batch(&mut self, commands: &Bound<'_, PyAny>, repeats: usize) -> PyResult<f64> {
        let inputs = self.session.inputs();
        let (c, [count, steps, _]) =
            shaped("commands", commands, [None, None, Some(inputs)], "sequences, samples, inputs")?;
        let c = c.as_slice()?;
        let mut y = vec![0.0; count * steps * self.session.outputs()];
        let seconds = (0..repeats).map(|_| {
            let start = Instant::now();
            self.session.rollout_batch(count, c, &mut self.work, &mut y);
            start.elapsed().as_secs_f64()
        });
        Ok(seconds.fold(f64::INFINITY, f64::min))
    }

    fn fork(&self) -> Self {
        Self::of(&self.model, self.session.fork())
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Model, Bound<'py, PyArray1<f64>>))> {
        let model = Model { model: Arc::clone(&self.model) };
        Ok((py.get_type::<Self>().getattr("_restored")?, (model, self.snapshot(py))))
    }

    #[staticmethod]
    fn _restored(model: &Model, snapshot: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut session = model.session();
        session.restore(snapshot)?;
        Ok(session)
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
