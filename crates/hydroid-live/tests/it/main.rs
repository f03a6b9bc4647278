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

/// Number of drawn streams in the slow tier, or that of `HYDROID_STREAMS`.
fn streams(usual: u32) -> u32 {
    std::env::var("HYDROID_STREAMS").map_or(usual, |text| text.parse().unwrap())
}
