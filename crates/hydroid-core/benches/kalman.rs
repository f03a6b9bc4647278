//! One step of the filter over state and weights: `cargo bench -p hydroid-core --bench kalman`.
//!
//! Beside each step stands what a plain pass over a full covariance of the same number of weights takes, read and written
//! once: a filter that kept both triangles would need at least that.

use divan::Bencher;
use hydroid_core::adapt::kalman::{Filter, LearnableNetwork, Memory, Tuning};
use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::{Cell, Network, Packed};

fn main() {
    divan::main();
}

const LSTM: Network =
    Network { cell: Cell::Lstm { hidden: 18, projection: Some(3) }, inputs: 2, outputs: 3, read_out: false };
const GRU: Network = Network { cell: Cell::Gru { hidden: 18 }, inputs: 2, outputs: 3, read_out: true };
const VANILLA: Network =
    Network { cell: Cell::Vanilla { hidden: 18, layers: 2 }, inputs: 2, outputs: 3, read_out: true };

/// What else than the full covariance is kept.
const LESS: [Memory; 6] = [
    Memory::Blocks { group: 1 },
    Memory::Blocks { group: 3 },
    Memory::Blocks { group: 7 },
    Memory::Diagonal,
    Memory::LowRank { rank: 5 },
    Memory::LowRank { rank: 20 },
];

/// Advance and observe.
fn step<T: Scalar>(bencher: Bencher, network: Network, memory: Memory) {
    let weights: Vec<T> = (0..network.weights()).map(|k| T::of(0.3 * (0.7 * k as f64 + 0.1).sin())).collect();
    let model = LearnableNetwork::new(Packed::new(network, &weights));
    let tuning = Tuning {
        leak: 3e-5,
        memory,
        ..Tuning::uniform(weights.len(), 4e-3, 1e-7, (1.0, 1e-5), &[2e-4, 2e-3, 2e-2])
    };
    let mut filter = Filter::new(model, tuning).unwrap();
    let mut k = 0.0;
    bencher.bench_local(|| {
        k += 1.0;
        let x = [T::of((0.05_f64 * k).sin()), T::of((0.013_f64 * k).cos())];
        filter.advance(&x);
        filter.observe(&[T::of((0.02_f64 * k).sin()), x[1] * x[0], x[1]])
    });
}

/// `p <- 0.999 p`, all of a full covariance.
fn plain<T: Scalar>(bencher: Bencher, network: Network) {
    let mut p = vec![T::one(); network.weights().pow(2)];
    bencher.bench_local(|| {
        let scale = divan::black_box(T::of(0.999_999));
        for p in &mut p {
            *p *= scale;
        }
        p[0]
    });
}

#[divan::bench(types = [f64, f32])]
fn lstm<T: Scalar>(bencher: Bencher) {
    step::<T>(bencher, LSTM, Memory::Full);
}

#[divan::bench(types = [f64, f32])]
fn lstm_plain_read_and_write<T: Scalar>(bencher: Bencher) {
    plain::<T>(bencher, LSTM);
}

#[divan::bench(types = [f64, f32])]
fn gru<T: Scalar>(bencher: Bencher) {
    step::<T>(bencher, GRU, Memory::Full);
}

#[divan::bench(types = [f64, f32], args = LESS)]
fn gru_with_less<T: Scalar>(bencher: Bencher, memory: Memory) {
    step::<T>(bencher, GRU, memory);
}

#[divan::bench(types = [f64, f32])]
fn gru_plain_read_and_write<T: Scalar>(bencher: Bencher) {
    plain::<T>(bencher, GRU);
}

#[divan::bench(types = [f64, f32])]
fn vanilla<T: Scalar>(bencher: Bencher) {
    step::<T>(bencher, VANILLA, Memory::Full);
}

#[divan::bench(types = [f64, f32])]
fn vanilla_plain_read_and_write<T: Scalar>(bencher: Bencher) {
    plain::<T>(bencher, VANILLA);
}
