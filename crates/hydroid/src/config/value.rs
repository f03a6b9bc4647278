//! Values of options as text: numbers separated by commas, points by semicolons, `NAME=VALUE`.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::str::FromStr;

use serde::{Deserialize, Deserializer};

use crate::written;

/// `N` numbers: `1,2`.
///
/// # Errors
/// If the text is something else.
pub fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let wrong = || format!("'{text}' is not {N} numbers separated by commas");
    let all: Vec<f64> =
        text.split(',').map(|part| part.trim().parse()).collect::<Result<_, _>>().map_err(|_| wrong())?;
    match <[f64; N]>::try_from(all) {
        Ok(all) if all.iter().all(|x| !x.is_nan()) => Ok(all),
        _ => Err(wrong()),
    }
}

/// Points: `0,0;40,0`.
///
/// # Errors
/// If the text is something else.
pub fn points(text: &str) -> Result<Vec<[f64; 2]>, String> {
    let points = text.split(';').filter(|part| !part.trim().is_empty()).map(numbers);
    let points: Result<_, String> = points.collect();
    points.map_err(|why| format!("{why}: write points as NORTH,EAST;NORTH,EAST;.."))
}

/// A value and its channel: `u=0.01`, `u=0:12 [kn]`.
///
/// # Errors
/// If the text is something else.
pub fn named<T: FromStr<Err: Display>>(text: &str) -> Result<(String, T), String> {
    let (name, value) = text.split_once('=').ok_or_else(|| format!("'{text}' is not NAME=VALUE"))?;
    let value = value.trim().parse().map_err(|error| format!("{}: {error}", name.trim()))?;
    Ok((name.trim().to_owned(), value))
}

/// Values by name; the last one of a name counts.
pub fn by_name<T: Clone>(all: &[(String, T)]) -> BTreeMap<String, T> {
    all.iter().cloned().collect()
}

/// Reads numbers, or `1,2`.
pub(crate) fn read_numbers<'de, D, const N: usize>(deserializer: D) -> Result<Option<[f64; N]>, D::Error>
where
    D: Deserializer<'de>,
    [f64; N]: Deserialize<'de>,
{
    written::parsed(deserializer, numbers).map(Some)
}

/// Reads points, or `0,0;40,0`.
pub(crate) fn read_points<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<Vec<[f64; 2]>>, D::Error> {
    written::parsed(deserializer, points).map(Some)
}
