//! A model that adapts to a live stream, the session on board of a vessel, and recordings of both.
//!
//! [`stream`] answers each line of a log that is being written with an estimate and a prediction. [`black_box`] records the
//! calls of an adapter in a ring file, from which [`black_box::replay`](fn@black_box::replay) computes the same results again.
//! [`boat`] is the session on board: it takes what the autopilot of a [`link`] reports, lets models follow the vessel, runs
//! [experiments](experiment), steers, [records](record), and shows all of it on a [`page`].

#![allow(missing_docs, clippy::missing_errors_doc, reason = "its users are the programs of hydroid")]

mod axis;
pub mod black_box;
pub mod boat;
pub mod experiment;
pub mod link;
pub mod page;
#[cfg(feature = "program")]
pub mod program;
pub mod record;
pub mod stream;

pub use axis::Axis;
