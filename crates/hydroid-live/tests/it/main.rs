//! Integration tests of the live stream and the black box.

mod black_box;
mod boat;
mod random_streams;
mod repaired;
mod stream;
mod stream_parts;
mod through_water;
