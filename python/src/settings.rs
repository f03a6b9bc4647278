//! Options from dictionaries, and documents as dictionaries.

use std::path::Path;

use hydroid::config::control::ClosedLoopOptions;
use hydroid::config::schema::options_of;
use hydroid::config::{self, Config};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyInt, PyList, PyString, PyTuple};
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::Value;

use crate::error::{expected, internal, unfit, value};

/// Options as the tables of `hydroid.toml`. What is `None` is left out.
pub(crate) fn table(options: &Bound<'_, PyDict>) -> PyResult<Value> {
    let mut table = toml::Table::new();
    for (key, given) in options {
        let name: String = key.extract().map_err(|_| expected("options", "names that are text", &key))?;
        if let Some(value) = setting(&name, &given)? {
            table.insert(name, value);
        }
    }
    Ok(Value::Table(table))
}

fn setting(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Option<Value>> {
    let list = |items: Vec<Bound<'_, PyAny>>| {
        let items = items.iter().filter_map(|item| setting(name, item).transpose());
        Ok(Some(Value::Array(items.collect::<PyResult<_>>()?)))
    };
    if given.is_none() {
        return Ok(None);
    }
    if let Ok(dict) = given.cast::<PyDict>() {
        return table(dict).map(Some);
    }
    if let Ok(items) = given.cast::<PyList>() {
        return list(items.iter().collect());
    }
    if let Ok(items) = given.cast::<PyTuple>() {
        return list(items.iter().collect());
    }
    // Arrays, and numbers of NumPy.
    if given.hasattr("tolist")? {
        return setting(name, &given.call_method0("tolist")?);
    }
    if given.is_instance_of::<PyBool>() {
        return Ok(Some(Value::Boolean(given.extract()?)));
    }
    if given.is_instance_of::<PyString>() {
        return Ok(Some(Value::String(given.extract()?)));
    }
    if given.is_instance_of::<PyInt>() || given.hasattr("__index__")? {
        return Ok(Some(Value::Integer(given.extract()?)));
    }
    // Paths are text.
    if let Ok(path) = given.extract::<std::path::PathBuf>() {
        return Ok(Some(Value::String(path.display().to_string())));
    }
    match given.extract::<f64>() {
        Ok(x) => Ok(Some(Value::Float(x))),
        Err(_) => Err(expected(name, "numbers, text, lists or dictionaries", given.get_type().name()?)),
    }
}

/// The options of a section: key, kind, text, and the names that the value can be.
#[pyfunction]
pub(crate) fn options<'py>(py: Python<'py>, section: &str) -> PyResult<Bound<'py, PyAny>> {
    let all = match section {
        "adapt" => options_of::<config::Adapt>(),
        "control" => options_of::<ClosedLoopOptions>(),
        "identify" => options_of::<config::Identify>(),
        "simulate" => options_of::<config::Simulate>(),
        "manoeuvre" => options_of::<config::Manoeuvre>(),
        _ => return Err(unfit("section", "adapt, control, identify, manoeuvre or simulate", section)),
    };
    document(py, &all)
}

/// Options of a type of the library.
pub(crate) fn of<T: DeserializeOwned>(options: &Bound<'_, PyDict>) -> PyResult<T> {
    read(table(options)?)
}

/// A type of the library from its table; an error names the key.
pub(crate) fn read<T: DeserializeOwned>(table: Value) -> PyResult<T> {
    serde_path_to_error::deserialize(table).map_err(|error| {
        let message = error.inner().message();
        let text = match error.path().to_string().as_str() {
            "." => message.to_owned(),
            path => format!("{path}: {message}"),
        };
        value(text)
    })
}

/// A configuration file, if there is one, with the sections `options` over it.
pub(crate) fn config(file: Option<&Path>, options: &Bound<'_, PyDict>) -> PyResult<Config> {
    Config::with(file, &table(options)?).map_err(value)
}

/// Puts the values of a table over those of another one.
pub(crate) fn merge(into: &mut Value, from: Value) {
    match (into, from) {
        (Value::Table(into), Value::Table(from)) => {
            for (key, value) in from {
                match into.get_mut(&key) {
                    Some(known) => merge(known, value),
                    None => drop(into.insert(key, value)),
                }
            }
        }
        (into, from) => *into = from,
    }
}

/// A result as dictionaries and lists; undefined numbers are `None`.
pub(crate) fn document<'py>(py: Python<'py>, result: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(result).map_err(internal)?;
    py.import("json")?.call_method1("loads", (text,))
}
