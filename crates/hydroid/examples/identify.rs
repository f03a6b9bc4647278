//! Identifies sparse equations of a simulated boat and writes the model: `cargo run --release --example identify`.

use std::collections::BTreeMap;

use hydroid::excitation::Excitation;
use hydroid::identify::{
    Job, Method, MotionOption, NetworkTrainingOptions, RateLimitOption, SindyOptions, identify,
};
use hydroid::log::split_runs;
use hydroid::model::{self, Reading};
use hydroid::progress::silent;
use hydroid::simulate::{Options, simulate};
use hydroid_core::craft::Craft;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Twenty minutes under random commands, with the noise of the vessel's sensors.
    let options = Options { duration_s: 1_200.0, ..Options::new(Craft::simple(), Excitation::Mixed) };
    let run = simulate(&options, &mut silent())?.to_trajectory(&["u", "v", "r"])?;

    // Blocks of the run for training, validation and test.
    let job = Job {
        methods: vec![Method::Sindy],
        split: split_runs(vec![run])?,
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon: 100,
        origin_stride: 10,
        seed: 0,
        ranges: BTreeMap::default(),
        motion: MotionOption::default(),
        rate_limits: RateLimitOption::default(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions::default(),
        networks: NetworkTrainingOptions::default(),
        vessel: None,
    };
    let identified = identify(&job, &mut silent())?;
    let best = &identified.candidates[identified.best.ok_or("every model diverged")?];

    println!("NRMSE over 10 s on the test block: {:.3}", best.judged().score());
    for verdict in &identified.verdicts {
        println!("{}: {:?}", verdict.channel, verdict.grade);
    }
    model::write(&best.model, &std::env::temp_dir().join("boat.safetensors"))?;
    Ok(())
}
