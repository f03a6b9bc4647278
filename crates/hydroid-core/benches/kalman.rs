//! One step of the filter over state and weights: `cargo bench -p hydroid-core --bench kalman`.
//!
//! For comparison: one read and write of a full covariance of the same number of weights, the lower limit of a filter that stores
//! both triangles.

use divan::Bencher;
use hydroid_core::adapt::kalman::{CovarianceForm, Filter, FilterOptions, LearnableNetwork};
use hydroid_core::model::recurrent::{Cell, Network, Packed};

fn main() {
    divan::main();
}

const LSTM: Network =
    Network { cell: Cell::Lstm { hidden: 18, projection: Some(3) }, inputs: 2, outputs: 3, read_out: false };
const GRU: Network = Network { cell: Cell::Gru { hidden: 18 }, inputs: 2, outputs: 3, read_out: true };
const VANILLA: Network =
    Network { cell: Cell::Vanilla { hidden: 18, layers: 2 }, inputs: 2, outputs: 3, read_out: true };

/// Sizes of the groups of blocks.
const GROUPS: [usize; 3] = [1, 3, 7];

/// Advance and observe.
fn step(bencher: Bencher, network: Network, covariance: CovarianceForm) {
    let weights: Vec<f64> = (0..network.weights()).map(|k| 0.3 * (0.7 * k as f64 + 0.1).sin()).collect();
    let model = LearnableNetwork::new(Packed::new(network, &weights));
    let options = FilterOptions {
        leak: 3e-5,
        covariance,
        ..FilterOptions::uniform(weights.len(), 4e-3, 1e-7, (1.0, 1e-5), &[2e-4, 2e-3, 2e-2])
    };
    let mut filter = Filter::new(model, options).unwrap();
    let mut k = 0.0;
    bencher.bench_local(|| {
        k += 1.0;
        let x = [(0.05_f64 * k).sin(), (0.013_f64 * k).cos()];
        filter.advance(&x);
        filter.observe(&[(0.02_f64 * k).sin(), x[1] * x[0], x[1]])
    });
}

/// `p <- 0.999 p`, all of a full covariance.
fn plain(bencher: Bencher, network: Network) {
    let mut p = vec![1.0_f64; network.weights().pow(2)];
    bencher.bench_local(|| {
        let scale = divan::black_box(0.999_999);
        for p in &mut p {
            *p *= scale;
        }
        p[0]
    });
}

#[divan::bench]
fn lstm(bencher: Bencher) {
    step(bencher, LSTM, CovarianceForm::Full);
}

#[divan::bench]
fn lstm_plain_read_and_write(bencher: Bencher) {
    plain(bencher, LSTM);
}

#[divan::bench]
fn gru(bencher: Bencher) {
    step(bencher, GRU, CovarianceForm::Full);
}

#[divan::bench(args = GROUPS)]
fn gru_blocks(bencher: Bencher, group: usize) {
    step(bencher, GRU, CovarianceForm::Blocks { group });
}

#[divan::bench]
fn gru_plain_read_and_write(bencher: Bencher) {
    plain(bencher, GRU);
}

#[divan::bench]
fn vanilla(bencher: Bencher) {
    step(bencher, VANILLA, CovarianceForm::Full);
}

#[divan::bench]
fn vanilla_plain_read_and_write(bencher: Bencher) {
    plain(bencher, VANILLA);
}
