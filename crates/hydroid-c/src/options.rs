//! Options of an adapter: the section `[adapt]` of a configuration file.

use std::path::Path;

use hydroid::adapt::Options;
use hydroid::config::Adapt;
use hydroid::model::Model;
use hydroid::toml_file;

use crate::error::{Error, Outcome, Status};

/// Options of a model: the defaults, the lines of the section over them, and the standard deviations of the measurement noise
/// of the outputs.
pub(crate) fn read(
    model: &Model,
    guarded: bool,
    section: Option<&str>,
    noise: Option<&[f64]>,
) -> Outcome<Options> {
    let invalid = |message: String| {
        Error::new(Status::Options, format!("the options of the adapter are invalid: {message}"))
    };
    let section = toml_file::parse(section.unwrap_or_default(), Path::new("options"));
    let mut given: Adapt = section.map_err(|error| invalid(error.to_string()))?;
    given.no_guard |= !guarded;
    let mut options = given.options(model).map_err(|error| invalid(error.to_string()))?;
    if let Some(noise) = noise {
        options.kalman.noise = Some(noise.to_vec());
    }
    Ok(options)
}
