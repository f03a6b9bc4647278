//! A function in Python: one line for each node.

use std::fmt::Write as _;

use crate::graph::{Binary, Cell, Function, Id, Matrix, Op, Test, Unary};
use crate::state_space::StateSpace;

/// A literal of a number, with all its digits.
pub(super) fn literal(value: f64) -> String {
    if value.is_nan() {
        String::from("ca.nan")
    } else if value.is_infinite() {
        String::from(if value > 0.0 { "ca.inf" } else { "(-ca.inf)" })
    } else if value.is_sign_negative() {
        format!("({value:?})")
    } else {
        format!("{value:?}")
    }
}

/// Numbers as a list.
fn list(numbers: &[f64]) -> String {
    let numbers: Vec<String> = numbers.iter().map(|number| literal(*number)).collect();
    format!("[{}]", numbers.join(", "))
}

/// Numbers as a column.
fn column(numbers: &[f64]) -> String {
    if numbers.is_empty() { String::from("ca.DM(0, 1)") } else { format!("ca.DM({})", list(numbers)) }
}

fn matrix(matrix: &Matrix) -> String {
    if matrix.numbers.is_empty() {
        return format!("ca.DM({}, {})", matrix.rows, matrix.columns);
    }
    let rows: Vec<String> = (0..matrix.rows).map(|row| list(matrix.row(row))).collect();
    format!("ca.DM([{}])", rows.join(", "))
}

/// Symbols of which a function consists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Symbols {
    /// Graphs of numbers.
    Sx,
    /// Graphs of matrices.
    Mx,
}

/// Symbols of each function of a module.
pub(super) fn symbols(space: &StateSpace) -> Vec<Symbols> {
    let mut all: Vec<Symbols> = Vec::new();
    for function in &space.module.functions {
        let matrices = |op: &Op| match op {
            Op::Affine { .. } | Op::Gru { .. } | Op::Lstm { .. } | Op::Repeat { .. } => true,
            Op::Call { function, .. } => all[*function] == Symbols::Mx,
            _ => false,
        };
        let mx = function.nodes.iter().any(|node| matrices(&node.op));
        all.push(if mx { Symbols::Mx } else { Symbols::Sx });
    }
    all
}

pub(super) struct Printer<'a> {
    pub(super) space: &'a StateSpace,
    pub(super) symbols: Vec<Symbols>,
}

impl Printer<'_> {
    /// Name of a function; those of the state space are public.
    pub(super) fn name(&self, index: usize) -> String {
        match self.role(index) {
            Some((name, _)) => name.to_owned(),
            None => format!("_{}_{index}", self.space.function(index).name),
        }
    }

    /// Name of a function of the state space, and of its result.
    fn role(&self, index: usize) -> Option<(&'static str, &'static str)> {
        let s = self.space;
        let mut roles = vec![
            (s.start, "start", "state"),
            (s.step, "step", "new_state"),
            (s.observe, "observe", "new_state"),
            (s.output, "output", "outputs"),
        ];
        roles.extend(s.rates.map(|rates| (rates, "rates", "rates")));
        if let Some(block) = &s.block {
            roles.extend([(block.predict, "predict", "outputs"), (block.follow, "follow", "new_state")]);
        }
        let (_, name, result) = roles.into_iter().find(|role| role.0 == index)?;
        Some((name, result))
    }

    /// The definition of a function.
    pub(super) fn function(&self, index: usize) -> String {
        let function = self.space.function(index);
        let symbols = match self.symbols[index] {
            Symbols::Sx => "ca.SX",
            Symbols::Mx => "ca.MX",
        };
        let result = self.role(index).map_or("result", |role| role.1);
        let mut text = format!("@_function({symbols}, \"{result}\"");
        for argument in &function.arguments {
            let _ = write!(text, ", {}={}", argument.name, argument.len);
        }
        let arguments: Vec<&str> = function.arguments.iter().map(|argument| argument.name).collect();
        let _ = write!(
            text,
            ")\ndef {}({}):\n    \"\"\"{}.\"\"\"\n",
            self.name(index),
            arguments.join(", "),
            function.about
        );
        for id in 0..function.nodes.len() {
            self.node(function, id, &mut text);
        }
        let _ = writeln!(text, "    return {}", operand(function, function.result));
        text
    }

    fn node(&self, function: &Function, id: Id, text: &mut String) {
        let node = &function.nodes[id];
        let of = |id: &Id| operand(function, *id);
        let joined = |ids: &[Id]| ids.iter().map(of).collect::<Vec<_>>().join(", ");
        let value = match &node.op {
            Op::Argument(_) => return,
            Op::Constant(_) if node.len == 1 => return,
            Op::Constant(numbers) => column(numbers),
            Op::Slice { of: x, start } => match node.len {
                1 => format!("{}[{start}]", of(x)),
                len => format!("{}[{start}:{}]", of(x), start + len),
            },
            Op::Concat(parts) => format!("ca.vertcat({})", joined(parts)),
            Op::Affine { weights, bias, x } => {
                format!("ca.mtimes({}, {}) + {}", matrix(weights), of(x), column(bias))
            }
            Op::Unary(f, x) => unary(*f, &of(x)),
            Op::Binary(f, a, b) => binary(*f, &of(a), &of(b)),
            Op::Select { test, a, b, then, otherwise } => {
                let test = match test {
                    Test::Less => format!("{} < {}", of(a), of(b)),
                    Test::LessOrEqual => format!("{} <= {}", of(a), of(b)),
                    // CasADi takes `x == x` as true; this is false for NaN alone.
                    Test::IsNumber => format!("{} <= ca.inf", of(a)),
                };
                format!("ca.if_else({test}, {}, {})", of(then), of(otherwise))
            }
            Op::Median { values, votes } => {
                let votes: Vec<String> = votes.iter().map(|votes| format!("{votes}")).collect();
                format!("_median([{}], [{}])", joined(values), votes.join(", "))
            }
            Op::Call { function, arguments } => format!("{}({})", self.name(*function), joined(arguments)),
            Op::Repeat { function, times, arguments } => {
                format!("_repeat({}, {times}, {})", self.name(*function), joined(arguments))
            }
            Op::Product { .. } | Op::TransposedProduct { .. } | Op::Outer { .. } => {
                unreachable!(
                    "only a model that learns has weights that are not constants, and only C has such models"
                )
            }
            Op::Gru { cell, x, h } => format!("_gru({}, {})", gates(cell, &of(x), &of(h)), of(h)),
            Op::Lstm { cell, x, c, h } => format!("_lstm({}, {})", gates(cell, &of(x), &of(h)), of(c)),
        };
        let _ = writeln!(text, "    t{id} = {value}");
    }
}

/// A node as an operand.
fn operand(function: &Function, id: Id) -> String {
    match &function.nodes[id].op {
        Op::Argument(index) => function.arguments[*index].name.to_owned(),
        Op::Constant(numbers) if numbers.len() == 1 => literal(numbers[0]),
        _ => format!("t{id}"),
    }
}

fn unary(f: Unary, x: &str) -> String {
    let name = match f {
        Unary::Neg => return format!("-{x}"),
        Unary::Abs => "ca.fabs",
        Unary::Sign => "ca.sign",
        Unary::Exp => "ca.exp",
        Unary::Ln => "ca.log",
        Unary::Sin => "ca.sin",
        Unary::Cos => "ca.cos",
        Unary::Sqrt => "_sqrt",
        Unary::Tanh => "ca.tanh",
        Unary::Logistic => "_logistic",
    };
    format!("{name}({x})")
}

fn binary(f: Binary, a: &str, b: &str) -> String {
    match f {
        Binary::Add => format!("{a} + {b}"),
        Binary::Sub => format!("{a} - {b}"),
        Binary::Mul => format!("{a} * {b}"),
        Binary::Div => format!("{a} / {b}"),
        Binary::Min => format!("ca.fmin({a}, {b})"),
        Binary::Max => format!("ca.fmax({a}, {b})"),
    }
}

/// `W_ih x + b_ih` and `W_hh h + b_hh`.
fn gates(cell: &Cell, x: &str, h: &str) -> String {
    format!(
        "ca.mtimes({}, {x}) + {}, ca.mtimes({}, {h}) + {}",
        matrix(&cell.weight_ih),
        column(&cell.bias_ih),
        matrix(&cell.weight_hh),
        column(&cell.bias_hh)
    )
}
