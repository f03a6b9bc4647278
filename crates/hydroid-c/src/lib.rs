//! hydroid as a C library: models as they are read, sessions that predict, adapters that learn, and simulations.
//!
//! The header `include/hydroid.h` is generated from the documentation of [`interface`], which states the rules for
//! arrays, memory, threads and errors. Names are those of the Rust API: `hydroid_session_advance` is
//! `Predictor::advance`.
//!
//! A session and an adapter are handles of one type, because an adapter does all that a session does: a program that
//! follows a run has one code path, and replaces one by the other. Functions of learning return an error for a session that
//! does not learn.
//!
//! A handle is an address. The state behind it has a lock, so that calls of several threads wait for each other, and a
//! panic, which becomes an error, marks the state as unusable.
//!
//! Order of the modules, bottom to top: `error`, `options`, `session`, `learning`, `simulation`, `model`, `interface`.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "units in brackets: the comments of the header are for readers of C"
)]
#![expect(clippy::doc_markdown, reason = "the comments of the header are for readers of C")]

mod error;
pub mod interface;
mod learning;
mod model;
mod options;
mod session;
mod simulation;

pub use error::Status;
pub use session::Session;
