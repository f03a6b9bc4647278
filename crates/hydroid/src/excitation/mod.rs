//! Excitation signals.
//!
//! A [`Segment`] is one shape (steps, zero, ramp, triangle, chirp, PRBS), a [`Signal`] a sequence of segments for one
//! command, and a [`Composer`] draws signals from a seed. [`mixed`] and [`low_speed`] draw both commands for a vessel,
//! with time scale and range from its parameters ([`Envelope`]); [`held`] takes given commands. An [`Excitation`]
//! drives a simulated run, in open or closed loop.

mod compose;
mod envelope;
mod error;
mod kind;
mod prbs;
mod record;
mod segment;
mod streams;
mod vessel;

pub use error::ExcitationError;
pub use kind::{Circle, Excitation, LawnMower, LowSpeed, Turn};
pub(crate) use record::low_speed_ceiling;
pub(crate) use streams::{Purpose, stream};
pub use vessel::PropellerRudder;
#[doc(hidden)]
pub use {
    compose::Composer,
    envelope::Envelope,
    record::{held, low_speed, low_speed_range, mixed},
    segment::{Segment, Shape, Signal},
};
