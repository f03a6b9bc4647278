//! Layers of networks.
//!
//! In single precision, recurrent layers are the operators `GRU` and `LSTM`. In double precision they are their equations,
//! because the operators of onnxruntime's CPU provider compute in `float` only. So is an LSTM with projection, whose visible
//! state has another length than its cells: the operator has no projection.

use super::nodes::{Nodes, integer, size};
use crate::Precision;
use crate::graph::{Cell, Matrix};

/// Order of the gates in ONNX, as indices of PyTorch's order: update, reset, new from reset, update, new.
const GRU: [usize; 3] = [1, 0, 2];

/// Input, output, forget, cell from input, forget, cell, output.
const LSTM: [usize; 4] = [0, 3, 1, 2];

/// Numbers with their blocks of equal length in another order.
fn reordered(numbers: &[f64], order: &[usize]) -> Vec<f64> {
    let block = numbers.len() / order.len();
    order.iter().flat_map(|&gate| &numbers[gate * block..][..block]).copied().collect()
}

impl Nodes {
    /// `W x + b` as the product of a row with the transposed matrix, for which runtimes have the faster kernel.
    pub(super) fn affine(&mut self, weights: &Matrix, bias: &[f64], x: &str) -> String {
        let Matrix { rows, columns, .. } = *weights;
        let transposed: Vec<f64> =
            (0..columns).flat_map(|j| (0..rows).map(move |i| weights.row(i)[j])).collect();
        let weights = self.numbers(&[columns, rows], &transposed);
        let product = self.op("MatMul", &[x, &weights]);
        if bias.iter().all(|&b| b == 0.0) {
            return product;
        }
        let bias = self.numbers(&[rows], bias);
        self.op("Add", &[&product, &bias])
    }

    /// Weights and biases of an operator for sequences, with the gates in its order.
    fn operands(&mut self, cell: &Cell, order: &[usize]) -> [String; 3] {
        let of = |matrix: &Matrix| reordered(&matrix.numbers, order);
        let (w, r) = (&cell.weight_ih, &cell.weight_hh);
        let bias = [reordered(&cell.bias_ih, order), reordered(&cell.bias_hh, order)].concat();
        [
            self.numbers(&[1, w.rows, w.columns], &of(w)),
            self.numbers(&[1, r.rows, r.columns], &of(r)),
            self.numbers(&[1, bias.len()], &bias),
        ]
    }

    /// A vector as a sequence of one sample in one batch, or as the state of one direction.
    fn lifted(&mut self, x: &str) -> String {
        self.reshape(x, &[1, 1, -1])
    }

    /// The next state of a gated recurrent unit of `n` cells.
    ///
    /// ```text
    /// [r z] = sigma(a + b),  a_n, b_n: the rest of W x + b_W and R h + b_R
    /// g     = tanh(a_n + r b_n)
    /// h'    = g + z (h - g)
    /// ```
    pub(super) fn gru(&mut self, cell: &Cell, x: &str, h: &str, n: usize) -> String {
        if self.precision == Precision::Float {
            let [w, r, b] = self.operands(cell, &GRU);
            let (x, h) = (self.lifted(x), self.lifted(h));
            let last = self.fresh();
            let attributes = vec![integer("hidden_size", size(n)), integer("linear_before_reset", 1)];
            self.push("GRU", &[&x, &w, &r, &b, "", &h], &["", &last], attributes);
            return self.reshape(&last, &[size(n)]);
        }
        let of_input = self.affine(&cell.weight_ih, &cell.bias_ih, x);
        let of_state = self.affine(&cell.weight_hh, &cell.bias_hh, h);
        let (a, b) = (self.split(&of_input, &[2 * n, n]), self.split(&of_state, &[2 * n, n]));
        let sum = self.op("Add", &[&a[0], &b[0]]);
        let gates = self.op("Sigmoid", &[&sum]);
        let gates = self.split(&gates, &[n, n]);
        let kept = self.op("Mul", &[&gates[0], &b[1]]);
        let sum = self.op("Add", &[&a[1], &kept]);
        let new = self.op("Tanh", &[&sum]);
        let apart = self.op("Sub", &[h, &new]);
        let held = self.op("Mul", &[&gates[1], &apart]);
        self.op("Add", &[&new, &held])
    }

    /// The next `[c m]` of a long short-term memory of `n` cells.
    ///
    /// ```text
    /// [i f g o] = W x + b_W + R h + b_R
    /// c' = sigma(f) c + sigma(i) tanh(g)
    /// m  = sigma(o) tanh(c')
    /// ```
    pub(super) fn lstm(&mut self, cell: &Cell, [x, c, h]: [&str; 3], n: usize) -> String {
        if self.precision == Precision::Float && cell.weight_hh.columns == n {
            let [w, r, b] = self.operands(cell, &LSTM);
            let [x, c, h] = [x, c, h].map(|of| self.lifted(of));
            let (shown, cells) = (self.fresh(), self.fresh());
            let attributes = vec![integer("hidden_size", size(n))];
            self.push("LSTM", &[&x, &w, &r, &b, "", &h, &c], &["", &shown, &cells], attributes);
            let both = self.concat(&[&cells, &shown]);
            return self.reshape(&both, &[size(2 * n)]);
        }
        let of_input = self.affine(&cell.weight_ih, &cell.bias_ih, x);
        let of_state = self.affine(&cell.weight_hh, &cell.bias_hh, h);
        let sum = self.op("Add", &[&of_input, &of_state]);
        let parts = self.split(&sum, &[2 * n, n, n]);
        let gates = self.op("Sigmoid", &[&parts[0]]);
        let gates = self.split(&gates, &[n, n]);
        let new = self.op("Tanh", &[&parts[1]]);
        let output = self.op("Sigmoid", &[&parts[2]]);
        let written = self.op("Mul", &[&gates[0], &new]);
        let kept = self.op("Mul", &[&gates[1], c]);
        let cells = self.op("Add", &[&kept, &written]);
        let bounded = self.op("Tanh", &[&cells]);
        let shown = self.op("Mul", &[&output, &bounded]);
        self.concat(&[&cells, &shown])
    }
}
