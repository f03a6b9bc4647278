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

/// Number of drawn streams in the slow tier: 10,000, or that of `HYDROID_STREAMS`.
fn streams() -> u32 {
    std::env::var("HYDROID_STREAMS").map_or(10_000, |text| text.parse().unwrap())
}
