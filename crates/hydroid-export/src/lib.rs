//! Models in the formats of other tools.
//!
//! [`export`] writes a [`Model`] in a [`Format`]. The result is a set of files in memory; the caller stores them.
//!
//! Order of the modules, bottom to top: `name`, `graph`, `state_space`, `adapter`, `check`, `json`, `c`, `onnx`,
//! `casadi`, `coefficients`, `fmu`.

#![allow(missing_docs, clippy::missing_errors_doc, reason = "its users are the programs of hydroid")]

mod adapter;
mod c;
mod casadi;
#[doc(hidden)]
pub mod check;
pub mod coefficients;
pub mod fmu;
mod graph;
mod json;
mod name;
mod onnx;
mod state_space;

use hydroid::model::Model;

use coefficients::CoefficientOptions;

pub use c::{COptions, Precision};
pub use name::identifier;

/// A format of another tool.
#[derive(Clone, Debug, PartialEq)]
pub enum Format {
    /// C99: a header and a source.
    C(COptions),
    /// A Python file that builds functions of the Python package `casadi`.
    Casadi,
    /// ONNX: a file for each function.
    Onnx(Precision),
    /// Functional mock-up unit: see [`fmu`].
    Fmu(fmu::FmuOptions),
    /// Plugins of Gazebo: [`coefficients::sdf`].
    Sdf(CoefficientOptions),
    /// Vessels of MSS and the Python Vehicle Simulator: [`coefficients::mss`].
    Mss,
    /// Tables of hydrodynamic derivatives: [`coefficients::latex`].
    Latex(CoefficientOptions),
}

/// Options of an export.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Name of the exported model: of files, functions and classes. See [`identifier`].
    pub name: String,
}

/// A file of an export.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File {
    /// Its name, without a folder.
    pub name: String,
    pub content: Vec<u8>,
}

/// Reasons why a model cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    #[error("{model} cannot be exported to {format}: {reason}; {remedy}")]
    Unsupported { model: &'static str, format: &'static str, reason: String, remedy: String },
    #[error(transparent)]
    Adapt(#[from] hydroid::adapt::AdaptError),
    #[error(transparent)]
    Fmu(#[from] fmu::FmuError),
}

/// Writes a model in a format.
pub fn export(model: &Model, format: &Format, options: &Options) -> Result<Vec<File>, ExportError> {
    match format {
        Format::C(numbers) => c::export(model, options, numbers),
        Format::Casadi => Ok(casadi::export(model, options)),
        Format::Onnx(precision) => Ok(onnx::export(model, options, *precision)),
        Format::Fmu(fmu) => fmu::export(model, options, fmu),
        Format::Sdf(numbers) => coefficients::sdf(model, options, numbers),
        Format::Mss => coefficients::mss(model, options),
        Format::Latex(numbers) => coefficients::latex(model, options, numbers),
    }
}

/// The functions of a model with constant weights as JSON, for a page: start in a steady motion, a sample, and outputs.
pub fn functions(model: &Model) -> serde_json::Value {
    json::functions(model)
}
