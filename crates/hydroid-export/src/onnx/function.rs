//! Functions of a model as functions of ONNX.

use super::nodes::{DOMAIN, Dim, Nodes, graph, integer, real, size, value};
use super::proto::{Function as Written, Graph, OPERATORS, OperatorSet, element};
use super::sums::Sums;
use crate::Precision;
use crate::graph::{Binary, Function, Id, Module, Op, Test, Unary};

/// The operators that models and functions use.
pub(super) fn operator_sets() -> Vec<OperatorSet> {
    let of = |domain: &str, version| OperatorSet { domain: Some(domain.to_owned()), version: Some(version) };
    vec![of("", OPERATORS), of(DOMAIN, 1)]
}

/// Name of a function.
pub(super) fn name(module: &Module, index: usize) -> String {
    format!("f{index}_{}", module.functions[index].name)
}

/// A function while it is written.
struct Body<'a> {
    module: &'a Module,
    function: &'a Function,
    nodes: Nodes,
    /// Names of the values of the nodes; empty for a vector without elements, which ONNX functions do not get.
    names: Vec<String>,
    sums: Sums,
}

/// A function in ONNX. Arguments without elements are left out.
pub(super) fn written(module: &Module, index: usize, precision: Precision) -> Written {
    let function = &module.functions[index];
    let names = vec![String::new(); function.nodes.len()];
    let (nodes, sums) = (Nodes::new("n", precision), Sums::new(function));
    let mut body = Body { module, function, nodes, names, sums };
    for id in 0..function.nodes.len() {
        body.node(id);
    }
    let mut result = body.names[function.result].clone();
    if matches!(function.nodes[function.result].op, Op::Argument(_)) {
        result = body.nodes.op("Identity", &[&result]);
    }
    let arguments = function.arguments.iter().filter(|argument| argument.len > 0);
    Written {
        name: Some(name(module, index)),
        input: arguments.map(|argument| argument.name.to_owned()).collect(),
        output: vec![result],
        node: body.nodes.finish(),
        doc_string: Some(function.about.to_owned()),
        opset_import: operator_sets(),
        domain: Some(DOMAIN.to_owned()),
    }
}

impl Body<'_> {
    fn len(&self, id: Id) -> usize {
        self.function.nodes[id].len
    }

    /// Whether a node is a constant that is a number everywhere.
    fn is_known(&self, id: Id) -> bool {
        matches!(&self.function.nodes[id].op, Op::Constant(numbers) if numbers.iter().all(|x| !x.is_nan()))
    }

    fn node(&mut self, id: Id) {
        let len = self.len(id);
        if len == 0 || !self.sums.needed[id] || !self.names[id].is_empty() {
            return;
        }
        if let Some(sum) = self.sums.of.get(&id) {
            self.names[id] = sum.written(&mut self.nodes, &self.names);
            return;
        }
        let function = self.function;
        let at = |body: &Self, id: &Id| body.names[*id].clone();
        self.names[id] = match &function.nodes[id].op {
            Op::Argument(index) => function.arguments[*index].name.to_owned(),
            Op::Constant(numbers) => self.nodes.numbers(&[len], numbers),
            Op::Slice { of, start } => return self.slices(id, *of, *start),
            Op::Concat(parts) => {
                let parts = self.given(parts);
                self.nodes.concat(&parts.iter().map(String::as_str).collect::<Vec<_>>())
            }
            Op::Affine { weights, bias, x } => {
                let x = at(self, x);
                self.nodes.affine(weights, bias, &x)
            }
            Op::Unary(f, x) => {
                let x = at(self, x);
                self.nodes.op(unary(*f), &[&x])
            }
            Op::Binary(f, a, b) => self.binary(*f, *a, *b),
            Op::Select { test, a, b, then, otherwise } => {
                let [a, b, then, otherwise] = [a, b, then, otherwise].map(|id| at(self, id));
                let (test, then, otherwise) = match test {
                    Test::Less => (self.nodes.op("Less", &[&a, &b]), then, otherwise),
                    Test::LessOrEqual => (self.nodes.op("LessOrEqual", &[&a, &b]), then, otherwise),
                    Test::IsNumber => (self.nodes.op("IsNaN", &[&a]), otherwise, then),
                };
                self.nodes.op("Where", &[&test, &then, &otherwise])
            }
            Op::Median { values, votes } => self.median(values, votes, len),
            Op::Call { function, arguments } => {
                let given = self.given(arguments);
                let given: Vec<&str> = given.iter().map(String::as_str).collect();
                self.nodes.call(&name(self.module, *function), &given)
            }
            Op::Repeat { function, times, arguments } => {
                let given = self.given(arguments);
                self.repeat(*function, *times, &given, len)
            }
            Op::Product { .. } | Op::TransposedProduct { .. } | Op::Outer { .. } => {
                unreachable!(
                    "only a model that learns has weights that are not constants, and only C has such models"
                )
            }
            Op::Gru { cell, x, h } => {
                let [x, h] = [x, h].map(|id| at(self, id));
                self.nodes.gru(cell, &x, &h, len)
            }
            Op::Lstm { cell, x, c, h } => {
                let [x, c, h] = [x, c, h].map(|id| at(self, id));
                self.nodes.lstm(cell, [&x, &c, &h], len / 2)
            }
        };
    }

    /// Names of the vectors that have elements.
    fn given(&self, ids: &[Id]) -> Vec<String> {
        ids.iter().filter(|&&id| self.len(id) > 0).map(|&id| self.names[id].clone()).collect()
    }

    /// A slice. Slices of a vector that do not overlap are all taken at once.
    fn slices(&mut self, id: Id, of: Id, start: usize) {
        let slice = |(id, node): (Id, &crate::graph::Node)| match node.op {
            Op::Slice { of: source, start } if source == of && node.len > 0 && self.sums.needed[id] => {
                Some((start, node.len, id))
            }
            _ => None,
        };
        let mut slices: Vec<(usize, usize, Id)> =
            self.function.nodes.iter().enumerate().filter_map(slice).collect();
        slices.sort_unstable();
        let source = self.names[of].clone();
        let apart = slices.windows(2).all(|pair| pair[0].0 + pair[0].1 <= pair[1].0);
        if slices.len() < 2 || !apart {
            self.names[id] = self.nodes.slice(&source, start, self.len(id));
            return;
        }
        // The vector in parts: slices, and what lies between them.
        let (mut lens, mut places, mut end) = (Vec::new(), Vec::new(), 0);
        for &(start, len, id) in &slices {
            if start > end {
                lens.push(start - end);
            }
            places.push((lens.len(), id));
            lens.push(len);
            end = start + len;
        }
        if end < self.len(of) {
            lens.push(self.len(of) - end);
        }
        let parts = self.nodes.split(&source, &lens);
        for (place, id) in places {
            self.names[id].clone_from(&parts[place]);
        }
    }

    /// A function of two variables. `Min` and `Max` of ONNX give NaN where one of the values is NaN; here, the other value counts.
    fn binary(&mut self, f: Binary, a: Id, b: Id) -> String {
        // A known constant stands second.
        let swap = matches!(f, Binary::Min | Binary::Max) && self.is_known(a);
        let (first, second) = if swap { (b, a) } else { (a, b) };
        let (a, b) = (self.names[first].clone(), self.names[second].clone());
        let comparison = match f {
            Binary::Add => return self.nodes.op("Add", &[&a, &b]),
            Binary::Sub => return self.nodes.op("Sub", &[&a, &b]),
            Binary::Mul => return self.nodes.op("Mul", &[&a, &b]),
            Binary::Div => return self.nodes.op("Div", &[&a, &b]),
            Binary::Min => "Less",
            Binary::Max => "Greater",
        };
        let mut first_counts = self.nodes.op(comparison, &[&a, &b]);
        if !self.is_known(second) {
            let missing = self.nodes.op("IsNaN", &[&b]);
            first_counts = self.nodes.op("Or", &[&first_counts, &missing]);
        }
        self.nodes.op("Where", &[&first_counts, &a, &b])
    }

    /// The weighted median of vectors of length `n`, element by element.
    ///
    /// ```text
    /// x_1 <= x_2 <= ..,  V_k = v_1 + .. + v_k,  V = all votes
    /// median = (x_i + x_j) / 2,  i = 1 + #{k: 2 V_k < V},  j = 1 + #{k: 2 V_k <= V}
    /// ```
    ///
    /// All votes are positive, so `2 V_K > V` for the last one, and `j` is at most its index.
    fn median(&mut self, values: &[Id], votes: &[u32], n: usize) -> String {
        let count = values.len();
        let given = self.given(values);
        let nodes = &mut self.nodes;
        let all: i64 = votes.iter().map(|&votes| i64::from(votes)).sum();
        let rows = nodes.concat(&given.iter().map(String::as_str).collect::<Vec<_>>());
        let rows = nodes.reshape(&rows, &[size(count), size(n)]);
        let (missing, infinite) = (nodes.op("IsNaN", &[&rows]), nodes.numbers(&[1], &[f64::INFINITY]));
        let rows = nodes.op("Where", &[&missing, &infinite, &rows]);
        let (sorted, order, most) = (nodes.fresh(), nodes.fresh(), nodes.sizes(&[count]));
        let attributes = vec![integer("axis", 0), integer("largest", 0), integer("sorted", 1)];
        nodes.push("TopK", &[&rows, &most], &[&sorted, &order], attributes);
        let doubled: Vec<i64> = votes.iter().map(|&votes| 2 * i64::from(votes)).collect();
        let (doubled, all) = (nodes.integers(&[count], &doubled), nodes.integers(&[1], &[all]));
        let votes = nodes.op_with("Gather", &[&doubled, &order], vec![integer("axis", 0)]);
        let axis = nodes.integers(&[], &[0]);
        let below = nodes.op("CumSum", &[&votes, &axis]);
        let axis = nodes.sizes(&[0]);
        let [low, high] = ["Less", "LessOrEqual"].map(|comparison| {
            let before = nodes.op(comparison, &[&below, &all]);
            let before = nodes.op_with("Cast", &[&before], vec![integer("to", i64::from(element::INT64))]);
            let place = nodes.op("ReduceSum", &[&before, &axis]);
            nodes.op_with("GatherElements", &[&sorted, &place], vec![integer("axis", 0)])
        });
        let (sum, half) = (nodes.op("Add", &[&low, &high]), nodes.numbers(&[1], &[0.5]));
        let median = nodes.op("Mul", &[&half, &sum]);
        nodes.reshape(&median, &[size(n)])
    }

    /// Calls of a function that replace its first argument: `Loop`. The other arguments are read from outside of its body.
    fn repeat(&mut self, function: usize, times: usize, given: &[String], len: usize) -> String {
        let prefix = format!("{}_", self.nodes.fresh());
        let [count, open, next, state] =
            ["count", "open", "next", "state"].map(|name| format!("{prefix}{name}"));
        let mut inside = Nodes::new(&prefix, self.nodes.precision);
        let arguments: Vec<&str> =
            std::iter::once(state.as_str()).chain(given[1..].iter().map(String::as_str)).collect();
        let result = inside.call(&name(self.module, function), &arguments);
        inside.push("Identity", &[&open], &[&next], Vec::new());
        let of = |name: &str, elements, dims: &[Dim]| value(name, elements, dims, "");
        let numbers = real(self.nodes.precision);
        let body = Graph {
            node: inside.finish(),
            name: Some(String::from("body")),
            doc_string: None,
            input: vec![
                of(&count, element::INT64, &[]),
                of(&open, element::BOOL, &[]),
                of(&state, numbers, &[Dim::Of(len)]),
            ],
            output: vec![of(&next, element::BOOL, &[]), of(&result, numbers, &[Dim::Of(len)])],
        };
        let times = self.nodes.integers(&[], &[size(times)]);
        self.nodes.op_with("Loop", &[&times, "", &given[0]], vec![graph("body", body)])
    }
}

fn unary(f: Unary) -> &'static str {
    match f {
        Unary::Neg => "Neg",
        Unary::Abs => "Abs",
        Unary::Sign => "Sign",
        Unary::Exp => "Exp",
        Unary::Ln => "Log",
        Unary::Sin => "Sin",
        Unary::Cos => "Cos",
        Unary::Sqrt => "Sqrt",
        Unary::Tanh => "Tanh",
        Unary::Logistic => "Sigmoid",
    }
}
