//! Exceptions from errors of the library.

use std::fmt::Display;

use pyo3::PyErr;
use pyo3::exceptions::{PyOSError, PyRuntimeError, PyTypeError, PyValueError};

/// A `ValueError` with the message of the library.
pub(crate) fn value(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// As [`value`], with the causes of the error.
pub(crate) fn chain(error: &dyn std::error::Error) -> PyErr {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let words = cause.to_string();
        // Many messages contain that of their cause.
        if !text.contains(&words) {
            text = format!("{text}: {words}");
        }
        next = cause.source();
    }
    value(text)
}

pub(crate) fn os(error: impl Display) -> PyErr {
    PyOSError::new_err(error.to_string())
}

pub(crate) fn internal(error: impl Display) -> PyErr {
    PyRuntimeError::new_err(format!("{error}; this is a defect of hydroid: please report it"))
}

/// A `TypeError` that names the argument, what was expected and what was given.
pub(crate) fn expected(argument: &str, expected: &str, given: impl Display) -> PyErr {
    PyTypeError::new_err(format!("{argument}: expected {expected}, got {given}"))
}

/// A `ValueError` of the same form.
pub(crate) fn unfit(argument: &str, expected: impl Display, given: impl Display) -> PyErr {
    PyValueError::new_err(format!("{argument}: expected {expected}, got {given}"))
}
