//! hydroid on shore: makes and reads logs, learns models from them and judges them.
//!
//! The modules in the order of dependence: [`log`] knows nothing of the others; [`excitation`] makes
//! commands and [`simulate`] turns them into logs; [`evaluate`] judges any model; [`sindy`] finds equations;
//! [`model`] is what was found, and its file; [`identify`] is the whole way from runs to a judged model.

pub mod adapt;
pub mod atomic;
pub mod closed_loop;
pub mod evaluate;
pub mod excitation;
pub mod faults;
pub mod fnv;
pub mod identify;
pub mod log;
pub mod model;
pub mod progress;
pub mod simulate;
pub mod sindy;
pub mod toml_file;
pub mod train;

/// The examples of the page on the Rust API.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/rust-api.md")]
struct RustApiPage;
