//! Steps and Jacobians of one sequence, compared with PyTorch.

use hydroid_core::model::recurrent::{Linearization, Packed};
use safetensors::SafeTensors;

use crate::jacobians::Dense as _;
use crate::networks::{NAMES, golden_path, golden_weights, network, read, sequence, tensor, worst};

/// Largest differences of state and output over the golden sequence.
fn walk(name: &str) -> (f64, f64) {
    let network = network(name);
    let packed = Packed::new(network, &golden_weights(name));
    let (inputs, states, outputs) =
        (sequence(name, "input"), sequence(name, "state"), sequence(name, "output"));
    let len = network.state_len();
    let (mut state, mut y) = (vec![0.0; len], vec![0.0; network.outputs]);
    let mut scratch = vec![0.0; packed.scratch()];
    let mut differences = (0.0_f64, 0.0_f64);
    assert_eq!(inputs.len(), 60 * network.inputs);
    for k in 0..60 {
        let x = &inputs[k * network.inputs..(k + 1) * network.inputs];
        packed.step(&mut state, x, &mut scratch);
        packed.output(&state, &mut y);
        differences.0 = differences.0.max(worst(&state, &states[k * len..(k + 1) * len]));
        differences.1 =
            differences.1.max(worst(&y, &outputs[k * network.outputs..(k + 1) * network.outputs]));
    }
    differences
}

#[test]
fn sixty_steps_are_pytorchs() {
    for name in NAMES {
        let differences = walk(name);
        println!("{name}: {differences:?}");
        assert!(differences.0.max(differences.1) < 1e-12, "{name}: {differences:?}");
    }
}

/// Largest difference of a Jacobian to PyTorch's; elements are of order 1.
fn jacobians(name: &str) -> Vec<(&'static str, f64)> {
    let network = network(name);
    let packed = Packed::new(network, &golden_weights(name));
    let bytes = read(&golden_path(&format!("networks/{name}_jacobians.safetensors")));
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let theirs = |key: &str| tensor(&file, key);
    let mut state = theirs("state");
    let mut linear = Linearization::new(&packed);
    linear.step(&packed, &mut state, &theirs("input"));
    vec![
        ("state_next", worst(&state, &theirs("state_next"))),
        ("dstate_next_dstate", worst(&linear.dense_state(&packed), &theirs("dstate_next_dstate"))),
        ("dstate_next_dweights", worst(&linear.dense_weights(&packed), &theirs("dstate_next_dweights"))),
        ("dy_dstate", worst(&linear.dense_output_state(&packed), &theirs("dy_dstate"))),
        ("dy_dweights", worst(&linear.dense_output_weights(&packed), &theirs("dy_dweights"))),
    ]
}

#[test]
fn jacobians_of_a_step_are_pytorchs() {
    for name in NAMES {
        for (what, worst) in jacobians(name) {
            println!("{name} {what}: {worst:.1e}");
            assert!(worst < 1e-12, "{name} {what}: {worst:e}");
        }
    }
}
