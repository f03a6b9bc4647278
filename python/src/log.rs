//! Logs, and the runs that are prepared from them.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, Float64Array, RecordBatch, StructArray};
use arrow_schema::{DataType, Field, Schema, TimeUnit};
use hydroid::atomic;
use hydroid::boat::Boat;
use hydroid::config;
use hydroid::log::line::{Cell, header_columns, number};
use hydroid::log::stamp::pass_midnight;
use hydroid::log::units::{self, Unit};
use hydroid::log::{self, BadCell, LogError, Note, PrepareOptions, RawColumn, RawLog, Selection, Trajectory};
use hydroid::model::{Model, Reading};
use hydroid::recording;
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyFileNotFoundError, PyKeyError};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict, PyList, PyMapping, PyTuple};
use pyo3_arrow::PyTable;
use pyo3_arrow::ffi::{ArrayIterator, to_stream_pycapsule};

use crate::arrays::{doubles, table};
use crate::error::{expected, internal, unfit, value};
use crate::settings;
use crate::work::{self, Control};

pub(crate) fn of_log(error: LogError) -> PyErr {
    match error {
        LogError::NotFound { .. } => PyFileNotFoundError::new_err(error.to_string()),
        LogError::IsDirectory { .. } | LogError::Read { .. } => crate::error::os(error),
        error => value(error),
    }
}

/// Warnings as Python warnings; other notes are kept by the caller.
pub(crate) fn warn(py: Python<'_>, notes: &[Note]) -> PyResult<()> {
    let category = py.import("hydroid")?.getattr("LogWarning")?;
    for note in notes.iter().filter(|note| note.is_warning()) {
        let remedy = note.remedy.as_ref().map(|remedy| format!("; {remedy}")).unwrap_or_default();
        let text = value(format!("{}{remedy}", note.message)).value(py).to_string();
        let text = std::ffi::CString::new(text.replace('\0', " ")).map_err(internal)?;
        PyErr::warn(py, &category, &text, 3)?;
    }
    Ok(())
}

#[pyclass(frozen, module = "hydroid")]
pub(crate) struct Log {
    raw: Arc<RawLog>,
}

impl Log {
    pub(crate) fn of(raw: RawLog) -> Self {
        Self { raw: Arc::new(raw) }
    }
}

#[pymethods]
impl Log {
    #[new]
    #[pyo3(signature = (data, *, units=None, name="log"))]
    fn new(data: &Bound<'_, PyAny>, units: Option<&Bound<'_, PyDict>>, name: &str) -> PyResult<Self> {
        let mut columns = if data.hasattr("__arrow_c_stream__")? {
            from_arrow(data, name)?
        } else if let Ok(mapping) = data.cast::<PyMapping>() {
            from_mapping(mapping, name)?
        } else {
            let given = data.get_type().name()?;
            return Err(expected(
                "data",
                "a data frame with the Arrow C interface (pandas, polars, pyarrow) or a mapping from names to arrays",
                given,
            ));
        };
        for (column, unit) in units.into_iter().flatten() {
            let (column, unit): (String, String) = (column.extract()?, unit.extract()?);
            let names = columns.iter().map(|c| c.name.clone()).collect::<Vec<_>>().join(", ");
            let Some(found) = columns.iter_mut().find(|c| c.name == column) else {
                return Err(unfit("units", format!("names of columns ({names})"), format!("'{column}'")));
            };
            found.unit = Some(unit);
        }
        let raw = RawLog::from_columns(name, columns).map_err(of_log)?;
        Ok(Self { raw: Arc::new(raw) })
    }

    #[getter]
    fn name(&self) -> String {
        self.raw.file_name()
    }

    #[getter]
    fn path(&self) -> &str {
        &self.raw.path
    }

    #[getter]
    fn columns(&self) -> Vec<&str> {
        self.raw.columns.iter().map(|column| column.name.as_str()).collect()
    }

    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let units = PyDict::new(py);
        for column in &self.raw.columns {
            units.set_item(&column.name, column.unit.as_deref())?;
        }
        Ok(units)
    }

    /// Factors from the values of the columns to SI units.
    #[getter]
    fn factors(&self) -> PyResult<Vec<f64>> {
        let factor = |column: &RawColumn| {
            let of_name = || units::from_name(&column.name, false).map(|(_, unit)| unit);
            let unit = column.unit.as_deref().or_else(of_name).map(Unit::parse).transpose();
            unit.map(|unit| unit.map_or(1.0, |unit| unit.factor)).map_err(value)
        };
        self.raw.columns.iter().map(factor).collect()
    }

    /// Writes the log as CSV, in its units.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let raw = Arc::clone(&self.raw);
        work::run(py, None, None, move |_| atomic::write(&path, |out| raw.write_csv(out)))?
            .map_err(crate::error::os)
    }

    fn __len__(&self) -> usize {
        self.raw.rows()
    }

    fn __contains__(&self, name: &str) -> bool {
        self.raw.position(name).is_some()
    }

    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let at = self.raw.position(name).ok_or_else(|| {
            PyKeyError::new_err(format!("'{name}'; the columns are {}", self.columns().join(", ")))
        })?;
        Ok(PyArray1::from_slice(py, &self.raw.columns[at].values))
    }

    fn __repr__(&self) -> String {
        let columns: Vec<String> = self.raw.columns.iter().map(heading).collect();
        format!("Log('{}', {} rows: {})", self.raw.file_name(), self.raw.rows(), columns.join(", "))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let py = slf.py();
        let raw = &slf.get().raw;
        let columns = PyDict::new(py);
        for column in &raw.columns {
            columns.set_item(heading(column), PyArray1::from_slice(py, &column.values))?;
        }
        let restore = py.import("hydroid._logs")?.getattr("restored")?;
        Ok((
            restore,
            PyTuple::new(py, [columns.into_any(), raw.path.as_str().into_pyobject(py)?.into_any()])?,
        ))
    }

    fn _repr_html_(slf: Bound<'_, Self>) -> PyResult<Bound<'_, PyAny>> {
        slf.py().import("hydroid._html")?.call_method1("of_log", (slf,))
    }

    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyCapsule>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        let fields: Vec<Field> = self
            .raw
            .columns
            .iter()
            .map(|column| Field::new(heading(column), DataType::Float64, true))
            .collect();
        let schema = Arc::new(Schema::new(fields));
        let arrays = self
            .raw
            .columns
            .iter()
            .map(|column| -> Arc<dyn Array> { Arc::new(Float64Array::from(column.values.clone())) });
        let batch = RecordBatch::try_new(Arc::clone(&schema), arrays.collect()).map_err(internal)?;
        let rows: Arc<dyn Array> = Arc::new(StructArray::from(batch));
        let field = Arc::new(Field::new("", rows.data_type().clone(), false));
        let reader = ArrayIterator::new([Ok(rows)], field);
        Ok(to_stream_pycapsule(py, Box::new(reader), requested_schema)?)
    }
}

fn heading(column: &RawColumn) -> String {
    match &column.unit {
        Some(unit) => format!("{} [{unit}]", column.name),
        None => column.name.clone(),
    }
}

fn from_mapping(mapping: &Bound<'_, PyMapping>, name: &str) -> PyResult<Vec<RawColumn>> {
    let mut headings: Vec<String> = Vec::new();
    let mut values = Vec::new();
    for item in mapping.items()?.iter() {
        let (heading, array): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        let heading: String =
            heading.extract().map_err(|_| expected("data", "names of columns that are text", &heading))?;
        let argument = format!("data['{heading}']");
        let array = times_in_seconds(&array)?.unwrap_or(array);
        let array = doubles(&argument, &array)?;
        let view = array.as_array();
        if view.ndim() != 1 {
            return Err(unfit(&argument, "one dimension", format!("shape {:?}", view.shape())));
        }
        headings.push(heading);
        values.push(view.iter().copied().collect());
    }
    filled(&headings, values.into_iter().map(Column::of).collect(), name)
}

/// `datetime64` values as seconds since 1970.
fn times_in_seconds<'py>(array: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, PyAny>>> {
    let py = array.py();
    let kind = array.getattr("dtype").and_then(|dtype| dtype.getattr("kind")?.extract::<String>());
    if !kind.is_ok_and(|kind| kind == "M") {
        return Ok(None);
    }
    let numpy = py.import("numpy")?;
    let since = numpy.call_method1("asarray", (array,))?.sub(numpy.call_method1("datetime64", (0, "ns"))?)?;
    Ok(Some(since.div(numpy.call_method1("timedelta64", (1_000_000_000_i64, "ns"))?)?))
}

/// Values of a column, with what is wrong in it.
#[derive(Default)]
struct Column {
    values: Vec<f64>,
    bad: Option<BadCell>,
    bad_cells: usize,
    /// Whether the values are seconds since 1970, or of the day.
    stamps: bool,
    of_the_day: bool,
}

impl Column {
    fn of(values: Vec<f64>) -> Self {
        Self { values, ..Self::default() }
    }

    fn text(&mut self, text: Option<&str>) {
        let value = match number(text.unwrap_or("").trim(), false) {
            Cell::Number(x) => x,
            Cell::Missing => f64::NAN,
            Cell::Stamp(stamp) => {
                self.stamps = true;
                self.of_the_day |= !stamp.dated;
                stamp.seconds
            }
            Cell::Bad { infinite } => {
                self.bad_cells += 1;
                let text = text.unwrap_or("").chars().take(40).collect();
                self.bad.get_or_insert(BadCell { line: self.values.len() as u64 + 1, text, infinite });
                f64::NAN
            }
        };
        self.values.push(value);
    }
}

fn from_arrow(data: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<RawColumn>> {
    let table: PyTable = data.extract()?;
    let (batches, schema) = table.into_inner();
    let headings: Vec<String> = schema.fields().iter().map(|field| field.name().clone()).collect();
    let rows = batches.iter().map(RecordBatch::num_rows).sum();
    let columns = schema.fields().iter().enumerate().map(|(c, field)| {
        let mut column = Column { values: Vec::with_capacity(rows), ..Column::default() };
        for batch in &batches {
            append(&mut column, batch.column(c), field)?;
        }
        Ok(column)
    });
    filled(&headings, columns.collect::<PyResult<_>>()?, name)
}

fn append(column: &mut Column, array: &dyn Array, field: &Field) -> PyResult<()> {
    let cast = |to: &DataType| {
        arrow_cast::cast(array, to).map_err(|_| {
            let argument = format!("data['{}']", field.name());
            expected(&argument, "numbers, times or text", format!("Arrow type {}", field.data_type()))
        })
    };
    match field.data_type() {
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View | DataType::Dictionary(..) => {
            let text = cast(&DataType::LargeUtf8)?;
            text.as_string::<i64>().iter().for_each(|text| column.text(text));
        }
        DataType::Timestamp(unit, _) => {
            let per_second = match unit {
                TimeUnit::Second => 1,
                TimeUnit::Millisecond => 1_000,
                TimeUnit::Microsecond => 1_000_000,
                TimeUnit::Nanosecond => 1_000_000_000,
            };
            let counts = cast(&DataType::Int64)?;
            column.stamps = true;
            column.values.extend(counts.as_primitive::<Int64Type>().iter().map(|count| {
                count.map_or(f64::NAN, |count| {
                    let (whole, rest) = (count.div_euclid(per_second), count.rem_euclid(per_second));
                    whole as f64 + rest as f64 / per_second as f64
                })
            }));
        }
        _ => {
            let numbers = cast(&DataType::Float64)?;
            let numbers = numbers.as_primitive::<Float64Type>();
            if numbers.null_count() == 0 {
                column.values.extend_from_slice(numbers.values());
            } else {
                column.values.extend(numbers.iter().map(|x| x.unwrap_or(f64::NAN)));
            }
        }
    }
    Ok(())
}

fn filled(headings: &[String], values: Vec<Column>, name: &str) -> PyResult<Vec<RawColumn>> {
    let mut columns = header_columns(headings, name).map_err(of_log)?;
    for (column, from) in columns.iter_mut().zip(values) {
        if from.stamps {
            column.unit = Some("s".to_owned());
        }
        column.values = from.values;
        if from.of_the_day {
            pass_midnight(&mut column.values);
        }
        column.bad = from.bad;
        column.bad_cells = from.bad_cells;
    }
    Ok(columns)
}

/// Reads logs from files, those of one vessel together. With a configuration file, its section `[log]` selects columns and
/// sensors of recordings, and the logs have the channels of the selection in SI units.
#[pyfunction]
#[pyo3(signature = (paths, config=None, progress=None))]
pub(crate) fn read_logs(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    config: Option<PathBuf>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<Log>> {
    let reading = match &config {
        Some(file) => Some(config::read(file).map_err(value)?.reading().map_err(value)?),
        None => None,
    };
    let read = move |control: &Control| -> Result<_, LogError> {
        let report = &mut |done| control.report(done);
        let Some(Reading { mut selection, options }) = reading else {
            return recording::read_logs(
                &paths,
                &mut Selection::default(),
                &PrepareOptions::default(),
                report,
            );
        };
        let (raw, mut notes) = recording::read_logs(&paths, &mut selection, &options, report)?;
        let convert = |log: &RawLog| recording::converted(log, &selection, &mut notes);
        Ok((raw.iter().map(convert).collect::<Result<Vec<_>, _>>()?, notes))
    };
    let (logs, notes) = work::run(py, None, progress, read)?.map_err(of_log)?;
    warn(py, &notes)?;
    Ok(logs.into_iter().map(Log::of).collect())
}

/// A log as it was given.
pub(crate) enum Given {
    Table(Arc<RawLog>),
    /// A file, which is read with the options of reading.
    Path(PathBuf),
}

impl Given {
    /// A [`Log`], the path of a file, a data frame or a mapping from names to arrays. The argument names a log that has no
    /// file.
    fn new(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(log) = given.cast::<Log>() {
            return Ok(Self::Table(Arc::clone(&log.get().raw)));
        }
        if let Ok(path) = given.extract::<PathBuf>() {
            return Ok(Self::Path(path));
        }
        if given.hasattr("__arrow_c_stream__")? || given.cast::<PyMapping>().is_ok() {
            return Ok(Self::Table(Log::new(given, None, argument)?.raw));
        }
        let wanted = "Log objects or paths of files, data frames or mappings from names to arrays";
        Err(expected(argument, wanted, given.get_type().name()?))
    }
}

/// One log or several.
pub(crate) fn logs(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Given>> {
    let given = items(given)?;
    let name = |i: usize| if given.len() == 1 { argument.to_owned() } else { format!("{argument}[{i}]") };
    given.iter().enumerate().map(|(i, item)| Given::new(&name(i), item)).collect()
}

/// The tables of logs. All files are read together, as the commands read them: recordings of one vessel share constants of
/// their sensors, which are filled in the options. `report` has the progress of the reading.
pub(crate) fn tables(
    py: Python<'_>,
    given: &[&Given],
    reading: &mut Reading,
    progress: Option<&Bound<'_, PyAny>>,
    report: impl Fn(&Control, f64) -> ControlFlow<()> + Send + 'static,
) -> PyResult<(Vec<RawLog>, Vec<Note>)> {
    let mut paths = Vec::new();
    for given in given {
        match given {
            Given::Path(path) => paths.push(path.clone()),
            Given::Table(log) if reading.selection.sensors.is_some() => {
                return Err(value(format!(
                    "{}: velocities are computed from the sensors of files: give the path of the recording, or name the outputs and inputs of a log that contains velocities",
                    log.path
                )));
            }
            Given::Table(_) => {}
        }
    }
    let Reading { mut selection, options } = reading.clone();
    let read = move |control: &Control| {
        recording::read_logs(&paths, &mut selection, &options, &mut |done| report(control, done))
            .map(|read| (read, selection))
    };
    let ((read, mut notes), selection) = work::run(py, None, progress, read)?.map_err(of_log)?;
    reading.selection = selection;
    let mut read = read.into_iter();
    let each = |given: &&Given| match given {
        Given::Table(log) => {
            let mut log = RawLog::clone(log);
            log::keep_parts(&mut log, &reading.selection, reading.options.dt, &mut notes).map_err(of_log)?;
            Ok(log)
        }
        Given::Path(_) => read.next().ok_or_else(|| internal("each file has a log")),
    };
    let tables = given.iter().map(each).collect::<PyResult<_>>()?;
    Ok((tables, notes))
}

/// The table of one log, with all columns of a file.
pub(crate) fn table_of(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<RawLog> {
    let py = given.py();
    let (mut tables, notes) =
        tables(py, &[&Given::new(argument, given)?], &mut Reading::default(), None, Control::report)?;
    warn(py, &notes)?;
    tables.pop().ok_or_else(|| internal("a log has a table"))
}

/// The items of a list or tuple; any other object is one item.
pub(crate) fn items<'py>(given: &Bound<'py, PyAny>) -> PyResult<Vec<Bound<'py, PyAny>>> {
    if let Ok(list) = given.cast::<PyList>() {
        return Ok(list.iter().collect());
    }
    if let Ok(tuple) = given.cast::<PyTuple>() {
        return Ok(tuple.iter().collect());
    }
    Ok(vec![given.clone()])
}

/// Options of reading, the section `[log]` of `hydroid.toml`, over the options of a model.
pub(crate) fn reading(model: Option<&Model>, options: Option<&Bound<'_, PyDict>>) -> PyResult<Reading> {
    let given: config::Log = match options {
        Some(options) => settings::of(options)?,
        None => config::Log::default(),
    };
    match model.map(|model| &model.description) {
        Some(of) => given.over(of.reading.clone(), &of.boat),
        None => given.over(Reading::default(), &Boat::default()),
    }
    .map_err(value)
}

/// Runs of logs; runs are taken as they are.
pub(crate) fn runs(
    py: Python<'_>,
    argument: &str,
    given: &Bound<'_, PyAny>,
    reading: &Reading,
) -> PyResult<Vec<Trajectory>> {
    let given = items(given)?;
    if !given.is_empty() && given.iter().all(PyAnyMethods::is_instance_of::<Run>) {
        return given
            .iter()
            .map(|item| Ok(Trajectory::clone(&item.cast::<Run>()?.get().trajectory)))
            .collect();
    }
    let given = logs(argument, PyList::new(py, given)?.as_any())?;
    let mut reading = reading.clone();
    let (raw, notes) = tables(py, &given.iter().collect::<Vec<_>>(), &mut reading, None, Control::report)?;
    warn(py, &notes)?;
    let prepared =
        work::run(py, None, None, move |_| log::prepare(&raw, &reading.selection, &reading.options))?;
    let prepared = prepared.map_err(of_log)?;
    warn(py, &prepared.notes)?;
    Ok(prepared.runs)
}

/// Prepares logs: runs with a common clock, in SI units.
#[pyfunction]
#[pyo3(signature = (logs, options=None))]
pub(crate) fn prepare(
    py: Python<'_>,
    logs: &Bound<'_, PyAny>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<Run>> {
    let runs = runs(py, "logs", logs, &reading(None, options)?)?;
    Ok(runs.into_iter().map(Run::of).collect())
}

/// Names, units and stated deviations of the channels of a table, and its values, row by row.
type Part<'py> = (Vec<(String, String, Option<f64>)>, Bound<'py, PyAny>);

/// Headings and positions.
type Pose<'py> = [Option<Bound<'py, PyAny>>; 2];

/// Name, first time and sample time; outputs, inputs, true outputs and pose.
type Saved<'py> = ((String, f64, f64), Part<'py>, Part<'py>, Option<Part<'py>>, Pose<'py>);

#[pyclass(frozen, module = "hydroid")]
pub(crate) struct Run {
    pub(crate) trajectory: Arc<Trajectory>,
}

impl Run {
    pub(crate) fn of(trajectory: Trajectory) -> Self {
        Self { trajectory: Arc::new(trajectory) }
    }
}

fn names(table: &log::Table) -> Vec<&str> {
    table.channels().iter().map(|channel| channel.name.as_str()).collect()
}

#[pymethods]
impl Run {
    #[getter]
    fn name(&self) -> &str {
        &self.trajectory.name
    }

    #[getter]
    fn dt(&self) -> f64 {
        self.trajectory.dt
    }

    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let run = &self.trajectory;
        PyArray1::from_iter(py, (0..run.len()).map(|k| run.t0 + k as f64 * run.dt))
    }

    #[getter]
    fn outputs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let outputs = &self.trajectory.outputs;
        table(py, outputs.rows(0, outputs.len()).to_vec(), outputs.width())
    }

    #[getter]
    fn inputs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let inputs = &self.trajectory.inputs;
        table(py, inputs.rows(0, inputs.len()).to_vec(), inputs.width())
    }

    #[getter]
    fn heading<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.trajectory.heading.as_ref().map(|heading| PyArray1::from_slice(py, heading))
    }

    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let position = self.trajectory.position.as_ref();
        position.map(|of| table(py, of.as_flattened().to_vec(), 2)).transpose()
    }

    #[getter]
    fn output_names(&self) -> Vec<&str> {
        names(&self.trajectory.outputs)
    }

    #[getter]
    fn input_names(&self) -> Vec<&str> {
        names(&self.trajectory.inputs)
    }

    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let units = PyDict::new(py);
        let run = &self.trajectory;
        for channel in run.outputs.channels().iter().chain(run.inputs.channels()) {
            units.set_item(&channel.name, &channel.unit)?;
        }
        Ok(units)
    }

    fn __len__(&self) -> usize {
        self.trajectory.len()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Saved<'py>)> {
        let run = &self.trajectory;
        let part = |of: &log::Table| -> PyResult<Part<'py>> {
            let channel = |(i, c): (usize, &log::Channel)| (c.name.clone(), c.unit.clone(), of.deviation(i));
            let channels = of.channels().iter().enumerate().map(channel).collect();
            Ok((channels, PyArray1::from_slice(py, of.rows(0, of.len())).into_any()))
        };
        let truth = run.truth.as_ref().map(part).transpose()?;
        let heading = run.heading.as_ref().map(|heading| PyArray1::from_slice(py, heading).into_any());
        let position = run.position.as_ref().map(|of| PyArray1::from_slice(py, of.as_flattened()).into_any());
        let start = (run.name.clone(), run.t0, run.dt);
        let saved = (start, part(&run.outputs)?, part(&run.inputs)?, truth, [heading, position]);
        Ok((py.get_type::<Self>().getattr("_restored")?, saved))
    }

    #[staticmethod]
    fn _restored(
        start: (String, f64, f64),
        outputs: Part<'_>,
        inputs: Part<'_>,
        truth: Option<Part<'_>>,
        pose: Pose<'_>,
    ) -> PyResult<Self> {
        let table = |(channels, values): Part<'_>| -> PyResult<log::Table> {
            let (channels, deviations): (Vec<log::Channel>, Vec<Option<f64>>) = channels
                .into_iter()
                .map(|(name, unit, deviation)| (log::Channel::new(name, unit), deviation))
                .unzip();
            let values = doubles("values", &values)?.as_slice()?.to_vec();
            if values.len() % channels.len().max(1) != 0 || channels.is_empty() && !values.is_empty() {
                return Err(unfit("values", "whole rows", values.len()));
            }
            Ok(log::Table::new(channels, values).with_deviations(deviations))
        };
        let (name, t0, dt) = start;
        let (outputs, inputs) = (table(outputs)?, table(inputs)?);
        let truth = truth.map(table).transpose()?;
        let values = |of: Option<Bound<'_, PyAny>>, name| {
            of.map(|of| Ok::<_, PyErr>(doubles(name, &of)?.as_slice()?.to_vec())).transpose()
        };
        let [heading, position] = pose;
        let (heading, position) = (values(heading, "heading")?, values(position, "position")?);
        let position = position.map(|flat| flat.as_chunks().0.to_vec());
        let rows = outputs.len();
        let lengths = [
            (inputs.width() > 0).then(|| inputs.len()),
            truth.as_ref().map(log::Table::len),
            heading.as_ref().map(Vec::len),
            position.as_ref().map(Vec::len),
        ];
        if let Some(other) = lengths.into_iter().flatten().find(|length| *length != rows) {
            return Err(unfit("rows", format!("{rows} rows in all parts of a run"), other));
        }
        let is_alike = truth.as_ref().is_none_or(|truth| truth.channels() == outputs.channels());
        let is_held = inputs.rows(0, inputs.len()).iter().all(|x| x.is_finite());
        if !(t0.is_finite() && dt.is_finite() && dt > 0.0 && is_alike && is_held) {
            return Err(expected("run", "that of a pickle of hydroid", name));
        }
        Ok(Self::of(Trajectory { name, t0, dt, outputs, inputs, truth, heading, position }))
    }

    fn __repr__(&self) -> String {
        let run = &self.trajectory;
        format!(
            "Run('{}', {} samples of {} s: outputs {}; inputs {})",
            run.name,
            run.len(),
            run.dt,
            names(&run.outputs).join(", "),
            names(&run.inputs).join(", ")
        )
    }
}
