//! The reader of way-points on arbitrary bytes: `cargo +nightly fuzz run waypoints`.
#![no_main]

use hydroid::closed_loop::Waypoints;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(route) = Waypoints::parse(bytes, "fuzz.gpx") {
        assert!(route.points.iter().flatten().all(|number| number.is_finite()));
    }
});
