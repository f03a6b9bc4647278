//! Exceptions from errors of the library.

use std::fmt::Display;

use pyo3::PyErr;
use pyo3::exceptions::{PyOSError, PyRuntimeError, PyTypeError, PyValueError};

/// A `ValueError` with the message of the library, in which options are named as keyword arguments.
pub(crate) fn value(error: impl Display) -> PyErr {
    PyValueError::new_err(as_keywords(&error.to_string()))
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

/// `--max-gap 3` of the command line is `max_gap=3` in Python.
fn as_keywords(message: &str) -> String {
    let mut text = String::with_capacity(message.len());
    let mut rest = message;
    while let Some(at) = rest.find("--") {
        let (before, after) = rest.split_at(at);
        let name: String = after[2..].chars().take_while(|c| c.is_ascii_lowercase() || *c == '-').collect();
        let word_before = before.chars().last().is_some_and(|c| c.is_alphanumeric() || c == '-');
        text.push_str(before);
        if name.is_empty() || name.starts_with('-') || word_before {
            text.push_str("--");
            rest = &after[2..];
            continue;
        }
        let name = name.trim_end_matches('-');
        rest = &after[2 + name.len()..];
        text.push_str(&name.replace('-', "_"));
        // A value follows.
        let value = rest.strip_prefix([' ', '=']).filter(|value| {
            value.starts_with(|c: char| c.is_ascii_digit() || c == '\'' || c.is_ascii_uppercase())
        });
        if let Some(value) = value {
            text.push('=');
            rest = value;
        }
    }
    text.push_str(rest);
    text
}
