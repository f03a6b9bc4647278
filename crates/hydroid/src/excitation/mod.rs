//! Command signals that make a vessel show how it moves.
//!
//! A [`Segment`] is one shape over some time (steps, zero, ramp, triangle, chirp, PRBS); a [`Signal`] is
//! segments one after the other, for one command; a [`Composer`] draws a signal from a seed. [`mixed`] and
//! [`low_speed`] draw both commands for a vessel, at a pace and within a range that follow from its own
//! parameters ([`Envelope`]), and [`held`] takes the commands that a user gives. What a run of the
//! simulation is driven by, open or closed loop, is an [`Excitation`].

mod compose;
mod envelope;
mod error;
mod kind;
mod prbs;
mod record;
mod segment;
mod streams;

pub use compose::Composer;
pub use envelope::Envelope;
pub use error::ExcitationError;
pub use kind::{Circle, Excitation, LawnMower, LowSpeed, Turn};
pub(crate) use record::low_speed_ceiling;
pub use record::{held, low_speed, low_speed_range, mixed};
pub use segment::{Segment, Shape, Signal};
pub(crate) use streams::{Purpose, stream};
