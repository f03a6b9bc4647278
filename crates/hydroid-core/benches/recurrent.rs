//! Recurrent networks in batches: `cargo bench -p hydroid-core --bench recurrent`.
//!
//! One item is one step of one sequence, so that the throughput is in steps a second.

use divan::Bencher;
use divan::counter::ItemsCount;
use hydroid_core::math::{self, Scalar};
use hydroid_core::model::recurrent::{Cell, Network, Rollout, Tape};

fn main() {
    divan::main();
}

const LSTM: Network =
    Network { cell: Cell::Lstm { hidden: 18, projection: Some(3) }, inputs: 5, outputs: 3, read_out: false };
const GRU: Network = Network { cell: Cell::Gru { hidden: 18 }, inputs: 5, outputs: 3, read_out: true };
const VANILLA: Network =
    Network { cell: Cell::Vanilla { hidden: 18, layers: 2 }, inputs: 5, outputs: 3, read_out: true };

fn numbers<T: Scalar>(len: usize) -> Vec<T> {
    (0..len).map(|k| T::of(0.3 * (0.7 * k as f64 + 0.1).sin())).collect()
}

const STEPS: usize = 100;

/// Forward, back, and the gradient of all weights.
fn through_time<T: Scalar>(bencher: Bencher, network: Network, sequences: usize) {
    let mut tape = Tape::<T>::new(&network, STEPS, sequences);
    let weights = numbers(network.weights());
    let inputs = numbers::<T>(network.inputs * tape.lanes());
    let mut gradient = vec![T::zero(); weights.len()];
    bencher.counter(ItemsCount::new(STEPS * sequences)).bench_local(|| {
        tape.load(divan::black_box(&weights));
        for k in 0..STEPS {
            tape.input_mut(k).copy_from_slice(&inputs);
            tape.step(k);
        }
        tape.begin_backward();
        for k in (0..STEPS).rev() {
            tape.output_adjoint_mut(k).fill(T::one());
            tape.step_back(k);
        }
        tape.gradient(&mut gradient);
        gradient[0]
    });
}

const BATCHES: [usize; 4] = [16, 32, 64, 128];

#[divan::bench(types = [f32, f64], args = BATCHES)]
fn through_time_lstm<T: Scalar>(bencher: Bencher, sequences: usize) {
    through_time::<T>(bencher, LSTM, sequences);
}

#[divan::bench(types = [f32, f64], args = BATCHES)]
fn through_time_gru<T: Scalar>(bencher: Bencher, sequences: usize) {
    through_time::<T>(bencher, GRU, sequences);
}

#[divan::bench(types = [f32, f64], args = BATCHES)]
fn through_time_vanilla<T: Scalar>(bencher: Bencher, sequences: usize) {
    through_time::<T>(bencher, VANILLA, sequences);
}

/// 1,000 sequences of commands tried for 100 steps each, outputs fed back, in batches of the given size.
#[divan::bench(types = [f32, f64], args = [50, 100, 250, 1000])]
fn rollout_lstm_1000<T: Scalar>(bencher: Bencher, at_a_time: usize) {
    let mut rollout = Rollout::<T>::new(&LSTM, at_a_time);
    rollout.load(&numbers(LSTM.weights()));
    let lanes = rollout.lanes();
    let commands = numbers::<T>(2 * lanes);
    let mut outputs = vec![T::zero(); 3 * lanes];
    bencher.counter(ItemsCount::new(1000 * STEPS)).bench_local(|| {
        for _ in 0..1000 / at_a_time {
            rollout.state_mut().fill(T::zero());
            for _ in 0..STEPS {
                outputs.copy_from_slice(rollout.output());
                let (first, second) = rollout.input_mut().split_at_mut(2 * lanes);
                first.copy_from_slice(&commands);
                second.copy_from_slice(&outputs);
                rollout.step();
            }
        }
        rollout.output()[0]
    });
}

fn element_wise<T: Scalar>(bencher: Bencher, mut f: impl FnMut(&mut [T])) {
    let x: Vec<T> = (0..1152).map(|k| T::of(f64::from(k) * 0.005 - 3.0)).collect();
    let mut y = x.clone();
    bencher.counter(ItemsCount::new(x.len())).bench_local(|| {
        y.copy_from_slice(divan::black_box(&x));
        f(&mut y);
        y[7]
    });
}

#[divan::bench(types = [f32, f64])]
fn tanh<T: Scalar>(bencher: Bencher) {
    element_wise::<T>(bencher, math::tanh);
}

#[divan::bench(types = [f32, f64])]
fn tanh_of_std<T: Scalar>(bencher: Bencher) {
    element_wise::<T>(bencher, |x| x.iter_mut().for_each(|x| *x = x.tanh()));
}

#[divan::bench(types = [f32, f64])]
fn sigmoid<T: Scalar>(bencher: Bencher) {
    element_wise::<T>(bencher, math::sigmoid);
}

#[divan::bench(types = [f32, f64])]
fn exp<T: Scalar>(bencher: Bencher) {
    element_wise::<T>(bencher, math::exp);
}
