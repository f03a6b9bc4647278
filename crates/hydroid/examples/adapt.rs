//! Adapts the parameters of a boat along a simulated log: `cargo run --release --example adapt`.
//!
//! The fouled hull has 30 % more drag in surge than the model. The adapted model is compared with the frozen one on the same samples.

use hydroid::adapt::{Options, adapt};
use hydroid::excitation::Excitation;
use hydroid::model::Model;
use hydroid::progress::silent;
use hydroid::simulate::{self, simulate};
use hydroid_core::craft::Craft;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let nominal = Craft::simple();
    let mut fouled = nominal.clone();
    fouled.hull.linear[0][0] *= 1.3;
    fouled.hull.quadratic[0][0] *= 1.3;

    let options =
        simulate::Options { duration_s: 600.0, ..simulate::Options::new(fouled, Excitation::Mixed) };
    let run = simulate(&options, &mut silent())?.to_trajectory(&["u", "v", "r"])?;

    let model = Model::of_vessel(&nominal, run.dt)?;
    // With the guard the adapted model predicts only while it is better than the reference model.
    let options = Options::of(&model).guarded(&model);
    let adapted = adapt(&model, &[&run], &options, &mut silent())?;

    let report = &adapted.report;
    println!("NRMSE: frozen {:.3}, adapted {:.3}", report.frozen.score(), report.adapted.score());
    for parameter in &report.parameters {
        println!("{:<28} {:>10.4} -> {:>10.4}", parameter.path, parameter.given, parameter.learned);
    }
    Ok(())
}
