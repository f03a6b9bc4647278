//! Evaluates a model with a wrong parameter on simulated logs: `cargo run --release --example evaluate`.
//!
//! From every tenth sample the model is rolled out for 10 s under the recorded commands and compared with the measurements.

use hydroid::evaluate::{self, evaluate};
use hydroid::excitation::Excitation;
use hydroid::model::Model;
use hydroid::progress::silent;
use hydroid::simulate::{Options, simulate};
use hydroid_core::craft::Craft;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let vessel = Craft::simple();
    let options = Options { duration_s: 600.0, ..Options::new(vessel.clone(), Excitation::Mixed) };
    let run = simulate(&options, &mut silent())?.to_trajectory(&["u", "v", "r"])?;

    let mut heavy = vessel;
    heavy.hull.mass *= 1.2;
    let model = Model::of_vessel(&heavy, run.dt)?;

    let options = evaluate::Options { horizon: 100, origin_stride: 10, ..Default::default() };
    let mut session = model.session();
    let found = evaluate(
        "20 % too heavy",
        session.as_mut(),
        &model.output_ranges(),
        &[&run],
        &options,
        &mut silent(),
    )?;

    println!("{} rollouts, {} diverged", found.windows, found.diverged);
    println!("{:>8} {:>10} {:>10} {:>10}  NRMSE (persistence)", "t [s]", "u", "v", "r");
    for horizon in [1, 10, 50, 100] {
        let Some(row) = found.at(horizon) else { continue };
        print!("{:8.1}", horizon as f64 * found.dt);
        for output in 0..found.channels.len() {
            print!(" {:4.2} ({:4.2})", found.nrmse[row][output], found.persistence.nrmse[row][output]);
        }
        println!();
    }
    Ok(())
}
