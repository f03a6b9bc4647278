//! What a filter learns whose innovation is taken several steps ahead: dense, by the book, and slow.
//!
//! ```text
//! cargo run --release -p hydroid --example innovations_ahead -- MODEL[,MODEL ..] LOG[,LOG ..] [KEY=VALUE ..]
//! ```
//!
//! The hidden state `h_s` at `s = k - n` and the weights are estimated from what is measured at `k`, `n` steps later:
//!
//! ```text
//! y_k = g(f(.. f(h_s, x_s, theta) .., x_{k-1}, theta), theta) + noise       then h_{s+1} = f(h_s, x_s, theta)
//! ```
//!
//! with the gradient of all `n` steps, so that the weights are fitted to what the network says `n` steps ahead, given the commands, and
//! not to the next step. With `n=1` it is the filter of `hydroid adapt`, but that a measurement corrects the state before the step
//! and not after it. Predictions begin from the estimate of `h_{k-n+1}`. `n` (1) and `r` (3; variance of the noise in that of the sensors) are
//! settings; all else is the default of `hydroid adapt` (without its leak). Errors as those of `adapt_lawns`: the mean from the truth 1, 5, 20, 50 and 100 steps
//! ahead, u v r, medians over the models, which are networks that see inputs alone.

#[path = "shared/hydrofoil.rs"]
mod hydrofoil;

use std::path::Path;

use hydrofoil::read;
use hydroid::log::Trajectory;
use hydroid::model::{self, Body};
use hydroid_core::model::recurrent::{Gradient, Layout, Linearization, Packed, Recurrent};

type Failure = Box<dyn std::error::Error + Send + Sync>;

const SHOWN: [usize; 5] = [1, 5, 20, 50, 100];
const HORIZON: usize = 100;
/// Of the simulated sensors.
const NOISE: [f64; 3] = [0.01, 0.01, 0.017_453_292_519_943_295];

/// Variance of hidden state and weights at first, what a sample adds, and the factor of weights of gates in both.
const VARIANCES: [f64; 2] = [1.0, 0.02];
const WALKS: [f64; 2] = [1e-5, 6e-8];
const GATES: f64 = 5.0;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [models, logs, rest @ ..] = arguments.as_slice() else {
        return Err("give MODEL[,MODEL ..] LOG[,LOG ..] [KEY=VALUE ..]".into());
    };
    let (mut ahead, mut noise) = (1, 3.0);
    for word in rest {
        match word.split_once('=') {
            Some(("n", value)) => ahead = value.parse::<usize>()?.max(1),
            Some(("r", value)) => noise = value.parse()?,
            _ => return Err("settings are n=STEPS and r=FACTOR".into()),
        }
    }
    let models: Vec<Recurrent> = models.split(',').map(network).collect::<Result<_, _>>()?;
    for run in logs.split(',').map(read) {
        let run = run?;
        let all: Vec<[[f64; 3]; SHOWN.len()]> = std::thread::scope(|scope| {
            let workers: Vec<_> =
                models.iter().map(|model| scope.spawn(|| errors(model, &run, ahead, noise))).collect();
            let joined = workers.into_iter().map(|w| w.join().map_err(|_| Failure::from("a run panicked")));
            joined.collect::<Result<_, _>>()
        })?;
        let middle = |h: usize, c: usize| {
            let mut values: Vec<f64> = all.iter().map(|errors| errors[h][c]).collect();
            values.sort_unstable_by(f64::total_cmp);
            values[values.len() / 2]
        };
        let row: Vec<String> = (0..SHOWN.len())
            .map(|h| format!("{:.4} {:.4} {:.4}", middle(h, 0), middle(h, 1), middle(h, 2)))
            .collect();
        println!("{} n={ahead} r={noise}: {}", run.name, row.join("  "));
    }
    Ok(())
}

/// State and weights together, and their covariance, row by row.
struct Filter {
    packed: Packed<f64>,
    states: usize,
    outputs: usize,
    estimate: Vec<f64>,
    covariance: Vec<f64>,
    walks: Vec<f64>,
    steps: Vec<Linearization<f64>>,
    scratch: Vec<f64>,
}

impl Filter {
    fn new(model: &Recurrent, ahead: usize) -> Self {
        let packed = Packed::new(model.network, &model.weights);
        let (states, outputs) = (model.network.state_len(), model.outputs());
        let mut estimate = vec![0.0; states];
        estimate.extend(&model.weights);
        let n = estimate.len();
        let of = |values: [f64; 2]| -> Vec<f64> {
            let mut all = vec![values[0]; states];
            all.resize(n, values[1]);
            for place in Layout::new(&model.network).gates(model.network.cell) {
                all[states + place] *= GATES;
            }
            all
        };
        let mut covariance = vec![0.0; n * n];
        of(VARIANCES).iter().enumerate().for_each(|(i, variance)| covariance[i * (n + 1)] = *variance);
        let steps: Vec<_> = (0..ahead).map(|_| Linearization::new(&packed)).collect();
        let scratch = vec![0.0; steps[0].scratch(outputs)];
        Self { packed, states, outputs, estimate, covariance, walks: of(WALKS), steps, scratch }
    }

    /// From what was measured at the end of these inputs.
    fn correct(&mut self, inputs: &[Vec<f64>], z: &[f64], r: &[f64]) {
        let (n, states, q) = (self.estimate.len(), self.states, self.outputs);
        let mut state = self.estimate[..states].to_vec();
        for (step, x) in self.steps.iter_mut().zip(inputs) {
            step.step(&self.packed, &mut state, x);
        }
        let mut said = vec![0.0; q];
        self.packed.output(&state, &mut said);
        let h = self.gradient();
        // One output after the other: their noises are independent.
        let mut moved = vec![0.0; n];
        for i in 0..q {
            let h = &h[i * n..(i + 1) * n];
            let ph: Vec<f64> = self.covariance.chunks_exact(n).map(|row| dot(row, h)).collect();
            let gain = 1.0 / (dot(h, &ph) + r[i]);
            let e = z[i] - said[i] - dot(h, &moved);
            for (a, row) in ph.iter().zip(self.covariance.chunks_exact_mut(n)) {
                let a = a * gain;
                row.iter_mut().zip(&ph).for_each(|(p, b)| *p -= a * b);
            }
            moved.iter_mut().zip(&ph).for_each(|(x, a)| *x += a * e * gain);
        }
        self.estimate.iter_mut().zip(&moved).for_each(|(x, moved)| *x += moved);
        self.packed.set_weights(&self.estimate[states..]);
    }

    /// Of the outputs after all steps by state and weights, row by row: back from there.
    fn gradient(&mut self) -> Vec<f64> {
        let (n, states, q) = (self.estimate.len(), self.states, self.outputs);
        let mut unit = vec![0.0; q * q];
        (0..q).for_each(|i| unit[i * (q + 1)] = 1.0);
        let (mut state, mut weights) = (vec![0.0; states * q], vec![0.0; (n - states) * q]);
        let (mut more_state, mut more_weights) = (state.clone(), weights.clone());
        for (i, step) in self.steps.iter().rev().enumerate() {
            if i == 0 {
                let into = Gradient { state: Some(&mut state), weights: Some(&mut weights), input: None };
                step.output_transposed_times(&self.packed, &unit, q, into);
            }
            let into =
                Gradient { state: Some(&mut more_state), weights: Some(&mut more_weights), input: None };
            step.transposed_times(&self.packed, &state, q, into, &mut self.scratch);
            state.copy_from_slice(&more_state);
            weights.iter_mut().zip(&more_weights).for_each(|(into, more)| *into += more);
        }
        let columns = state.chunks_exact(q).chain(weights.chunks_exact(q));
        let mut h = vec![0.0; q * n];
        for (j, column) in columns.enumerate() {
            column.iter().enumerate().for_each(|(i, value)| h[i * n + j] = *value);
        }
        h
    }

    /// The state moves on by one step.
    fn advance(&mut self, x: &[f64]) {
        let (n, states) = (self.estimate.len(), self.states);
        let step = &mut self.steps[0];
        step.step(&self.packed, &mut self.estimate[..states], x);
        let (by_state, by_weights) = (step.dense_state(&self.packed), step.dense_weights(&self.packed));
        let rows = by_state.chunks_exact(states).zip(by_weights.chunks_exact(n - states));
        let jacobian: Vec<Vec<f64>> = rows.map(|(a, b)| [a, b].concat()).collect();
        let moved: Vec<Vec<f64>> = jacobian
            .iter()
            .map(|row| {
                let mut sum = vec![0.0; n];
                for (&factor, p) in row.iter().zip(self.covariance.chunks_exact(n)) {
                    if factor != 0.0 {
                        sum.iter_mut().zip(p).for_each(|(sum, p)| *sum += factor * p);
                    }
                }
                sum
            })
            .collect();
        for (i, row) in moved.iter().enumerate() {
            for j in 0..n {
                let value = if j < states { dot(row, &jacobian[j]) } else { row[j] };
                self.covariance[i * n + j] = value;
                self.covariance[j * n + i] = value;
            }
        }
        self.walks.iter().enumerate().for_each(|(i, walk)| self.covariance[i * (n + 1)] += walk);
    }

    /// What the network says from the estimate on, in its units, row by row.
    fn rollout(&self, inputs: &[Vec<f64>]) -> Vec<f64> {
        let mut state = self.estimate[..self.states].to_vec();
        let mut scratch = vec![0.0; self.packed.scratch()];
        let mut said = vec![0.0; inputs.len() * self.outputs];
        for (x, y) in inputs.iter().zip(said.chunks_exact_mut(self.outputs)) {
            self.packed.step(&mut state, x, &mut scratch);
            self.packed.output(&state, y);
        }
        said
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    // In lanes of their own, or it would wait for itself.
    let (a, b) = (a.chunks(8), b.chunks(8));
    let mut sums = [0.0; 8];
    for (a, b) in a.zip(b) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    sums.iter().sum()
}

fn errors(model: &Recurrent, run: &Trajectory, ahead: usize, noise: f64) -> [[f64; 3]; SHOWN.len()] {
    let scaling = &model.scaling;
    let inputs: Vec<Vec<f64>> = (0..run.len())
        .map(|k| {
            let each = run.inputs.row(k).iter().zip(&scaling.input_mean).zip(&scaling.input_scale);
            each.map(|((c, mean), scale)| (c - mean) / scale).collect()
        })
        .collect();
    let r: Vec<f64> =
        NOISE.iter().zip(&scaling.correction_scale).map(|(s, scale)| noise * (s / scale).powi(2)).collect();
    let truth = run.truth.as_ref().unwrap_or(&run.outputs);
    let mut filter = Filter::new(model, ahead);
    let (mut sums, mut windows) = ([[0.0; 3]; SHOWN.len()], 0.0);
    for k in ahead..run.len() - HORIZON {
        let s = k - ahead;
        let scaled = run.outputs.row(k).iter().zip(&scaling.output_mean).zip(&scaling.correction_scale);
        let z: Vec<f64> = scaled.map(|((y, mean), scale)| (y - mean) / scale).collect();
        filter.correct(&inputs[s..k], &z, &r);
        filter.advance(&inputs[s]);
        if k >= 100 && k % 5 == 0 {
            let said = filter.rollout(&inputs[s + 1..k + HORIZON]);
            for (sums, h) in sums.iter_mut().zip(SHOWN) {
                for (c, sum) in sums.iter_mut().enumerate() {
                    let y =
                        said[3 * (ahead + h - 2) + c] * scaling.correction_scale[c] + scaling.output_mean[c];
                    *sum += (y - truth.row(k + h)[c]).abs();
                }
            }
            windows += 1.0;
        }
    }
    sums.map(|sums| sums.map(|sum| sum / windows))
}

fn network(path: impl AsRef<str>) -> Result<Recurrent, Failure> {
    let path = path.as_ref();
    let Body::Recurrent(model) = model::read(Path::new(path))?.body else {
        return Err(format!("{path} is no recurrent network").into());
    };
    Ok((*model).clone())
}
