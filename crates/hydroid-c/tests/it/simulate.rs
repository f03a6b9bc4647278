//! Simulations in C, against the Rust API to the last bit.

use hydroid::model::{Model, write};
use hydroid::plant::Simulation;
use tempfile::TempDir;

use crate::along::{model, same};
use crate::program::{GCC, Program, sources};

fn simulated(model: &Model) -> Vec<f64> {
    let mut simulation = Simulation::new(model).unwrap().with_current([0.2, -0.1]);
    let (n, m) = (model.description.outputs.len(), model.description.inputs.len());
    let y: Vec<f64> = (0..n).map(|i| 0.1 * i as f64 + 0.2).collect();
    simulation.start([10.0, -20.0, 1.0], &y, &vec![0.0; m]);
    let mut results = Vec::new();
    for k in 0..300 {
        let c: Vec<f64> = (0..m).map(|i| 0.01 * ((k * (i + 1)) % 37) as f64).collect();
        simulation.advance(&c);
        results.extend(simulation.outputs());
        results.extend(simulation.eta());
        results.extend(simulation.nu_over_ground());
    }
    results
}

#[test]
fn simulations_in_c_are_those_of_rust() {
    let program = Program::of(&GCC, &sources().join("simulate.c"));
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    for (name, dt) in [
        ("otter", Some(0.02)),
        ("mariner", None),
        ("hydrofoil", Some(0.05)),
        ("committee", None),
        ("gru on equations", None),
        ("equations behind a limit of the rate", None),
    ] {
        let model = model(name);
        write(&model, &path("model")).unwrap();
        let model = match dt {
            Some(dt) => model.at_step(dt).unwrap(),
            None => model,
        };
        let text = format!("{:?}", dt.unwrap_or(0.0));
        program.run(&[path("model").to_str().unwrap(), &text, path("results").to_str().unwrap()]);
        let found = crate::along::numbers(&path("results"));
        let expected = simulated(&model);
        assert!(expected.iter().all(|x| x.is_finite()), "{name}");
        same(name, &expected, &found);
    }
}
