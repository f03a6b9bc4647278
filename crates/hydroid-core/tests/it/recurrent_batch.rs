//! Batches of recurrent networks: independence of the lanes, and derivatives compared with finite differences.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::{Cell, Network, Rollout, Tape};
use proptest::prelude::*;

fn network() -> impl Strategy<Value = Network> {
    let cell = prop_oneof![
        (1..7_usize).prop_map(|hidden| Cell::Lstm { hidden, projection: None }),
        (2..7_usize)
            .prop_flat_map(|hidden| (Just(hidden), 1..hidden))
            .prop_map(|(hidden, projection)| Cell::Lstm { hidden, projection: Some(projection) }),
        (1..7_usize).prop_map(|hidden| Cell::Gru { hidden }),
        (1..6_usize, 1..4_usize).prop_map(|(hidden, layers)| Cell::Vanilla { hidden, layers }),
    ];
    (cell, 1..6_usize, proptest::option::of(1..4_usize)).prop_map(|(cell, inputs, read)| Network {
        cell,
        inputs,
        outputs: read.unwrap_or(cell.shown()),
        read_out: read.is_some(),
    })
}

/// Pseudo-random numbers between -1 and 1.
fn number(seed: u64, k: usize) -> f64 {
    let mut x = seed ^ (k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

fn weights<T: Scalar>(network: &Network, seed: u64) -> Vec<T> {
    (0..network.weights()).map(|k| T::of(0.8 * number(seed, k))).collect()
}

/// A sequence: its initial state, inputs, and the weights of its outputs in the loss.
struct Sequence {
    seed: u64,
    network: Network,
}

impl Sequence {
    fn state(&self, i: usize) -> f64 {
        number(self.seed, i)
    }

    fn input(&self, k: usize, i: usize) -> f64 {
        number(self.seed, 1000 + k * self.network.inputs + i)
    }

    fn output_weight(&self, k: usize, i: usize) -> f64 {
        number(self.seed, 5000 + k * self.network.outputs + i)
    }
}

fn sequences(network: &Network, seed: u64, count: usize) -> Vec<Sequence> {
    (0..count).map(|lane| Sequence { seed: seed.wrapping_add(77 * lane as u64), network: *network }).collect()
}

/// Feedback: this part of each output is added to the next step's input.
const FEEDBACK: f64 = 0.5;

/// Results of one lane: states, outputs, adjoints of the inputs, adjoint of the initial state.
type Lane<T> = [Vec<T>; 4];

/// A forward pass, and a backward pass to step `from`; the padding is filled with values that must have no effect.
fn walk<T: Scalar>(
    network: &Network,
    weights: &[T],
    sequences: &[Sequence],
    steps: usize,
    from: usize,
) -> (Vec<Lane<T>>, Vec<T>) {
    let mut tape = Tape::<T>::new(network, steps, sequences.len());
    let lanes = tape.lanes();
    let mut seen: Vec<Lane<T>> = sequences.iter().map(|_| Lane::default()).collect();
    let fed = network.inputs.min(network.outputs);
    let columns =
        |rows: &[T], lane: usize| -> Vec<T> { rows.iter().skip(lane).step_by(lanes).copied().collect() };
    tape.load(weights);
    tape.state_mut().fill(T::nan());
    for (i, row) in tape.state_mut().chunks_exact_mut(lanes).enumerate() {
        for (x, sequence) in row.iter_mut().zip(sequences) {
            *x = T::of(sequence.state(i));
        }
    }
    for k in 0..steps {
        let before =
            if k > 0 { tape.output(k - 1).to_vec() } else { vec![T::zero(); network.outputs * lanes] };
        tape.input_mut(k).fill(T::nan());
        for (i, row) in tape.input_mut(k).chunks_exact_mut(lanes).enumerate() {
            for (lane, sequence) in sequences.iter().enumerate() {
                row[lane] = T::of(sequence.input(k, i));
                if i < fed {
                    row[lane] += T::of(FEEDBACK) * before[i * lanes + lane];
                }
            }
        }
        tape.step(k);
        for (lane, [states, outputs, ..]) in seen.iter_mut().enumerate() {
            states.extend(columns(tape.state(k + 1), lane));
            outputs.extend(columns(tape.output(k), lane));
        }
    }
    tape.begin_backward();
    for k in 0..steps {
        tape.output_adjoint_mut(k).fill(T::nan());
        for (i, row) in tape.output_adjoint_mut(k).chunks_exact_mut(lanes).enumerate() {
            for (x, sequence) in row.iter_mut().zip(sequences) {
                *x = T::of(sequence.output_weight(k, i));
            }
        }
    }
    for k in (from..steps).rev() {
        tape.step_back(k);
        let input = tape.input_adjoint().to_vec();
        for (lane, [.., inputs, _]) in seen.iter_mut().enumerate() {
            inputs.extend(columns(&input, lane));
        }
        if k > 0 {
            for (y, &x) in tape.output_adjoint_mut(k - 1).iter_mut().zip(&input[..fed * lanes]) {
                *y += T::of(FEEDBACK) * x;
            }
        }
    }
    for (lane, [.., initial]) in seen.iter_mut().enumerate() {
        *initial = columns(tape.state_adjoint_mut(), lane);
    }
    let mut gradient = vec![T::nan(); weights.len()];
    tape.gradient(&mut gradient);
    (seen, gradient)
}

fn loss(network: &Network, weights: &[f64], sequence: &Sequence, steps: usize) -> f64 {
    let (seen, _) = walk(network, weights, core::slice::from_ref(sequence), steps, steps);
    let weight = |j: usize| sequence.output_weight(j / network.outputs, j % network.outputs);
    seen[0][1].iter().enumerate().map(|(j, y)| weight(j) * y).sum()
}

fn same_bits<T: Scalar>(a: &[T], b: &[T]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.integer_decode() == b.integer_decode())
}

fn lanes_are_alone<T: Scalar>(network: &Network, seed: u64, count: usize) {
    let (weights, steps) = (weights::<T>(network, seed), 4);
    let all = sequences(network, seed, count);
    let (seen, gradient) = walk(network, &weights, &all, steps, 0);
    let mut sum = vec![0.0; weights.len()];
    for (lane, sequence) in all.iter().enumerate() {
        let (alone, own) = walk(network, &weights, core::slice::from_ref(sequence), steps, 0);
        for (a, b) in seen[lane].iter().zip(&alone[0]) {
            assert!(same_bits(a, b), "lane {lane} of {count}: {a:?} {b:?}");
        }
        for (sum, own) in sum.iter_mut().zip(own) {
            *sum += own.wide();
        }
    }
    let size = sum.iter().fold(1.0_f64, |m, g| m.max(g.abs()));
    for (g, sum) in gradient.iter().zip(&sum) {
        assert!((g.wide() - sum).abs() < 100.0 * T::epsilon().wide() * size, "{g:?} and {sum}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn each_lane_equals_a_single_rollout(network in network(), seed: u64, count in 1..41_usize) {
        lanes_are_alone::<f64>(&network, seed, count);
        lanes_are_alone::<f32>(&network, seed, count);
    }

    #[test]
    fn a_rollout_equals_a_recorded_rollout_bit_for_bit(network in network(), seed: u64, count in 1..41_usize) {
        let weights = weights::<f32>(&network, seed);
        let (mut tape, mut rollout) = (Tape::new(&network, 3, count), Rollout::new(&network, count));
        tape.load(&weights);
        rollout.load(&weights);
        for (j, x) in tape.state_mut().iter_mut().enumerate() {
            *x = f32::of(number(seed, j));
        }
        rollout.state_mut().copy_from_slice(tape.state(0));
        for k in 0..3 {
            for (j, x) in tape.input_mut(k).iter_mut().enumerate() {
                *x = f32::of(number(seed, 999 + 100 * k + j));
            }
            rollout.input_mut().copy_from_slice(tape.input_mut(k));
            tape.step(k);
            rollout.step();
            for (a, b) in [(rollout.state(), tape.state(k + 1)), (rollout.output(), tape.output(k))] {
                let rows = a.chunks_exact(tape.lanes()).zip(b.chunks_exact(tape.lanes()));
                prop_assert!(rows.into_iter().all(|(a, b)| same_bits(&a[..count], &b[..count])));
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_finite_differences(network in network(), seed: u64, steps in 1..5_usize) {
        const H: f64 = 1e-5;
        let weights = weights::<f64>(&network, seed);
        let sequence = &sequences(&network, seed, 1)[0];
        let (seen, gradient) = walk(&network, &weights, core::slice::from_ref(sequence), steps, 0);
        for (j, g) in gradient.iter().enumerate() {
            let at = |h: f64| {
                let mut moved = weights.clone();
                moved[j] += h;
                loss(&network, &moved, sequence, steps)
            };
            let difference = (at(H) - at(-H)) / (2.0 * H);
            prop_assert!((g - difference).abs() < 1e-7 * (1.0 + g.abs()), "weight {}: {} {}", j, g, difference);
        }
        // Derivatives by the first input and the initial state: differences of perturbed rollouts.
        let moved = |state: Option<usize>, input: Option<usize>, h: f64| -> f64 {
            let mut rollout = Rollout::<f64>::new(&network, 1);
            rollout.load(&weights);
            let lanes = rollout.lanes();
            for (i, row) in rollout.state_mut().chunks_exact_mut(lanes).enumerate() {
                row[0] = sequence.state(i) + if state == Some(i) { h } else { 0.0 };
            }
            let mut y = vec![0.0; network.outputs];
            let mut loss = 0.0;
            for k in 0..steps {
                for (i, row) in rollout.input_mut().chunks_exact_mut(lanes).enumerate() {
                    row[0] = sequence.input(k, i) + if k == 0 && input == Some(i) { h } else { 0.0 };
                    row[0] += y.get(i).map_or(0.0, |y| FEEDBACK * y);
                }
                rollout.step();
                for (i, y) in y.iter_mut().enumerate() {
                    *y = rollout.output()[i * lanes];
                    loss += sequence.output_weight(k, i) * *y;
                }
            }
            loss
        };
        let [.., inputs, initial] = &seen[0];
        for (i, g) in initial.iter().enumerate() {
            let difference = (moved(Some(i), None, H) - moved(Some(i), None, -H)) / (2.0 * H);
            prop_assert!((g - difference).abs() < 1e-7 * (1.0 + g.abs()), "state {}: {} {}", i, g, difference);
        }
        for (i, g) in inputs[inputs.len() - network.inputs..].iter().enumerate() {
            let difference = (moved(None, Some(i), H) - moved(None, Some(i), -H)) / (2.0 * H);
            prop_assert!((g - difference).abs() < 1e-7 * (1.0 + g.abs()), "input {}: {} {}", i, g, difference);
        }
    }

    /// A backward pass that stops at step `from` equals the whole backward pass of a tape that starts there.
    #[test]
    fn a_truncated_way_back_is_that_of_a_later_start(network in network(), seed: u64, from in 1..4_usize) {
        let (weights, steps) = (weights::<f64>(&network, seed), 4);
        let run = |begin: usize, state: &[f64]| {
            let mut tape = Tape::new(&network, steps, 1);
            tape.load(&weights);
            tape.state_mut().copy_from_slice(state);
            for k in begin..steps {
                for (j, x) in tape.input_mut(k - begin).iter_mut().enumerate() {
                    *x = number(seed, 99 * k + j);
                }
                tape.step(k - begin);
            }
            let late = tape.state(from - begin).to_vec();
            tape.begin_backward();
            for k in (from..steps).rev() {
                tape.output_adjoint_mut(k - begin).fill(1.0);
                tape.step_back(k - begin);
            }
            let mut gradient = vec![0.0; weights.len()];
            tape.gradient(&mut gradient);
            (gradient, tape.state_adjoint_mut().to_vec(), late)
        };
        let whole = run(0, Tape::<f64>::new(&network, 0, 1).state(0));
        let late = run(from, &whole.2);
        prop_assert!(same_bits(&whole.0, &late.0));
        prop_assert!(same_bits(&whole.1, &late.1));
    }
}

#[test]
#[should_panic(expected = "a batch of no sequences")]
fn a_tape_of_no_sequences_is_refused() {
    let _ = Tape::<f32>::new(
        &Network { cell: Cell::Gru { hidden: 2 }, inputs: 1, outputs: 1, read_out: true },
        3,
        0,
    );
}

#[test]
#[should_panic(expected = "a batch of no sequences")]
fn a_rollout_of_no_sequences_is_refused() {
    let _ = Rollout::<f32>::new(
        &Network { cell: Cell::Gru { hidden: 2 }, inputs: 1, outputs: 1, read_out: true },
        0,
    );
}
