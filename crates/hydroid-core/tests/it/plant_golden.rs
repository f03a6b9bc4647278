//! The plants compared with an independent implementation (NumPy): files under `/tests/golden`.

use hydroid_core::craft::{Craft, Dynamics};
use hydroid_core::vessel::{Command, Plant, State, VesselParams};

fn rows(file: &str) -> Vec<Vec<String>> {
    let path = format!("{}/../../tests/golden/{file}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

fn numbers(cells: &[String]) -> Vec<f64> {
    cells.iter().map(|cell| cell.parse().expect("a number")).collect()
}

fn params(plant: &str) -> VesselParams {
    match plant {
        "simple" => VesselParams::simple(),
        "hydrofoil" => VesselParams::hydrofoil(),
        "hydrofoil_low_speed_model" => VesselParams::hydrofoil_low_speed(),
        _ => panic!("no plant {plant}"),
    }
}

/// Largest absolute difference over a golden trajectory, ten 10 ms steps per command.
fn worst_difference(plant_name: &str) -> f64 {
    let plant = Plant::new(&params(plant_name)).expect("reference plants are valid");
    let mut state = State::REST;
    let mut worst = 0.0_f64;
    for row in rows(&format!("golden_{plant_name}.csv")) {
        let row = numbers(&row);
        let simulated: [f64; State::LEN] = state.into();
        for (ours, theirs) in simulated.iter().zip(&row[3..]) {
            worst = worst.max((ours - theirs).abs());
        }
        let actuation = plant.actuation(&Command { pp: row[1], rd: row[2] });
        for _ in 0..10 {
            state = plant.advance_under(&state, &actuation, 0.01);
        }
    }
    worst
}

#[test]
fn trajectories_match() {
    for plant in ["simple", "hydrofoil", "hydrofoil_low_speed_model"] {
        let worst = worst_difference(plant);
        println!("{plant}: largest difference {worst:.2e}");
        assert!(worst < 1e-11, "{plant}: {worst:e}");
    }
}

#[test]
fn derivatives_match() {
    let rows = rows("golden_derivatives.csv");
    assert!(rows.len() >= 48, "16 states for each of three plants");
    for row in rows {
        let plant = Plant::new(&params(&row[0])).expect("reference plants are valid");
        let n = numbers(&row[1..]);
        let state = State { x: 0.0, y: 0.0, psi: n[2], u: n[3], v: n[4], r: n[5], p_f: n[6] };
        let ours: [f64; State::LEN] = plant.derivative(&state, &Command { pp: n[0], rd: n[1] }).into();
        for (i, (ours, theirs)) in ours.iter().zip(&n[7..]).enumerate() {
            // 1e-12 absolute also suits dP_f/dt of some 100 N/s: its rounding is 3e-14.
            assert!((ours - theirs).abs() < 1e-12, "{}: component {i}: {ours} and {theirs}", row[0]);
        }
    }
}

fn craft(plant: &str) -> Craft {
    match plant {
        "simple" => Craft::simple(),
        "hydrofoil" => Craft::hydrofoil(),
        "hydrofoil_low_speed_model" => Craft::hydrofoil_low_speed(),
        _ => panic!("no craft {plant}"),
    }
}

/// The lag of the propeller is exact in a craft, and integrated by the Runge-Kutta method in the reference. The largest
/// difference is 1.6e-9 of the range, of the yaw rate in the take-off of the hydrofoil.
#[test]
fn trajectories_of_crafts_match() {
    for name in ["simple", "hydrofoil", "hydrofoil_low_speed_model"] {
        let craft = craft(name);
        craft.validate().expect("reference vessels are valid");
        let dynamics = Dynamics::new(&craft);
        let (mut nu, mut positions) = ([0.0; 3], [0.0; 2]);
        let mut worst = [0.0_f64; 4];
        let mut largest = [0.0_f64; 4];
        for row in rows(&format!("golden_{name}.csv")) {
            let row = numbers(&row);
            let ours = [nu[0], nu[1], nu[2], positions[0]];
            for i in 0..4 {
                worst[i] = worst[i].max((ours[i] - row[6 + i]).abs());
                largest[i] = largest[i].max(row[6 + i].abs());
            }
            dynamics.advance(&mut nu, &mut positions, &[row[1], row[2]], 0.01, 10);
        }
        for i in 0..4 {
            assert!(worst[i] < 2e-9 * largest[i], "{name}: {worst:?} of {largest:?}");
        }
    }
}

#[test]
fn derivatives_of_crafts_match() {
    for row in rows("golden_derivatives.csv") {
        let dynamics = Dynamics::new(&craft(&row[0]));
        let n = numbers(&row[1..]);
        let ours = dynamics.acceleration([n[3], n[4], n[5]], &[n[6], n[1]]);
        for (i, (ours, theirs)) in ours.iter().zip(&n[10..13]).enumerate() {
            assert!((ours - theirs).abs() < 1e-12, "{}: component {i}: {ours} and {theirs}", row[0]);
        }
    }
}
