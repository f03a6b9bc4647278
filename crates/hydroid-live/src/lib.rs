//! A model that adapts to a live stream, and the recording of its last minutes.
//!
//! [`stream`] answers each line of a log that is being written with an estimate and a prediction. [`black_box`] records the
//! calls of an adapter in a ring file, from which [`black_box::replay`](fn@black_box::replay) computes the same results again.

pub mod black_box;
pub mod stream;
