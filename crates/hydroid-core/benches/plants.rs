//! Speed of the vessels of the thesis: a record of 72,000 samples with ten steps each.

use divan::{Bencher, black_box};
use hydroid_core::craft::{Craft, Dynamics};

fn main() {
    divan::main();
}

const PLANTS: [&str; 3] = ["simple", "hydrofoil", "hydrofoil_low_speed"];

fn craft(name: &str) -> Dynamics {
    Dynamics::new(&match name {
        "simple" => Craft::simple(),
        "hydrofoil" => Craft::hydrofoil(),
        _ => Craft::hydrofoil_low_speed(),
    })
}

#[divan::bench(args = PLANTS, sample_count = 10)]
fn steps_720_000(bencher: Bencher, name: &str) {
    let dynamics = craft(name);
    bencher.bench_local(|| {
        let (mut nu, mut positions) = ([0.0; 3], [0.0; 2]);
        for k in 0..72_000_u32 {
            let pp = if k / 200 % 2 == 0 { 240.0 } else { 40.0 };
            dynamics.advance(&mut nu, &mut positions, black_box(&[pp, 0.1]), 0.01, 10);
        }
        nu
    });
}
