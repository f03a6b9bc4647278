//! Use outside the training data: identified from small commands, judged on large ones.

use hydroid::evaluate::{Options, evaluate};
use hydroid::excitation::{Excitation, PropellerRudder, mixed};
use hydroid::identify::{
    GivenRanges, Job, Method, MotionOption, NetworkTrainingOptions, RateLimitOption, SindyOptions, identify,
};
use hydroid::log::{Split, Trajectory};
use hydroid::model::{Model, Reading};
use hydroid::progress::silent;
use hydroid::simulate;
use hydroid_core::craft::Craft;
use hydroid_core::vessel::Command;

const DT: f64 = 0.1;

/// Ten minutes of mixed commands, whose deviations from their mean (rudder: from zero) are multiplied by `share`.
fn run(vessel: &Craft, seed: u64, share: f64) -> Trajectory {
    let commands = mixed(&PropellerRudder::new(vessel).unwrap(), seed, DT, 6_000).unwrap();
    let mean = commands.iter().map(|c| c.pp).sum::<f64>() / commands.len() as f64;
    let rows = commands.iter().enumerate().map(|(k, c)| {
        let command = Command { pp: mean + share * (c.pp - mean), rd: share * c.rd };
        (DT * k as f64, command)
    });
    let excitation = Excitation::Given(rows.collect());
    let options =
        simulate::Options { duration_s: 600.0, seed, ..simulate::Options::new(vessel.clone(), excitation) };
    simulate::simulate(&options, &mut silent()).unwrap().to_trajectory(&["u", "v", "r"]).unwrap()
}

#[test]
fn from_small_commands_to_large_ones_nothing_diverges_and_persistence_is_beaten() {
    for vessel in [Craft::simple(), Craft::hydrofoil_low_speed(), Craft::hydrofoil()] {
        let name = &vessel.name;
        let small = (0..3).map(|seed| run(&vessel, seed, 0.3)).collect();
        let large = run(&vessel, 9, 1.0);
        let job = Job {
            methods: vec![Method::Committee],
            split: Split { train: small, validation: Vec::new(), test: Vec::new(), notes: Vec::new() },
            reading: Reading::default(),
            boat: hydroid::boat::Boat::default(),
            horizon: 100,
            origin_stride: 20,
            seed: 0,
            ranges: GivenRanges::new(),
            networks: NetworkTrainingOptions::default(),
            vessel: None,
            motion: MotionOption::default(),
            rate_limits: RateLimitOption::default(),
            allow_feedback: Vec::new(),
            sindy: SindyOptions::default(),
        };
        let found = identify(&job, &mut silent()).unwrap();
        let model = &found.candidates[found.best.unwrap()].model;
        let options = Options { horizon: 100, origin_stride: 10, ..Options::default() };
        let judged = |model: &Model| {
            let ranges = model.output_ranges();
            evaluate(name, model.session().as_mut(), &ranges, &[&large], &options, &mut silent()).unwrap()
        };
        // The frozen form stays bounded, too; it cannot learn the other mode of the hydrofoil.
        assert_eq!(judged(&model.frozen()).diverged, 0, "{name}");
        let errors = judged(model);
        assert_eq!(errors.diverged, 0, "{name}");
        for h in [24, 49, 74, 99] {
            let mean = |row: &[f64]| row.iter().sum::<f64>() / 3.0;
            let (own, kept) = (mean(&errors.nrmse[h]), mean(&errors.persistence.nrmse[h]));
            assert!(own < kept, "{name}: {own} at {h}, persistence {kept}");
        }
    }
}
