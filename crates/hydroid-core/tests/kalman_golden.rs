//! The filter over state and weights against an independent implementation (JAX, `NumPy`): its trace of the first 200
//! samples, and the errors of the networks that it adapts along a closed-loop log of a hydrofoil.

use hydroid_core::adapt::kalman::{Correction, Filter, LearnableNetwork, Tuning};
use hydroid_core::model::recurrent::Packed;
use safetensors::SafeTensors;

mod networks;

use networks::{NAMES, golden_path, network, read, tensor, weights_of};

/// Rows of numbers of a golden file.
fn rows(file: &str) -> Vec<Vec<f64>> {
    let text = String::from_utf8(read(&golden_path(&format!("adaptation/{file}")))).unwrap();
    text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect()
}

struct Scaling {
    output: [Vec<f64>; 2],
    input: [Vec<f64>; 2],
}

impl Scaling {
    fn z(&self, y: &[f64]) -> Vec<f64> {
        (0..3).map(|i| (y[i] - self.output[0][i]) / self.output[1][i]).collect()
    }

    fn x(&self, c: &[f64]) -> Vec<f64> {
        (0..2).map(|i| (c[i] - self.input[0][i]) / self.input[1][i]).collect()
    }
}

/// The reference's tuning (`filter.json`).
fn filter(name: &str) -> (Filter<f64, LearnableNetwork<f64>>, Scaling) {
    let network = network(name);
    let bytes = read(&golden_path(&format!("adaptation/{name}_pretrained.safetensors")));
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let scaling = Scaling {
        output: [tensor(&file, "norm.output_mean"), tensor(&file, "norm.output_std")],
        input: [tensor(&file, "norm.input_mean"), tensor(&file, "norm.input_std")],
    };
    let sigma = [0.01, 0.01, 1.0_f64.to_radians()];
    let noise: Vec<f64> =
        sigma.iter().zip(&scaling.output[1]).map(|(s, scale)| 5.0 * (s / scale).powi(2)).collect();
    let weights = weights_of(&network, &bytes);
    let tuning = Tuning {
        leak: 3e-5,
        ..Tuning::uniform(weights.len(), 4e-3, 1e-7, (1.0, 1e-5), &noise)
    };
    let model = LearnableNetwork::new(Packed::new(network, &weights));
    (Filter::new(model, tuning).unwrap(), scaling)
}

/// A step of the filter: command `k`, then measurement `k + 1`.
fn step(filter: &mut Filter<f64, LearnableNetwork<f64>>, scaling: &Scaling, log: &[Vec<f64>], k: usize) -> f64 {
    filter.advance(&scaling.x(&log[k][1..3]));
    match filter.observe(&scaling.z(&log[k + 1][3..6])) {
        Correction::Made { nis, .. } => nis,
        other => panic!("{other:?} at {k}"),
    }
}

#[test]
fn the_trace_is_that_of_the_reference() {
    let log = rows("lawn3.csv");
    for name in NAMES {
        let reference = rows(&format!("{name}_filter_trace.csv"));
        let (mut filter, scaling) = filter(name);
        let given = filter.weights().to_vec();
        let mut worst = vec![0.0_f64; 11];
        for (k, row) in reference.iter().enumerate() {
            let nis = step(&mut filter, &scaling, &log, k);
            let (e, s) = filter.innovation();
            let (hh, tt) = filter.variances();
            let moved: f64 = filter.weights().iter().zip(&given).map(|(a, b)| (a - b).powi(2)).sum();
            let mut ours = vec![k as f64];
            ours.extend(e.iter().chain(s));
            ours.extend([nis, hh.iter().sum(), tt.iter().sum(), moved.sqrt()]);
            assert_eq!(ours.len(), row.len());
            for (worst, (ours, theirs)) in worst.iter_mut().zip(ours.iter().zip(row)) {
                *worst = worst.max((ours - theirs).abs());
            }
        }
        for (column, &worst) in worst.iter().enumerate().skip(1) {
            let square: f64 = reference.iter().map(|row| row[column].powi(2)).sum();
            let rms = (square / reference.len() as f64).sqrt();
            println!("{name}: column {column} differs by {:.1e} of its RMS", worst / rms);
            assert!(worst < 1e-8 * rms, "{name}: column {column}: {worst} of {rms}");
        }
    }
}
