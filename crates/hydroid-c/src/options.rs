//! Options of an adapter, as JSON over the defaults for a model.

use hydroid::adapt::Options;
use hydroid::model::Model;
use serde_json::Value as Json;
use toml::{Table, Value};

use crate::error::{Error, Outcome, Status};

fn invalid(message: impl std::fmt::Display) -> Error {
    Error::new(
        Status::Options,
        format!(
            "the options of the adapter are invalid: {message}; hydroid_model_adapter_options gives the defaults"
        ),
    )
}

/// Defaults for a model, with or without a guard.
fn defaults(model: &Model, guarded: bool) -> Options {
    let options = Options::of(model);
    if guarded { options.guarded(model) } else { options }
}

/// Defaults as JSON. What is infinite or not set is `null`.
pub(crate) fn text(model: &Model, guarded: bool) -> Outcome<String> {
    serde_json::to_string_pretty(&defaults(model, guarded)).map_err(invalid)
}

/// Options of a model: the defaults, JSON over them, and the standard deviations of the measurement noise of the outputs.
pub(crate) fn read(
    model: &Model,
    guarded: bool,
    json: Option<&str>,
    noise: Option<&[f64]>,
) -> Outcome<Options> {
    let defaults = defaults(model, guarded);
    let mut options = match json {
        Some(text) => over(&defaults, text, guarded)?,
        None => defaults,
    };
    if let Some(noise) = noise {
        options.kalman.noise = Some(noise.to_vec());
    }
    Ok(options)
}

fn over(defaults: &Options, text: &str, guarded: bool) -> Outcome<Options> {
    let given: Json = serde_json::from_str(text).map_err(|error| invalid(format!("no JSON: {error}")))?;
    if !guarded && given.get("guard").is_some_and(|guard| !guard.is_null()) {
        return Err(invalid("'guard' has options, and `guarded` is false: set it"));
    }
    // TOML has infinite numbers, and leaves out what is not set; JSON has `null` for both.
    let known = serde_json::to_value(defaults).map_err(invalid)?;
    let Value::Table(mut all) = Value::try_from(defaults).map_err(invalid)? else {
        return Err(invalid("the defaults are not a table"));
    };
    let Json::Object(given) = given else {
        return Err(invalid("an object is needed, as {\"method\": \"kalman\"}"));
    };
    merge(&mut all, &known, given, "")?;
    Value::Table(all).try_into().map_err(|error: toml::de::Error| invalid(error.message()))
}

fn merge(into: &mut Table, known: &Json, given: serde_json::Map<String, Json>, path: &str) -> Outcome {
    for (key, value) in given {
        let path = format!("{path}{key}");
        let Some(known) = known.get(&key) else {
            return Err(invalid(format!("there is no option '{path}'")));
        };
        match (value, into.get_mut(&key)) {
            (Json::Null, Some(Value::Float(number))) => *number = f64::INFINITY,
            (Json::Null, _) => drop(into.remove(&key)),
            (Json::Object(given), Some(Value::Table(table))) => {
                merge(table, known, given, &format!("{path}."))?;
            }
            (value, _) => drop(into.insert(key, number_or_text(value, &path)?)),
        }
    }
    Ok(())
}

/// A value of JSON as one of TOML.
fn number_or_text(value: Json, path: &str) -> Outcome<Value> {
    Ok(match value {
        Json::Null => return Err(invalid(format!("'{path}' contains null"))),
        Json::Bool(value) => Value::Boolean(value),
        Json::String(text) => Value::String(text),
        Json::Number(number) => match (number.as_i64(), number.as_f64()) {
            (Some(integer), _) => Value::Integer(integer),
            (None, Some(number)) => Value::Float(number),
            (None, None) => return Err(invalid(format!("'{path}' is too large"))),
        },
        Json::Array(values) => {
            let values = values.into_iter().map(|value| number_or_text(value, path));
            Value::Array(values.collect::<Outcome<_>>()?)
        }
        Json::Object(given) => {
            let given = given.into_iter().map(|(key, value)| {
                let value = number_or_text(value, &format!("{path}.{key}"))?;
                Ok((key, value))
            });
            Value::Table(given.collect::<Outcome<_>>()?)
        }
    })
}
