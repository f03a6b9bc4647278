//! Speed of the plants: one RK4 step, and a record of 72,000 samples with ten steps each.

use divan::{Bencher, black_box};
use hydroid_core::craft::{Craft, Dynamics};
use hydroid_core::vessel::{Command, Plant, State, VesselParams};

fn main() {
    divan::main();
}

/// The plant by its name: what stands in the table of results.
fn plant(name: &str) -> Plant {
    let params = match name {
        "simple" => VesselParams::simple(),
        "hydrofoil" => VesselParams::hydrofoil(),
        _ => VesselParams::hydrofoil_low_speed(),
    };
    Plant::new(&params).expect("the reference plants are valid")
}

const PLANTS: [&str; 3] = ["simple", "hydrofoil", "hydrofoil_low_speed"];

/// Near the transition, turning: nothing in it is zero.
const STATE: State = State { x: 3.0, y: -2.0, psi: 0.7, u: 2.4, v: -0.2, r: 0.15, p_f: 120.0 };

#[divan::bench(args = PLANTS, sample_size = 1_000)]
fn rk4_step(bencher: Bencher, name: &str) {
    let plant = plant(name);
    let command = Command { pp: 150.0, rd: 0.2 };
    bencher.bench_local(|| plant.advance(black_box(&STATE), black_box(&command), 0.01));
}

#[divan::bench(args = PLANTS, sample_count = 10)]
fn steps_720_000(bencher: Bencher, name: &str) {
    let plant = plant(name);
    bencher.bench_local(|| {
        let mut state = State::REST;
        for k in 0..72_000_u32 {
            // A slow alternation, so that the hydrofoil goes through both modes.
            let pp = if k / 200 % 2 == 0 { 240.0 } else { 40.0 };
            let actuation = plant.actuation(black_box(&Command { pp, rd: 0.1 }));
            for _ in 0..10 {
                state = plant.advance_under(&state, &actuation, 0.01);
            }
        }
        state
    });
}

fn craft(name: &str) -> Dynamics {
    Dynamics::new(&match name {
        "simple" => Craft::simple(),
        "hydrofoil" => Craft::hydrofoil(),
        _ => Craft::hydrofoil_low_speed(),
    })
}

#[divan::bench(args = PLANTS, sample_count = 10)]
fn craft_steps_720_000(bencher: Bencher, name: &str) {
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

/// The motion alone, as of a craft.
#[divan::bench(args = PLANTS, sample_count = 10)]
fn motion_steps_720_000(bencher: Bencher, name: &str) {
    let plant = plant(name);
    bencher.bench_local(|| {
        let mut motion = [0.0; 4];
        for k in 0..72_000_u32 {
            let pp = if k / 200 % 2 == 0 { 240.0 } else { 40.0 };
            let actuation = plant.actuation(black_box(&Command { pp, rd: 0.1 }));
            for _ in 0..10 {
                motion = plant.advance_motion(&motion, &actuation, 0.01);
            }
        }
        motion
    });
}
