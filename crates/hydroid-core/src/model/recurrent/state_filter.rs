//! An extended Kalman filter on the hidden state of a network.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::model::StateFilter;
use super::single::{Change, Linearization, Packed};

/// The covariance of a hidden state, moved as [`StateFilter`] says.
#[derive(Clone, Debug)]
pub(super) struct Covariance {
    /// Length of the state.
    n: usize,
    process: f64,
    initial: f64,
    noise: Vec<f64>,
    /// `state x state`, symmetric to the last bit.
    p: Vec<f64>,
    linear: Linearization<f64>,
    /// Whether a step was made since the start of the run.
    moved: bool,
    /// Products of `p`, and what they want: `state x state`, and what an update has of outputs, which may be more than the
    /// state has numbers.
    product: Vec<f64>,
    transposed: Vec<f64>,
    scratch: Vec<f64>,
    update: Update,
}

/// Of the outputs that were measured: `C P` and then `W'` (`outputs x state`), the lower triangle of `S` and then `L`
/// (`outputs x outputs`), innovations and then `L^-1 e`.
#[derive(Clone, Debug)]
struct Update {
    rows: Vec<f64>,
    factor: Vec<f64>,
    innovation: Vec<f64>,
    measured: Vec<usize>,
}

impl Covariance {
    pub(super) fn new(filter: &StateFilter, packed: &Packed<f64>) -> Self {
        let (n, outputs) = (packed.network().state_len(), packed.network().outputs);
        let linear = Linearization::new(packed);
        let scratch = vec![0.0; linear.scratch(n)];
        let update = Update {
            rows: vec![0.0; outputs * n],
            factor: vec![0.0; outputs * outputs],
            innovation: vec![0.0; outputs],
            measured: Vec::with_capacity(outputs),
        };
        let mut covariance = Self {
            n,
            process: filter.process,
            initial: filter.initial,
            noise: filter.noise.clone(),
            p: vec![0.0; n * n],
            linear,
            moved: false,
            product: vec![0.0; n.max(outputs).pow(2)],
            transposed: vec![0.0; n * n.max(outputs)],
            scratch,
            update,
        };
        covariance.reset();
        covariance
    }

    /// Back to the start of a run.
    pub(super) fn reset(&mut self) {
        let n = self.n;
        self.p.fill(0.0);
        for i in 0..n {
            self.p[i * n + i] = self.initial;
        }
        self.moved = false;
    }

    /// Whether a step was made since the start of the run: before, nothing is corrected.
    pub(super) fn has_moved(&self) -> bool {
        self.moved
    }

    /// `h <- f(h, x)`, `P <- A P A' + process I`.
    pub(super) fn step(&mut self, packed: &Packed<f64>, h: &mut [f64], x: &[f64]) {
        let n = self.n;
        self.linear.step(packed, h, x);
        let times = |of: &[f64], into: &mut [f64], scratch: &mut [f64]| {
            let change = Change { state: Some(of), ..Change::default() };
            self.linear.times(packed, change, n, into, scratch);
        };
        let (product, transposed) = (&mut self.product[..n * n], &mut self.transposed[..n * n]);
        times(&self.p, product, &mut self.scratch);
        transpose(n, n, product, transposed);
        times(transposed, &mut self.p, &mut self.scratch);
        // Both triangles are the same but for rounding; from here on they are the same.
        for i in 0..n {
            self.p[i * n + i] += self.process;
            for j in 0..i {
                self.p[i * n + j] = self.p[j * n + i];
            }
        }
        self.moved = true;
    }

    /// Corrects `h` by the scaled measurement `z`, NaN where there is none, of which `predicted` is `g(h)`.
    pub(super) fn observe(&mut self, packed: &Packed<f64>, h: &mut [f64], z: &[f64], predicted: &[f64]) {
        let n = self.n;
        let update = &mut self.update;
        update.measured.clear();
        update.measured.extend((0..z.len()).filter(|&i| !z[i].is_nan()));
        let count = update.measured.len();
        if count == 0 {
            return;
        }
        // C P = (P C')', then S = C (C P)' of the outputs that were measured.
        let change = Change { state: Some(&self.p), ..Change::default() };
        self.linear.output_times(packed, change, n, &mut update.rows);
        let outputs = z.len();
        transpose(outputs, n, &update.rows, &mut self.transposed[..n * outputs]);
        let change = Change { state: Some(&self.transposed[..n * outputs]), ..Change::default() };
        self.linear.output_times(packed, change, outputs, &mut self.product[..outputs * outputs]);
        for (i, &row) in update.measured.iter().enumerate() {
            for (j, &column) in update.measured[..=i].iter().enumerate() {
                update.factor[i * count + j] = self.product[row * outputs + column];
            }
            update.factor[i * count + i] += self.noise[row];
            update.innovation[i] = z[row] - predicted[row];
            update.rows.copy_within(row * n..(row + 1) * n, i * n);
        }
        if !update.solve(count, n) {
            self.reset();
            return;
        }
        for (row, &e) in update.rows.chunks_exact(n).zip(&update.innovation[..count]) {
            for i in 0..n {
                h[i] += row[i] * e;
                for j in 0..n {
                    self.p[i * n + j] -= row[i] * row[j];
                }
            }
        }
    }
}

impl Update {
    /// `S = L L'`, `W' = L^-1 C P`, `L^-1 e`; false where `S` is not positive, which it can be for numbers alone that
    /// have left all bounds.
    fn solve(&mut self, count: usize, n: usize) -> bool {
        for i in 0..count {
            for j in 0..=i {
                let dot = |k: usize| self.factor[i * count + k] * self.factor[j * count + k];
                let rest = self.factor[i * count + j] - (0..j).map(dot).sum::<f64>();
                if i > j {
                    self.factor[i * count + j] = rest / self.factor[j * count + j];
                } else if rest > 0.0 && rest.is_finite() {
                    self.factor[i * count + i] = Float::sqrt(rest);
                } else {
                    return false;
                }
            }
            let (above, row) = self.rows.split_at_mut(i * n);
            for k in 0..i {
                let l = self.factor[i * count + k];
                self.innovation[i] -= l * self.innovation[k];
                for (row, &above) in row[..n].iter_mut().zip(&above[k * n..]) {
                    *row -= l * above;
                }
            }
            let l = self.factor[i * count + i];
            self.innovation[i] /= l;
            row[..n].iter_mut().for_each(|x| *x /= l);
        }
        true
    }
}

fn transpose(rows: usize, columns: usize, matrix: &[f64], into: &mut [f64]) {
    for i in 0..rows {
        for j in 0..columns {
            into[j * rows + i] = matrix[i * columns + j];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::recurrent::{Cell, Network};

    /// The same on full matrices, with an inverse in the place of the factor: two outputs of which both or one are
    /// measured.
    #[test]
    fn equals_the_textbook() {
        let network = Network { cell: Cell::Gru { hidden: 4 }, inputs: 2, outputs: 2, read_out: true };
        let weights: Vec<f64> =
            (0..network.weights()).map(|k| 0.8 * Float::sin(k as f64 * 12.9898)).collect();
        let packed = Packed::new(network, &weights);
        let filter = StateFilter { process: 0.01, initial: 0.5, noise: vec![0.02, 0.05] };
        let mut covariance = Covariance::new(&filter, &packed);
        let (mut h, mut plain_h) = (vec![0.0; 4], vec![0.0; 4]);
        let mut p: Vec<f64> = (0..16).map(|k| if k % 5 == 0 { 0.5 } else { 0.0 }).collect();
        let mut linear = Linearization::new(&packed);
        let product = |a: &[f64], b: &[f64], inner: usize| -> Vec<f64> {
            let (rows, columns) = (a.len() / inner, b.len() / inner);
            let at = |i: usize, j: usize| (0..inner).map(|k| a[i * inner + k] * b[k * columns + j]).sum();
            (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))).map(|(i, j)| at(i, j)).collect()
        };
        let turned = |a: &[f64], rows: usize| {
            let mut into = vec![0.0; a.len()];
            transpose(rows, a.len() / rows, a, &mut into);
            into
        };
        for k in 0..40 {
            let x = [Float::sin(0.3 * f64::from(k)), Float::cos(0.7 * f64::from(k))];
            let z = [0.4 * x[1], if k % 3 == 0 { f64::NAN } else { -0.2 * x[0] }];
            let mut y = [0.0; 2];
            covariance.step(&packed, &mut h, &x);
            packed.output(&h, &mut y);
            covariance.observe(&packed, &mut h, &z, &y);

            linear.step(&packed, &mut plain_h, &x);
            let a = linear.dense_state(&packed);
            p = product(&product(&a, &p, 4), &turned(&a, 4), 4);
            (0..4).for_each(|i| p[i * 5] += 0.01);
            packed.output(&plain_h, &mut y);
            let measured: Vec<usize> = (0..2).filter(|&i| !z[i].is_nan()).collect();
            let all = linear.dense_output_state(&packed);
            let c: Vec<f64> = measured.iter().flat_map(|&i| all[4 * i..4 * i + 4].to_vec()).collect();
            let gain = product(&p, &turned(&c, measured.len()), 4);
            let mut s = product(&c, &gain, 4);
            for (i, &m) in measured.iter().enumerate() {
                s[i * (measured.len() + 1)] += filter.noise[m];
            }
            let inverse = if let [a, b, c, d] = s[..] {
                let det = a * d - b * c;
                vec![d / det, -b / det, -c / det, a / det]
            } else {
                vec![1.0 / s[0]]
            };
            let gain_times = product(&gain, &inverse, measured.len());
            let e: Vec<f64> = measured.iter().map(|&i| z[i] - y[i]).collect();
            for (h, by) in plain_h.iter_mut().zip(product(&gain_times, &e, e.len())) {
                *h += by;
            }
            for (p, by) in p.iter_mut().zip(product(&gain_times, &turned(&gain, 4), e.len())) {
                *p -= by;
            }
            for (ours, theirs) in h.iter().chain(&covariance.p).zip(plain_h.iter().chain(&p)) {
                assert!((ours - theirs).abs() < 1e-13, "{k}: {ours} {theirs}");
            }
            for i in 0..16 {
                assert_eq!(covariance.p[i].to_bits(), covariance.p[i % 4 * 4 + i / 4].to_bits(), "symmetric");
            }
        }
    }
}
