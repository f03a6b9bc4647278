//! The functions of a model as JSON: what the pages of hydroid compute with.
//!
//! ```text
//! {"functions": [{"nodes": [..], "result": 7}, ..], "start": 2, "step": 1, "output": 3}
//! ```
//!
//! The last three are indices of functions of the [state space](crate::state_space). A node is
//! `{"op": "affine", "len": 3, ..}`: the operation of the [graph](crate::graph), the length of its vector, indices of the nodes it
//! is computed from, and constants. A number that is not finite is a string that the function `Number` of JavaScript reads.

use hydroid::model::Model;
use serde_json::{Value, json};

use crate::graph::{Binary, Cell, Function, Matrix, Module, Node, Op, Test, Unary};
use crate::state_space::StateSpace;

/// The functions of a model with constant weights.
pub(crate) fn functions(model: &Model) -> Value {
    let space = StateSpace::of(model);
    let kept = space.needed(&[space.start, space.step, space.output]);
    let place = |index: usize| kept.iter().position(|&other| other == index);
    let functions: Vec<Value> = kept.iter().map(|&index| function(&space.module, index, &place)).collect();
    json!({
        "functions": functions,
        "start": place(space.start),
        "step": place(space.step),
        "output": place(space.output),
    })
}

fn function(module: &Module, index: usize, place: &impl Fn(usize) -> Option<usize>) -> Value {
    let function: &Function = &module.functions[index];
    let arguments: Vec<usize> = function.arguments.iter().map(|argument| argument.len).collect();
    let nodes: Vec<Value> = function.nodes.iter().map(|of| node(of, place)).collect();
    json!({ "arguments": arguments, "nodes": nodes, "result": function.result })
}

fn node(node: &Node, place: &impl Fn(usize) -> Option<usize>) -> Value {
    let mut value = match &node.op {
        Op::Argument(index) => json!({ "op": "argument", "index": index }),
        Op::Constant(values) => json!({ "op": "constant", "values": numbers(values) }),
        Op::Slice { of, start } => json!({ "op": "slice", "of": of, "start": start }),
        Op::Concat(of) => json!({ "op": "concat", "of": of }),
        Op::Affine { weights, bias, x } => {
            json!({ "op": "affine", "weights": matrix(weights), "bias": numbers(bias), "x": x })
        }
        Op::Unary(f, x) => json!({ "op": unary(*f), "x": x }),
        Op::Binary(f, a, b) => json!({ "op": binary(*f), "a": a, "b": b }),
        Op::Select { test, a, b, then, otherwise } => {
            json!({ "op": "select", "test": of_test(*test), "a": a, "b": b, "then": then, "otherwise": otherwise })
        }
        // Only models that learn have matrices of computed numbers.
        Op::Product { .. } | Op::TransposedProduct { .. } | Op::Outer { .. } => {
            json!({ "op": "of a model that learns" })
        }
        Op::Median { values, votes } => json!({ "op": "median", "of": values, "votes": votes }),
        Op::Call { function, arguments } => {
            json!({ "op": "call", "function": place(*function), "of": arguments })
        }
        Op::Repeat { function, times, arguments } => {
            json!({ "op": "repeat", "function": place(*function), "times": times, "of": arguments })
        }
        Op::Gru { cell, x, h } => json!({ "op": "gru", "cell": of_cell(cell), "x": x, "h": h }),
        Op::Lstm { cell, x, c, h } => {
            json!({ "op": "lstm", "cell": of_cell(cell), "x": x, "c": c, "h": h })
        }
    };
    value["len"] = json!(node.len);
    value
}

fn numbers(values: &[f64]) -> Vec<Value> {
    let number = |&x: &f64| match (x.is_finite(), x.is_nan()) {
        (true, _) => json!(x),
        (false, true) => json!("NaN"),
        (false, false) => json!(if x > 0.0 { "Infinity" } else { "-Infinity" }),
    };
    values.iter().map(number).collect()
}

fn matrix(of: &Matrix) -> Value {
    json!({ "rows": of.rows, "columns": of.columns, "numbers": numbers(&of.numbers) })
}

fn of_cell(cell: &Cell) -> Value {
    json!({
        "weight_ih": matrix(&cell.weight_ih),
        "weight_hh": matrix(&cell.weight_hh),
        "bias_ih": numbers(&cell.bias_ih),
        "bias_hh": numbers(&cell.bias_hh),
    })
}

fn unary(of: Unary) -> &'static str {
    match of {
        Unary::Neg => "neg",
        Unary::Abs => "abs",
        Unary::Sign => "sign",
        Unary::Exp => "exp",
        Unary::Ln => "ln",
        Unary::Sin => "sin",
        Unary::Cos => "cos",
        Unary::Sqrt => "sqrt",
        Unary::Tanh => "tanh",
        Unary::Logistic => "logistic",
    }
}

fn binary(of: Binary) -> &'static str {
    match of {
        Binary::Add => "add",
        Binary::Sub => "sub",
        Binary::Mul => "mul",
        Binary::Div => "div",
        Binary::Min => "min",
        Binary::Max => "max",
    }
}

fn of_test(of: Test) -> &'static str {
    match of {
        Test::Less => "less",
        Test::LessOrEqual => "less_or_equal",
        Test::IsNumber => "is_number",
    }
}
