//! A function of a graph in Python.
//!
//! Functions that call no others are built of scalar expressions (SX), which are fast to evaluate and to differentiate; others
//! of matrix expressions (MX), which keep the calls.

use std::fmt::Write as _;

use crate::graph::{Binary, Cell, Function, Id, Matrix, Module, Op, Test, Unary};

/// Calls of a repeated function that are written one after the other; more are folded.
const UNROLLED: usize = 4;

/// Name of a function in the file.
pub(super) fn name(module: &Module, index: usize) -> String {
    format!("f{index}_{}", module.functions[index].name)
}

fn numbers(numbers: &[f64]) -> String {
    let list: Vec<String> = numbers.iter().map(|x| format!("{x:?}")).collect();
    format!("ca.DM([{}])", list.join(", "))
}

fn matrix(matrix: &Matrix) -> String {
    let rows = (0..matrix.rows).map(|row| {
        let row: Vec<String> = matrix.row(row).iter().map(|x| format!("{x:?}")).collect();
        format!("[{}]", row.join(", "))
    });
    format!("ca.DM([{}])", rows.collect::<Vec<String>>().join(", "))
}

/// A function that builds the `casadi.Function`, and its call.
pub(super) fn function(module: &Module, index: usize) -> String {
    let function = &module.functions[index];
    let name = name(module, index);
    let kind = if function.nodes.iter().any(|node| node.op.called().is_some()) { "MX" } else { "SX" };
    let mut text = format!("def _{name}():\n    \"\"\"{}.\"\"\"\n", function.about);
    for argument in &function.arguments {
        let _ = writeln!(text, "    {0} = ca.{kind}.sym(\"{0}\", {1})", argument.name, argument.len);
    }
    for (id, node) in function.nodes.iter().enumerate() {
        if let Op::Argument(argument) = node.op {
            let _ = writeln!(text, "    t{id} = {}", function.arguments[argument].name);
        } else {
            let _ = writeln!(text, "    t{id} = {}", expression(module, function, id));
        }
    }
    let arguments: Vec<&str> = function.arguments.iter().map(|argument| argument.name).collect();
    let labels: Vec<String> = arguments.iter().map(|name| format!("\"{name}\"")).collect();
    // A constant result has no symbols.
    let _ = write!(
        text,
        "    result = ca.{kind}(t{})\n    return ca.Function(\"{name}\", [{}], [result], [{}], [\"result\"])\n\n\n{name} = _{name}()\n",
        function.result,
        arguments.join(", "),
        labels.join(", "),
    );
    text
}

fn t(id: Id) -> String {
    format!("t{id}")
}

fn all(ids: &[Id]) -> String {
    ids.iter().map(|id| t(*id)).collect::<Vec<String>>().join(", ")
}

fn expression(module: &Module, function: &Function, id: Id) -> String {
    let node = &function.nodes[id];
    match &node.op {
        Op::Argument(argument) => function.arguments[*argument].name.to_owned(),
        Op::Constant(values) if values.len() == 1 => format!("{:?}", values[0]),
        Op::Constant(values) => numbers(values),
        Op::Slice { of, start } => format!("t{of}[{start}:{}]", start + node.len),
        Op::Concat(parts) => format!("ca.vertcat({})", all(parts)),
        Op::Affine { weights, bias, x } => {
            format!("ca.mtimes({}, t{x}) + {}", matrix(weights), numbers(bias))
        }
        Op::Unary(f, x) => unary(*f, &t(*x)),
        Op::Binary(f, a, b) => match f {
            Binary::Add => format!("t{a} + t{b}"),
            Binary::Sub => format!("t{a} - t{b}"),
            Binary::Mul => format!("t{a} * t{b}"),
            Binary::Div => format!("t{a} / t{b}"),
            Binary::Min => format!("ca.fmin(t{a}, t{b})"),
            Binary::Max => format!("ca.fmax(t{a}, t{b})"),
        },
        Op::Select { test, a, b, then, otherwise } => {
            let test = match test {
                Test::Less => format!("t{a} < t{b}"),
                Test::LessOrEqual => format!("t{a} <= t{b}"),
                Test::IsNumber => format!("_is_number(t{a})"),
            };
            format!("_select({test}, t{then}, t{otherwise}, {})", node.len)
        }
        Op::Median { values, votes } => {
            let votes: Vec<String> = votes.iter().map(u32::to_string).collect();
            format!("_median([{}], [{}])", all(values), votes.join(", "))
        }
        Op::Call { function, arguments } => format!("{}({})", name(module, *function), all(arguments)),
        Op::Repeat { function, times, arguments } => {
            let repeat = if *times <= UNROLLED { "_repeat" } else { "_fold" };
            format!("{repeat}({}, {times}, {})", name(module, *function), all(arguments))
        }
        Op::Gru { cell, x, h } => format!("_gru({}, t{x}, t{h})", weights(cell)),
        Op::Lstm { cell, x, c, h } => format!("_lstm({}, t{x}, t{c}, t{h})", weights(cell)),
    }
}

fn weights(cell: &Cell) -> String {
    format!(
        "{}, {}, {}, {}",
        matrix(&cell.weight_ih),
        numbers(&cell.bias_ih),
        matrix(&cell.weight_hh),
        numbers(&cell.bias_hh)
    )
}

fn unary(f: Unary, x: &str) -> String {
    let name = match f {
        Unary::Neg => return format!("-{x}"),
        Unary::Logistic => return format!("_logistic({x})"),
        Unary::Abs => "fabs",
        Unary::Sign => "sign",
        Unary::Exp => "exp",
        Unary::Ln => "log",
        Unary::Sin => "sin",
        Unary::Cos => "cos",
        Unary::Sqrt => "sqrt",
        Unary::Tanh => "tanh",
    };
    format!("ca.{name}({x})")
}
