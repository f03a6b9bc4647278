//! The model in the resources of an FMU.

use std::path::{Path, PathBuf};

use hydroid::model::{Model, decode};
use hydroid_export::fmu::{MODEL_FILE, SAMPLE_TIME_FILE, VESSEL_FILE, Variables, identity, token};

/// Largest model file \[bytes\].
const LARGEST: u64 = 1 << 30;

/// A model with its variables.
#[derive(Debug)]
pub(crate) struct Resource {
    pub(crate) model: Model,
    pub(crate) variables: Variables,
    /// Fingerprint of the resources.
    pub(crate) token: u64,
}

/// The folder that a path or a URI of the scheme `file` names.
fn folder(location: &str) -> Result<PathBuf, String> {
    let Some(rest) = location.strip_prefix("file:") else { return Ok(PathBuf::from(location)) };
    let path = match rest.strip_prefix("//") {
        Some(rest) => rest.strip_prefix("localhost").unwrap_or(rest),
        None => rest,
    };
    let mut bytes = Vec::with_capacity(path.len());
    let mut rest = path.as_bytes();
    while let [first, others @ ..] = rest {
        let escaped = match (first, others) {
            (b'%', [high, low, ..]) => {
                let digit = |byte: &u8| char::from(*byte).to_digit(16);
                digit(high).zip(digit(low)).and_then(|(high, low)| u8::try_from(16 * high + low).ok())
            }
            _ => None,
        };
        bytes.push(escaped.unwrap_or(*first));
        rest = if escaped.is_some() { &others[2..] } else { others };
    }
    let path = String::from_utf8(bytes).map_err(|_| format!("the location {location} is not UTF-8"))?;
    // The path of a drive of Windows follows a slash.
    let drive = matches!(path.as_bytes(), [b'/', letter, b':', ..] if letter.is_ascii_alphabetic());
    Ok(PathBuf::from(if drive { &path[1..] } else { &path }))
}

const REMEDY: &str = "export the model again with `hydroid export`";

fn read(path: &Path) -> Result<Vec<u8>, String> {
    let told = |error: std::io::Error| format!("cannot read {}: {error}; {REMEDY}", path.display());
    let size = std::fs::metadata(path).map_err(told)?.len();
    if size > LARGEST {
        return Err(format!("{} is too large for a model ({size} bytes); {REMEDY}", path.display()));
    }
    std::fs::read(path).map_err(told)
}

impl Resource {
    /// Reads the model from the folder `resources`; `expected` is the token of the model description.
    pub(crate) fn load(location: &str, expected: &str) -> Result<Self, String> {
        let folder = folder(location)?;
        let vessel = folder.join(VESSEL_FILE);
        let path = if vessel.is_file() { vessel } else { folder.join(MODEL_FILE) };
        let content = read(&path)?;
        let time = folder.join(SAMPLE_TIME_FILE);
        let text = read(&time)?;
        let dt: f64 = std::str::from_utf8(&text)
            .ok()
            .and_then(|text| text.trim().parse().ok())
            .filter(|dt: &f64| dt.is_finite() && *dt > 0.0)
            .ok_or_else(|| format!("{} contains no sample time; {REMEDY}", time.display()))?;
        let token = token(&content, dt);
        if identity(token) != expected {
            return Err(format!(
                "{} and {} are not those of the model description, or they are damaged; {REMEDY}",
                path.display(),
                time.display()
            ));
        }
        let model = decode(&content, &path).map_err(|error| error.to_string())?;
        let model = model.at_step(dt).map_err(|error| error.to_string())?;
        if model.description.dt.to_bits() != dt.to_bits() {
            return Err(format!("{} is not the sample time of the model; {REMEDY}", time.display()));
        }
        Ok(Self { variables: Variables::of(&model), model, token })
    }
}
