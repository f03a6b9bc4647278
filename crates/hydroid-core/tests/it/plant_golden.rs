//! The vessels of the thesis compared with an independent implementation (NumPy): files under `/tests/golden`.

use hydroid_core::craft::{Craft, Dynamics};

fn rows(file: &str) -> Vec<Vec<String>> {
    let path = format!("{}/../../tests/golden/{file}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

fn numbers(cells: &[String]) -> Vec<f64> {
    cells.iter().map(|cell| cell.parse().expect("a number")).collect()
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
fn trajectories_match() {
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
fn derivatives_match() {
    let rows = rows("golden_derivatives.csv");
    assert!(rows.len() >= 48, "16 states for each of three plants");
    for row in rows {
        let dynamics = Dynamics::new(&craft(&row[0]));
        let n = numbers(&row[1..]);
        let ours = dynamics.acceleration([n[3], n[4], n[5]], &[n[6], n[1]]);
        for (i, (ours, theirs)) in ours.iter().zip(&n[10..13]).enumerate() {
            assert!((ours - theirs).abs() < 1e-12, "{}: component {i}: {ours} and {theirs}", row[0]);
        }
    }
}
