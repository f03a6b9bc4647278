//! Sums of numbers as products of a row with a column, because a runtime needs the same time for any operator:
//!
//! ```text
//! c + k_1 x_1 + k_2 x_2 + .. = [x_1 x_2 ..] [k_1 k_2 ..]' + c
//! ```

use std::collections::BTreeMap;

use super::nodes::Nodes;
use crate::graph::{Binary, Function, Id, Op, Unary};

/// Fewest terms of a sum that becomes a product: two operators for the product against an operator for each further term.
const FEWEST: usize = 4;

/// A sum of numbers.
#[derive(Debug, Default)]
pub(super) struct Sum {
    constant: f64,
    /// Nodes and their coefficients.
    terms: Vec<(Id, f64)>,
}

/// The sums of a function.
pub(super) struct Sums {
    /// Each sum by the node that it replaces.
    pub(super) of: BTreeMap<Id, Sum>,
    /// Whether a node is read by what is written.
    pub(super) needed: Vec<bool>,
}

impl Sums {
    pub(super) fn new(function: &Function) -> Self {
        let uses = function.uses();
        let (mut of, mut needed) = (BTreeMap::new(), vec![false; function.nodes.len()]);
        needed[function.result] = true;
        for id in (0..function.nodes.len()).rev() {
            if !needed[id] {
                continue;
            }
            let mut sum = Sum::default();
            sum.add(function, &uses, id, 1.0, true);
            if sum.terms.len() < FEWEST {
                function.nodes[id].op.operands().into_iter().for_each(|operand| needed[operand] = true);
            } else {
                sum.terms.iter().for_each(|&(term, _)| needed[term] = true);
                of.insert(id, sum);
            }
        }
        Self { of, needed }
    }
}

impl Sum {
    /// Adds a node, as the terms of its sum if nothing else reads it. Products of sums are not multiplied out.
    fn add(&mut self, function: &Function, uses: &[usize], id: Id, sign: f64, root: bool) {
        let node = &function.nodes[id];
        let number = |id: Id| match &function.nodes[id].op {
            Op::Constant(numbers) if numbers.len() == 1 => Some(numbers[0]),
            _ => None,
        };
        let opened = node.len == 1 && (root || uses[id] == 1);
        match (&node.op, number(id)) {
            (_, Some(constant)) => self.constant += sign * constant,
            (Op::Binary(Binary::Add, a, b), _) if opened => {
                self.add(function, uses, *a, sign, false);
                self.add(function, uses, *b, sign, false);
            }
            (Op::Binary(Binary::Sub, a, b), _) if opened => {
                self.add(function, uses, *a, sign, false);
                self.add(function, uses, *b, -sign, false);
            }
            (Op::Unary(Unary::Neg, x), _) if opened => self.terms.push((*x, -sign)),
            (Op::Binary(Binary::Mul, a, b), _) if opened => match (number(*a), number(*b)) {
                (Some(factor), _) => self.terms.push((*b, sign * factor)),
                (_, Some(factor)) => self.terms.push((*a, sign * factor)),
                _ => self.terms.push((id, sign)),
            },
            _ => self.terms.push((id, sign)),
        }
    }

    /// Writes the sum with the names of the nodes, and gives its name.
    pub(super) fn written(&self, nodes: &mut Nodes, names: &[String]) -> String {
        let terms: Vec<&str> = self.terms.iter().map(|(id, _)| names[*id].as_str()).collect();
        let coefficients: Vec<f64> = self.terms.iter().map(|(_, coefficient)| *coefficient).collect();
        let row = nodes.concat(&terms);
        let column = nodes.numbers(&[coefficients.len(), 1], &coefficients);
        let product = nodes.op("MatMul", &[&row, &column]);
        if self.constant == 0.0 {
            return product;
        }
        let constant = nodes.numbers(&[1], &[self.constant]);
        nodes.op("Add", &[&product, &constant])
    }
}
