//! Steps and Jacobians of one sequence against PyTorch's.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::Packed;

mod networks;

use networks::{NAMES, golden_weights, network, rounded, sequence, worst};

/// Largest differences of state and output over the golden sequence.
fn walk<T: Scalar>(name: &str) -> (f64, f64) {
    let network = network(name);
    let packed = Packed::<T>::new(network, &rounded(&golden_weights(name)));
    let (inputs, states, outputs) =
        (sequence(name, "input"), sequence(name, "state"), sequence(name, "output"));
    let len = network.state_len();
    let (mut state, mut y) = (vec![T::zero(); len], vec![T::zero(); network.outputs]);
    let mut scratch = vec![T::zero(); packed.scratch()];
    let mut differences = (0.0_f64, 0.0_f64);
    assert_eq!(inputs.len(), 60 * network.inputs);
    for k in 0..60 {
        let x = rounded::<T>(&inputs[k * network.inputs..(k + 1) * network.inputs]);
        packed.step(&mut state, &x, &mut scratch);
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
        let (double, single) = (walk::<f64>(name), walk::<f32>(name));
        println!("{name}: f64 {double:?}, f32 {single:?}");
        assert!(double.0.max(double.1) < 1e-12, "{name}: {double:?}");
        assert!(single.0.max(single.1) < 1e-5, "{name}: {single:?}");
    }
}
