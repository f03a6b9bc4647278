//! Speed of the thesis's record: 7,200 s, 72,000 samples, 720,000 integration steps.

use std::ops::ControlFlow;

use divan::Bencher;
use hydroid::excitation::{Excitation, LawnMower, LowSpeed};
use hydroid::simulate::{Options, Simulated, simulate};
use hydroid_core::craft::Craft;

fn main() {
    divan::main();
}

fn excitation(name: &str) -> Excitation {
    match name {
        "mixed" => Excitation::Mixed,
        "low-speed" => Excitation::LowSpeed(LowSpeed::default()),
        _ => Excitation::LawnMower(LawnMower::default()),
    }
}

fn run(vessel: Craft, excitation: Excitation) -> Simulated {
    simulate(&Options::new(vessel, excitation), &mut |_| ControlFlow::Continue(()))
        .expect("a reference plant")
}

#[divan::bench(args = ["mixed", "low-speed", "lawn-mower"], sample_count = 10)]
fn hydrofoil_record(bencher: Bencher, name: &str) {
    bencher.bench_local(|| run(Craft::hydrofoil(), excitation(name)));
}

#[divan::bench(sample_count = 10)]
fn simple_record(bencher: Bencher) {
    bencher.bench_local(|| run(Craft::simple(), Excitation::Mixed));
}

#[divan::bench(sample_count = 10)]
fn csv(bencher: Bencher) {
    let record = run(Craft::hydrofoil(), Excitation::Mixed);
    bencher.bench_local(|| {
        let mut bytes = Vec::new();
        record.write_csv(&mut bytes).expect("memory does not fail");
        bytes.len()
    });
}

#[divan::bench(sample_count = 10)]
fn to_trajectory(bencher: Bencher) {
    let record = run(Craft::hydrofoil(), Excitation::Mixed);
    bencher.bench_local(|| record.to_trajectory(&["u", "v", "r"]));
}
