//! FMUs: models as components of a co-simulation or an integrator, by the Functional Mock-up Interface (FMI) 2.0 and 3.0 of
//! the Modelica Association.
//!
//! An FMU is a ZIP archive with a description of its variables, the model file, and a compiled library for each platform. The
//! library is the same for all models: `hydroid-fmu`, which reads the model of the archive. No compiler is needed.

mod continuous;
mod library;
mod units;
mod variables;
mod xml;

use std::io::{Cursor, Write};
use std::path::PathBuf;

use hydroid::model::{Model, encode};
use xxhash_rust::xxh3::Xxh3;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use crate::{ExportError, File, Options};

pub use continuous::{Continuous, Directional, Hidden};
pub use library::{LIBRARY_VARIABLE, Platform, find as find_library};
pub use variables::{Role, Variable, Variables};

/// Text that a library of this version contains.
pub const MARK: &str = concat!("hydroid-fmu ", env!("CARGO_PKG_VERSION"), " resources 1");

/// File of the model in the resources, identified.
pub const MODEL_FILE: &str = "model.safetensors";
/// File of the model in the resources, a vessel.
pub const VESSEL_FILE: &str = "model.toml";
/// File of the sample time \[s\] in the resources, in decimal digits: a vessel file has none.
pub const SAMPLE_TIME_FILE: &str = "sample_time_s.txt";

/// Version of the interface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Version {
    V2,
    #[default]
    V3,
}

/// Options of an FMU.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FmuOptions {
    /// Version of the interface.
    pub version: Version,
    /// Libraries of `hydroid-fmu`, at most one for each platform; the one of this computer if empty ([`find_library`]).
    pub libraries: Vec<PathBuf>,
}

/// Reasons why no FMU can be written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FmuError {
    #[error(
        "the library of the FMU is neither in {} nor in ../lib of it: build it with `cargo build --release -p hydroid-fmu`, and name it by the environment variable {LIBRARY_VARIABLE}",
        folder.display()
    )]
    NoLibrary { folder: PathBuf },
    #[error("cannot read the library {}: {reason}; build it with `cargo build --release -p hydroid-fmu`", path.display())]
    Read { path: PathBuf, reason: String },
    #[error(
        "{} is not a library for Linux, macOS or Windows with 64 bits (x86-64 or aarch64): build it with `cargo build --release -p hydroid-fmu`; take a universal library of macOS apart with `lipo -thin`",
        path.display()
    )]
    Platform { path: PathBuf },
    #[error(
        "{} is not the library hydroid-fmu of this version ({}): build it with `cargo build --release -p hydroid-fmu`",
        path.display(), env!("CARGO_PKG_VERSION")
    )]
    Version { path: PathBuf },
    #[error("{} is the second library for {platform}: name one for each platform", path.display())]
    Twice { path: PathBuf, platform: &'static str },
    #[error("the FMU cannot be written: {0}")]
    Archive(String),
}

fn broken(error: impl std::fmt::Display) -> FmuError {
    FmuError::Archive(error.to_string())
}

/// Fingerprint of the resources; in the description as [`identity`].
pub fn token(model: &[u8], dt: f64) -> u64 {
    let mut hash = Xxh3::new();
    hash.update(model);
    hash.update(&dt.to_bits().to_le_bytes());
    hash.digest()
}

/// A fingerprint as text.
pub fn identity(token: u64) -> String {
    format!("hydroid-{token:016x}")
}

/// Writes a model as an FMU, `NAME.fmu`, with co-simulation, and with model exchange for a model in continuous time ([`Continuous`]).
/// Equal models and libraries give equal bytes.
pub fn export(model: &Model, options: &Options, fmu: &FmuOptions) -> Result<Vec<File>, ExportError> {
    let name = crate::identifier(&options.name);
    Ok(vec![File { name: format!("{name}.fmu"), content: archive(model, &name, fmu)? }])
}

fn archive(model: &Model, name: &str, fmu: &FmuOptions) -> Result<Vec<u8>, FmuError> {
    let paths = if fmu.libraries.is_empty() { vec![find_library()?] } else { fmu.libraries.clone() };
    let content = encode(model).map_err(broken)?;
    let dt = model.description.dt;
    let variables = Variables::of(model);
    let head = xml::Head { version: fmu.version, name, title: model.title(), token: token(&content, dt), dt };
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let file = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut put = |path: &str, content: &[u8], options: SimpleFileOptions| {
        zip.start_file(path, options).map_err(broken)?;
        zip.write_all(content).map_err(broken)
    };
    put("modelDescription.xml", &xml::describe(head, &variables), file)?;
    let resource = if model.is_vessel() { VESSEL_FILE } else { MODEL_FILE };
    put(&format!("resources/{resource}"), &content, file)?;
    put(&format!("resources/{SAMPLE_TIME_FILE}"), format!("{dt:?}\n").as_bytes(), file)?;
    put("documentation/index.html", documentation(name, model, &variables).as_bytes(), file)?;
    let mut platforms = Vec::new();
    for path in paths {
        let (platform, library) = library::read(&path)?;
        let folder = platform.folder(fmu.version);
        if platforms.contains(&folder) {
            return Err(FmuError::Twice { path, platform: folder });
        }
        platforms.push(folder);
        let executable = file.unix_permissions(0o755);
        put(&format!("binaries/{folder}/{name}{}", platform.extension), &library, executable)?;
    }
    Ok(zip.finish().map_err(broken)?.into_inner())
}

/// The page of the FMU.
fn documentation(name: &str, model: &Model, variables: &Variables) -> String {
    let exchange = match variables.continuous() {
        Ok(_) => String::from("Co-simulation and model exchange."),
        Err(reason) => format!("Co-simulation; no model exchange, because {reason}."),
    };
    let title = crate::name::comment(model.title());
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{name}</title></head><body>\n\
         <h1>{name}</h1>\n<p>{title}. {exchange}</p>\n\
         <p>Samples of {:?} s; inputs are averaged over each sample, and outputs between two samples are interpolated. \
         Positions are north and east in metres, angles are in radians and clockwise from north.</p>\n\
         </body></html>\n",
        model.description.dt
    )
}
