//! Integration tests of the session on board, the live stream and the black box.

mod black_box;
mod boat;
mod campaign;
mod decorators;
mod experiment;
mod helm;
mod page;
mod port;
mod random_streams;
mod repaired;
mod simulated_boats;
mod stale_commands;
mod stream;
mod stream_parts;
mod through_water;
