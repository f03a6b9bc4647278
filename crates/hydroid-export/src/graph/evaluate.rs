//! Evaluation of functions in `f64`.

use super::{Binary, Cell, Function, Matrix, Module, Op, Test, Unary};

impl Unary {
    pub(crate) fn value(self, x: f64) -> f64 {
        match self {
            Self::Neg => -x,
            Self::Abs => x.abs(),
            Self::Sign => {
                if x == 0.0 {
                    0.0
                } else {
                    x.signum()
                }
            }
            Self::Exp => x.exp(),
            Self::Ln => x.ln(),
            Self::Sin => x.sin(),
            Self::Cos => x.cos(),
            Self::Sqrt => x.sqrt(),
            Self::Tanh => x.tanh(),
            Self::Logistic => 1.0 / (1.0 + (-x).exp()),
        }
    }
}

impl Binary {
    pub(crate) fn value(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Add => a + b,
            Self::Sub => a - b,
            Self::Mul => a * b,
            Self::Div => a / b,
            Self::Min => a.min(b),
            Self::Max => a.max(b),
        }
    }
}

impl Test {
    pub(crate) fn holds(self, a: f64, b: f64) -> bool {
        match self {
            Self::Less => a < b,
            Self::LessOrEqual => a <= b,
            Self::IsNumber => !a.is_nan(),
        }
    }
}

fn affine(weights: &Matrix, bias: &[f64], x: &[f64]) -> Vec<f64> {
    let row = |i: usize| weights.row(i).iter().zip(x).map(|(w, x)| w * x).sum::<f64>() + bias[i];
    (0..weights.rows).map(row).collect()
}

fn gru(cell: &Cell, x: &[f64], h: &[f64]) -> Vec<f64> {
    let (a, b) = (affine(&cell.weight_ih, &cell.bias_ih, x), affine(&cell.weight_hh, &cell.bias_hh, h));
    let (n, logistic) = (h.len(), |x: f64| Unary::Logistic.value(x));
    let next = |i: usize| {
        let (reset, update) = (logistic(a[i] + b[i]), logistic(a[n + i] + b[n + i]));
        let new = (a[2 * n + i] + reset * b[2 * n + i]).tanh();
        new + update * (h[i] - new)
    };
    (0..n).map(next).collect()
}

fn lstm(cell: &Cell, x: &[f64], c: &[f64], h: &[f64]) -> Vec<f64> {
    let (a, b) = (affine(&cell.weight_ih, &cell.bias_ih, x), affine(&cell.weight_hh, &cell.bias_hh, h));
    let (n, logistic) = (c.len(), |x: f64| Unary::Logistic.value(x));
    let gate = |gate: usize, i: usize| a[gate * n + i] + b[gate * n + i];
    let mut next: Vec<f64> =
        (0..n).map(|i| logistic(gate(1, i)) * c[i] + logistic(gate(0, i)) * gate(2, i).tanh()).collect();
    let shown: Vec<f64> = (0..n).map(|i| logistic(gate(3, i)) * next[i].tanh()).collect();
    next.extend(shown);
    next
}

impl Module {
    /// The result of a function.
    ///
    /// # Panics
    /// If an argument has another length than stated.
    pub(crate) fn evaluate(&self, function: usize, arguments: &[&[f64]]) -> Vec<f64> {
        let function: &Function = &self.functions[function];
        for (given, stated) in arguments.iter().zip(&function.arguments) {
            assert_eq!(given.len(), stated.len, "{} of {}", stated.name, function.name);
        }
        let mut values: Vec<Vec<f64>> = Vec::with_capacity(function.nodes.len());
        for node in &function.nodes {
            let at = |id: usize, i: usize| -> f64 {
                let of: &[f64] = &values[id];
                of[if of.len() == 1 { 0 } else { i }]
            };
            let all = |of: &dyn Fn(usize) -> f64| (0..node.len).map(of).collect::<Vec<f64>>();
            let value = match &node.op {
                Op::Argument(index) => arguments[*index].to_vec(),
                Op::Constant(numbers) => numbers.clone(),
                Op::Slice { of, start } => values[*of][*start..][..node.len].to_vec(),
                Op::Concat(parts) => parts.iter().flat_map(|&id| values[id].iter().copied()).collect(),
                Op::Affine { weights, bias, x } => affine(weights, bias, &values[*x]),
                Op::Unary(f, x) => all(&|i| f.value(at(*x, i))),
                Op::Binary(f, a, b) => all(&|i| f.value(at(*a, i), at(*b, i))),
                Op::Select { test, a, b, then, otherwise } => {
                    all(&|i| at(if test.holds(at(*a, i), at(*b, i)) { *then } else { *otherwise }, i))
                }
                Op::Product { matrix, x } => {
                    let (matrix, x) = (&values[*matrix], &values[*x]);
                    matrix
                        .chunks_exact(x.len())
                        .map(|row| row.iter().zip(x).map(|(w, x)| w * x).sum())
                        .collect()
                }
                Op::TransposedProduct { matrix, x } => {
                    let (matrix, x) = (&values[*matrix], &values[*x]);
                    (0..node.len)
                        .map(|column| {
                            let of_column = matrix[column..].iter().step_by(node.len);
                            of_column.zip(x).map(|(w, x)| w * x).sum()
                        })
                        .collect()
                }
                Op::Outer { a, b } => {
                    values[*a].iter().flat_map(|a| values[*b].iter().map(move |b| a * b)).collect()
                }
                Op::Median { values: of, votes } => all(&|i| {
                    let mut values: Vec<(f64, u32)> =
                        of.iter().zip(votes).map(|(&id, &votes)| (at(id, i), votes)).collect();
                    hydroid_core::model::committee::weighted_median(&mut values)
                }),
                Op::Call { function, arguments } => {
                    let given: Vec<&[f64]> = arguments.iter().map(|&id| values[id].as_slice()).collect();
                    self.evaluate(*function, &given)
                }
                Op::Repeat { function, times, arguments } => {
                    let mut state = values[arguments[0]].clone();
                    for _ in 0..*times {
                        let others = arguments[1..].iter().map(|&id| values[id].as_slice());
                        let given: Vec<&[f64]> = std::iter::once(state.as_slice()).chain(others).collect();
                        state = self.evaluate(*function, &given);
                    }
                    state
                }
                Op::Gru { cell, x, h } => gru(cell, &values[*x], &values[*h]),
                Op::Lstm { cell, x, c, h } => lstm(cell, &values[*x], &values[*c], &values[*h]),
            };
            assert_eq!(value.len(), node.len, "length of a node of {}", function.name);
            values.push(value);
        }
        values.swap_remove(function.result)
    }
}
