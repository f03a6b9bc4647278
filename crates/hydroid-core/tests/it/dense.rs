//! Fixture of tests of Kalman filters: small networks, their options and samples, and dense matrices.

use hydroid_core::adapt::kalman::FilterOptions;
use hydroid_core::model::recurrent::{Cell, Network};

pub(crate) fn weights(network: Network, size: f64) -> Vec<f64> {
    (0..network.weights()).map(|k| size * (k as f64 * 12.9898 + 0.3).sin()).collect()
}

pub(crate) fn cells() -> [Network; 5] {
    let with = |cell, outputs, read_out| Network { cell, inputs: 2, outputs, read_out };
    [
        with(Cell::Lstm { hidden: 5, projection: Some(3) }, 3, false),
        with(Cell::Lstm { hidden: 4, projection: None }, 2, true),
        with(Cell::Gru { hidden: 5 }, 3, true),
        with(Cell::Vanilla { hidden: 4, layers: 2 }, 2, true),
        with(Cell::Gru { hidden: 3 }, 6, true),
    ]
}

pub(crate) type Matrix = Vec<Vec<f64>>;

pub(crate) fn product(a: &Matrix, b: &Matrix) -> Matrix {
    a.iter()
        .map(|row| (0..b[0].len()).map(|j| row.iter().zip(b).map(|(x, b)| x * b[j]).sum()).collect())
        .collect()
}

pub(crate) fn transposed(a: &Matrix) -> Matrix {
    (0..a[0].len()).map(|j| a.iter().map(|row| row[j]).collect()).collect()
}

/// By Gauss and Jordan, with pivots.
pub(crate) fn inverse(a: &Matrix) -> Matrix {
    let n = a.len();
    let mut rows: Matrix = (0..n)
        .map(|i| a[i].iter().copied().chain((0..n).map(|j| f64::from(u8::from(i == j)))).collect())
        .collect();
    for i in 0..n {
        let pivot = (i..n).max_by(|&a, &b| rows[a][i].abs().total_cmp(&rows[b][i].abs())).unwrap();
        rows.swap(i, pivot);
        let by = rows[i][i];
        rows[i].iter_mut().for_each(|x| *x /= by);
        let own = rows[i].clone();
        for (k, row) in rows.iter_mut().enumerate() {
            let by = row[i];
            if k != i {
                row.iter_mut().zip(&own).for_each(|(x, y)| *x -= by * y);
            }
        }
    }
    rows.into_iter().map(|row| row[n..].to_vec()).collect()
}

/// Inputs and measurements, some of which are missing.
pub(crate) fn sample(k: usize, outputs: usize) -> (Vec<f64>, Vec<f64>) {
    let t = k as f64;
    let z = |i: usize| {
        if (k * 7 + i * 3).is_multiple_of(11) {
            f64::NAN
        } else {
            0.5 * (0.11 * t + i as f64).sin() + 0.1 * (1.7 * t).cos()
        }
    };
    (vec![(0.3 * t).sin(), (0.07 * t).cos()], (0..outputs).map(z).collect())
}

pub(crate) fn options(network: Network) -> FilterOptions {
    let weights = network.weights();
    let noise: Vec<f64> = (0..network.outputs).map(|i| 0.02 + 0.01 * i as f64).collect();
    let mut options = FilterOptions::uniform(weights, 0.05, 1e-4, (0.7, 1e-3), &noise);
    // No two weights alike.
    for (i, q) in options.weight_noise.iter_mut().enumerate() {
        *q *= 1.0 + (i % 5) as f64;
    }
    FilterOptions { leak: 1e-3, forgetting: 0.998, ..options }
}
