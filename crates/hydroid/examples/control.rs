//! Controls a simulated boat along a circle with feedback linearization: `cargo run --release --example control`.
//!
//! The controller inverts a model with a wrong mass; the plant is the true vessel with sensor noise and a current.

use std::sync::Arc;

use hydroid::closed_loop::{
    Conditions, ControlMethod, ControllerOptions, Metrics, Scenario, SpeedOptions, Task, Track, run,
};
use hydroid::model::Model;
use hydroid::progress::silent;
use hydroid_core::craft::Craft;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let vessel = Craft::simple();
    let mut heavy = vessel.clone();
    heavy.hull.mass *= 1.2;

    let track = Track::new(&Task::Circle { radius: 10.0 }, &SpeedOptions::cruise(1.5))?;
    let scenario = Scenario::new(vessel, track);
    let mut options = ControllerOptions::new(ControlMethod::FeedbackLinearization, &scenario.plant, 0.1);
    options.model = Some(Arc::new(Model::of_vessel(&heavy, 0.1)?));
    options.lead = 1.0;
    let mut controller = options.controller(0)?;

    let conditions = Conditions { current: [0.1, 0.0], ..Conditions::calm(1) };
    let run = run(&scenario, &conditions, controller.as_mut(), &mut silent())?;

    // The first 40 s, in which the boat reaches the circle, do not count.
    let metrics = Metrics::of(&run, scenario.default_from_s());
    println!("RMS distance from the reference: {:.3} m", metrics.rms_position);
    println!("largest cross-track error: {:.3} m", metrics.max_cross_track);
    println!("status of the controller: {:?}", metrics.status);
    Ok(())
}
