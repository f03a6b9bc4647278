//! Errors as exceptions of JavaScript.

use std::error::Error;

use serde::Serialize;
use serde::de::DeserializeOwned;
use wasm_bindgen::JsError;

/// The message of an error with its causes.
pub(crate) fn failed(error: impl Error) -> JsError {
    JsError::new(&message(&error))
}

/// An error and its causes in one line.
pub(crate) fn message(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let inner_text = inner.to_string();
        // Transparent errors repeat their cause.
        if !text.contains(&inner_text) {
            text.push_str(": ");
            text.push_str(&inner_text);
        }
        cause = inner.source();
    }
    text
}

pub(crate) fn from_json<T: DeserializeOwned>(text: &str) -> Result<T, JsError> {
    serde_json::from_str(text).map_err(failed)
}

pub(crate) fn to_json(value: &impl Serialize) -> Result<String, JsError> {
    serde_json::to_string(value).map_err(failed)
}
