//! Derivatives of the graph against finite differences, and those of networks against hydroid.

use hydroid::model::Body;
use hydroid_core::model::recurrent::{Change, Linearization, Packed};
use hydroid_export::check::{Derivatives, operations};

use super::{apart, networks};
use crate::models::drawn;

const STEP: f64 = 1e-5;

/// Derivatives of a vector by central differences, row by row.
fn differences(x: &[f64], of: impl Fn(&[f64]) -> Vec<f64>) -> Vec<f64> {
    let columns: Vec<Vec<f64>> = (0..x.len())
        .map(|i| {
            let at = |step: f64| {
                let mut moved = x.to_vec();
                moved[i] += step;
                of(&moved)
            };
            at(STEP).iter().zip(at(-STEP)).map(|(high, low)| (high - low) / (2.0 * STEP)).collect()
        })
        .collect();
    (0..columns[0].len()).flat_map(|row| columns.iter().map(move |column| column[row])).collect()
}

#[test]
fn derivatives_of_operations_are_limits_of_differences() {
    for stream in [0.1, 0.4, 0.8, 1.7] {
        let x: [f64; 6] = drawn(6, stream).try_into().unwrap();
        let (_, gradient) = operations(&x);
        let found = differences(&x, |x| vec![operations(x.try_into().unwrap()).0]);
        assert!(apart(&found, &gradient) < 1e-8, "{found:?} {gradient:?}");
    }
}

fn identity(n: usize) -> Vec<f64> {
    (0..n * n).map(|at| f64::from(u8::from(at % (n + 1) == 0))).collect()
}

/// Rows of two matrices side by side.
fn beside(a: &[f64], b: &[f64], rows: usize) -> Vec<f64> {
    let (of_a, of_b) = (a.len() / rows, b.len() / rows);
    (0..rows).flat_map(|i| [&a[i * of_a..(i + 1) * of_a], &b[i * of_b..(i + 1) * of_b]].concat()).collect()
}

#[test]
fn derivatives_of_networks_are_those_of_hydroid() {
    for (model, options) in networks() {
        let Body::Recurrent(recurrent) = &model.body else { unreachable!("a network") };
        let name = &model.description.name;
        let (network, weights) = (recurrent.network, &recurrent.weights);
        let (n, m, q) = (network.state_len(), weights.len(), network.outputs);
        let derivatives = Derivatives::of(&model, &options).unwrap().unwrap();
        let (hidden, input) = (drawn(n, 0.3), drawn(network.inputs, 0.6));
        let [next, rows] = derivatives.transition(&hidden, &input, weights);
        let [output, output_rows] = derivatives.observation(&next, weights);

        let packed = Packed::new(network, weights);
        let mut linear = Linearization::new(&packed);
        let mut stepped = hidden.clone();
        linear.step(&packed, &mut stepped, &input);
        let mut observed = vec![0.0; q];
        packed.output(&stepped, &mut observed);
        assert!(apart(&stepped, &next) < 1e-14 && apart(&observed, &output) < 1e-14, "{name}");

        let [by_state, by_weights] = [n, m].map(identity);
        let state = Change { state: Some(&by_state[..]), ..Change::default() };
        let of_weights = Change { weights: Some(&by_weights[..]), ..Change::default() };
        let times = |change: Change<'_>, columns: usize| {
            let (mut out, mut scratch) = (vec![0.0; n * columns], vec![0.0; linear.scratch(columns)]);
            linear.times(&packed, change, columns, &mut out, &mut scratch);
            out
        };
        let expected = beside(&times(state, n), &times(of_weights, m), n);
        assert!(apart(&expected, &rows) < 1e-13, "{name}: {}", apart(&expected, &rows));
        let times = |change: Change<'_>, columns: usize| {
            let mut out = vec![0.0; q * columns];
            linear.output_times(&packed, change, columns, &mut out);
            out
        };
        let expected = beside(&times(state, n), &times(of_weights, m), q);
        assert!(apart(&expected, &output_rows) < 1e-13, "{name}: {}", apart(&expected, &output_rows));

        let both = [&hidden[..], weights].concat();
        let found = differences(&both, |x| {
            let [next, _] = derivatives.transition(&x[..n], &input, &x[n..]);
            next
        });
        assert!(apart(&found, &rows) < 1e-8, "{name}");
    }
}
