//! Turning circles of 600 s: `cargo bench -p hydroid --bench manoeuvre`.

use std::path::Path;
use std::sync::OnceLock;

use divan::Bencher;
use hydroid::craft::parse;
use hydroid::excitation::Excitation;
use hydroid::identify::{
    GivenRanges, Job, Method, MotionOption, NetworkTrainingOptions, RateLimitOption, SindyOptions, identify,
};
use hydroid::log::split_runs;
use hydroid::model::{Model, Reading};
use hydroid::plant::{InputMap, Simulation};
use hydroid::progress::silent;
use hydroid::simulate::{Options, simulate};
use hydroid_core::craft::Craft;

fn main() {
    divan::main();
}

const DURATION_S: f64 = 600.0;

/// Equations of the hydrofoil with an ensemble of 50 members, and a committee.
fn identified() -> &'static [Model] {
    static MODELS: OnceLock<Vec<Model>> = OnceLock::new();
    MODELS.get_or_init(|| {
        let options = Options { duration_s: 1_200.0, ..Options::new(Craft::hydrofoil(), Excitation::Mixed) };
        let run = simulate(&options, &mut silent()).unwrap().to_trajectory(&["u", "v", "r"]).unwrap();
        let job = Job {
            methods: vec![Method::Sindy, Method::Committee],
            split: split_runs(vec![run]).unwrap(),
            reading: Reading::default(),
            boat: hydroid::boat::Boat::default(),
            horizon: 100,
            origin_stride: 10,
            seed: 0,
            ranges: GivenRanges::default(),
            motion: MotionOption::default(),
            rate_limits: RateLimitOption::default(),
            allow_feedback: Vec::new(),
            sindy: SindyOptions { members: Some(50), ..SindyOptions::default() },
            networks: NetworkTrainingOptions::default(),
            vessel: None,
        };
        identify(&job, &mut silent()).unwrap().candidates.into_iter().map(|c| c.model).collect()
    })
}

fn circle(simulation: &mut Simulation, model: &Model, map: &InputMap) -> [f64; 3] {
    let start: Vec<f64> =
        model.description.outputs.iter().map(|port| 0.5 * port.range.high.max(0.0)).collect();
    simulation.start([0.0; 3], &start, &map.command(0.5, 0.0));
    let command = map.command(0.5, 0.5);
    let mut t = 0.0;
    while t < DURATION_S {
        simulation.advance(&command);
        t += simulation.dt();
    }
    simulation.eta()
}

fn bench(bencher: Bencher, model: &Model) {
    let (map, mut simulation) = (InputMap::find(model).unwrap(), Simulation::new(model).unwrap());
    bencher.bench_local(|| circle(&mut simulation, model, &map));
}

fn bench_members(bencher: Bencher, model: &Model) {
    let (map, mut members) = (InputMap::find(model).unwrap(), Simulation::of_members(model).unwrap());
    println!("{} members", members.len());
    bencher.bench_local(|| members.iter_mut().map(|member| circle(member, model, &map)[0]).sum::<f64>());
}

#[divan::bench(sample_count = 20)]
fn equations(bencher: Bencher) {
    bench(bencher, &identified()[0]);
}

#[divan::bench(sample_count = 5)]
fn members_of_equations(bencher: Bencher) {
    bench_members(bencher, &identified()[0]);
}

#[divan::bench(sample_count = 20)]
fn committee(bencher: Bencher) {
    bench(bencher, &identified()[1]);
}

#[divan::bench(sample_count = 20, args = ["otter", "mariner", "tug"])]
fn vessel_file(bencher: Bencher, name: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../vessels/{name}.toml"));
    let file = parse(&std::fs::read_to_string(&path).unwrap(), &path).unwrap();
    bench(bencher, &Model::of_craft(&file, 0.1).unwrap());
}
