//! Derivatives of a step of any network, compared with finite differences and with one another.

use hydroid_core::model::recurrent::{Cell, Change, Gradient, Linearization, Network, Packed};
use proptest::prelude::*;

use crate::jacobians::Dense as _;

fn cells() -> impl Strategy<Value = Cell> {
    prop_oneof![
        (2usize..6, 1usize..5)
            .prop_map(|(hidden, p)| Cell::Lstm { hidden, projection: Some(p.min(hidden - 1)) }),
        (1usize..6).prop_map(|hidden| Cell::Lstm { hidden, projection: None }),
        (1usize..7).prop_map(|hidden| Cell::Gru { hidden }),
        (1usize..6, 1usize..4).prop_map(|(hidden, layers)| Cell::Vanilla { hidden, layers }),
    ]
}

/// A network with weights, a state and an input.
fn points() -> impl Strategy<Value = (Network, Vec<f64>, Vec<f64>, Vec<f64>)> {
    (cells(), 1usize..4, 1usize..4, any::<bool>()).prop_flat_map(|(cell, inputs, outputs, read_out)| {
        let outputs = if read_out { outputs } else { cell.shown() };
        let network = Network { cell, inputs, outputs, read_out };
        let numbers = |len: usize| prop::collection::vec(-1.5..1.5f64, len);
        (Just(network), numbers(network.weights()), numbers(network.state_len()), numbers(inputs))
    })
}

/// `[state+ y]`.
fn step(network: Network, weights: &[f64], state: &[f64], x: &[f64]) -> Vec<f64> {
    let packed = Packed::new(network, weights);
    let (mut result, mut y) = (state.to_vec(), vec![0.0; network.outputs]);
    packed.step(&mut result, x, &mut vec![0.0; packed.scratch()]);
    packed.output(&result, &mut y);
    result.extend(y);
    result
}

/// `y` of a given state.
fn output(network: Network, weights: &[f64], state: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; network.outputs];
    Packed::new(network, weights).output(state, &mut y);
    y
}

/// Central differences of `f` at `x`, column by column.
fn differences(x: &[f64], f: impl Fn(&[f64]) -> Vec<f64>) -> Vec<Vec<f64>> {
    let h = 1e-5;
    (0..x.len())
        .map(|j| {
            let moved = |by: f64| {
                let mut x = x.to_vec();
                x[j] += by;
                f(&x)
            };
            moved(h).iter().zip(moved(-h)).map(|(a, b)| (a - b) / (2.0 * h)).collect()
        })
        .collect()
}

fn check(what: &str, jacobian: &[f64], columns: &[Vec<f64>]) -> Result<(), TestCaseError> {
    for (j, column) in columns.iter().enumerate() {
        for (i, theirs) in column.iter().enumerate() {
            let ours = jacobian[i * columns.len() + j];
            prop_assert!((ours - theirs).abs() < 1e-7, "{what} {i} {j}: {ours} {theirs}");
        }
    }
    Ok(())
}

fn times(matrix: &[f64], v: &[f64], columns: usize) -> Vec<f64> {
    let inner = v.len() / columns;
    let row = |row: &[f64], j: usize| (0..inner).map(|k| row[k] * v[k * columns + j]).sum();
    matrix.chunks_exact(inner).flat_map(|r| (0..columns).map(move |j| row(r, j))).collect()
}

fn transposed(matrix: &[f64], rows: usize) -> Vec<f64> {
    let columns = matrix.len() / rows;
    (0..columns).flat_map(|j| (0..rows).map(move |i| matrix[i * columns + j])).collect()
}

fn close(what: &str, ours: &[f64], theirs: &[f64]) -> Result<(), TestCaseError> {
    prop_assert_eq!(ours.len(), theirs.len());
    for (a, b) in ours.iter().zip(theirs) {
        prop_assert!((a - b).abs() <= 1e-12 * (1.0 + b.abs()), "{}: {} {}", what, a, b);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn jacobians_are_those_of_finite_differences((network, weights, state, x) in points()) {
        let packed = Packed::new(network, &weights);
        let mut linear = Linearization::new(&packed);
        let (mut moved, n) = (state.clone(), state.len());
        linear.step(&packed, &mut moved, &x);
        prop_assert_eq!(&moved[..], &step(network, &weights, &state, &x)[..n]);
        let only_state = |mut result: Vec<f64>| { result.truncate(n); result };
        let of_state = differences(&state, |state| only_state(step(network, &weights, state, &x)));
        check("state", &linear.dense_state(&packed), &of_state)?;
        let of_input = differences(&x, |x| only_state(step(network, &weights, &state, x)));
        check("input", &linear.dense_input(&packed), &of_input)?;
        let of_weights = differences(&weights, |weights| only_state(step(network, weights, &state, &x)));
        check("weights", &linear.dense_weights(&packed), &of_weights)?;
        let of_next = differences(&moved, |state| output(network, &weights, state));
        check("output, state", &linear.dense_output_state(&packed), &of_next)?;
        let of_read_out = differences(&weights, |weights| output(network, weights, &moved));
        check("output, weights", &linear.dense_output_weights(&packed), &of_read_out)?;
    }

    /// Products equal those of the dense matrices, and several columns are computed at once.
    #[test]
    fn products_are_those_of_the_dense_matrices((network, weights, state, x) in points(), columns in 1usize..6) {
        let packed = Packed::new(network, &weights);
        let mut linear = Linearization::new(&packed);
        let (mut moved, n, y) = (state.clone(), state.len(), network.outputs);
        linear.step(&packed, &mut moved, &x);
        let numbers = |rows: usize| (0..rows * columns).map(|k| (k as f64 * 12.9898).sin()).collect::<Vec<f64>>();
        let (by_state, by_input, by_weights) = (numbers(n), numbers(x.len()), numbers(weights.len()));
        let mut scratch = vec![f64::NAN; linear.scratch(columns)];
        let mut out = vec![f64::NAN; n * columns];
        let dense = [linear.dense_state(&packed), linear.dense_input(&packed), linear.dense_weights(&packed)];
        let parts = [&by_state, &by_input, &by_weights].map(Vec::as_slice);
        let mut sum = vec![0.0; n * columns];
        for which in 0..3 {
            let one = |i: usize| (i == which).then_some(parts[i]);
            let change = Change { state: one(0), input: one(1), weights: one(2), local: None };
            linear.times(&packed, change, columns, &mut out, &mut scratch);
            let expected = times(&dense[which], parts[which], columns);
            close("times", &out, &expected)?;
            for (sum, x) in sum.iter_mut().zip(&expected) {
                *sum += x;
            }
        }
        let all = Change { state: Some(parts[0]), input: Some(parts[1]), weights: Some(parts[2]), local: None };
        linear.times(&packed, all, columns, &mut out, &mut scratch);
        close("all changes", &out, &sum)?;

        let mut into = [vec![f64::NAN; n * columns], vec![f64::NAN; x.len() * columns], vec![f64::NAN; weights.len() * columns]];
        let [s, i, w] = &mut into;
        let gradient = Gradient { state: Some(s), input: Some(i), weights: Some(w) };
        linear.transposed_times(&packed, parts[0], columns, gradient, &mut scratch);
        for (into, dense) in into.iter().zip(&dense) {
            close("transposed", into, &times(&transposed(dense, n), parts[0], columns))?;
        }

        let dense = [linear.dense_output_state(&packed), linear.dense_output_weights(&packed)];
        let mut out = vec![f64::NAN; y * columns];
        linear.output_times(&packed, all, columns, &mut out);
        let mut sum = times(&dense[0], parts[0], columns);
        for (sum, x) in sum.iter_mut().zip(times(&dense[1], parts[2], columns)) {
            *sum += x;
        }
        close("output", &out, &sum)?;
        let by_output = numbers(y);
        let [s, _, w] = &mut into;
        let gradient = Gradient { state: Some(s), input: None, weights: Some(w) };
        linear.output_transposed_times(&packed, &by_output, columns, gradient);
        close("output, transposed", s, &times(&transposed(&dense[0], y), &by_output, columns))?;
        close("output, transposed", w, &times(&transposed(&dense[1], y), &by_output, columns))?;
    }

    /// A row of the gates depends on its weights alone, by the documented partials.
    #[test]
    fn rows_of_the_gates_are_in_the_documented_order((network, weights, state, x) in points()) {
        let packed = Packed::new(network, &weights);
        let mut linear = Linearization::new(&packed);
        linear.step(&packed, &mut state.clone(), &x);
        let projected = packed.layout().projection.is_some();
        let (dense, n) = (linear.dense_weights(&packed), weights.len());
        let top = packed.layout().layers.len() - 1;
        let (layer, place) = (linear.layer(top), &packed.layout().layers[top]);
        let at = top * network.state_len() / (top + 1);
        // Results that are part of the state; a projection's input is not.
        for result in 0..layer.results() - usize::from(projected) {
            for unit in 0..layer.units() {
                let mut row = vec![0.0; n];
                for gate in 0..layer.gates() {
                    let (a, b) = (layer.input(result, gate)[unit], layer.hidden(result, gate)[unit]);
                    let of = place.row(gate * layer.units() + unit);
                    for (w, &x) in of.weight_ih.zip(layer.x()) {
                        row[w] = a * x;
                    }
                    for (w, &h) in of.weight_hh.zip(layer.h()) {
                        row[w] = b * h;
                    }
                    (row[of.bias_ih], row[of.bias_hh]) = (a, b);
                }
                let ours = &dense[(at + result * layer.units() + unit) * n..][..n];
                // Only this layer's own weights; the row also depends on those of the layers before it.
                let own = place.weight_ih.start..place.bias_hh.end;
                close("row", &ours[own.clone()], &row[own])?;
            }
        }
    }

    #[test]
    fn weights_can_be_replaced((network, weights, state, x) in points()) {
        let mut packed = Packed::new(network, &vec![0.25; weights.len()]);
        packed.set_weights(&weights);
        prop_assert_eq!(&packed, &Packed::new(network, &weights));
        prop_assert_eq!(packed.weights(), &weights[..]);
        let mut moved = state.clone();
        packed.step(&mut moved, &x, &mut vec![0.0; packed.scratch()]);
        prop_assert_eq!(&moved[..], &step(network, &weights, &state, &x)[..state.len()]);
    }
}
