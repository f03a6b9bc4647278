//! Derivatives of functions by reverse-mode differentiation.

use super::{Binary, Builder, Function, Op, Test, Unary, Vector};

/// A contribution to the adjoint of a node: of the elements from `start` on.
struct Part<'a> {
    start: usize,
    adjoint: Vector<'a>,
}

/// The vector-Jacobian product of a function `r = f(a_1, a_2, ..)`:
///
/// ```text
/// (a_1, a_2, .., v) -> [v' dr/da_i, v' dr/da_j, ..]
/// ```
///
/// with the indices `of` of the arguments `i, j, ..`. The function calls no others, and has the operations of a network
/// whose weights are arguments.
pub(crate) fn vector_jacobian_product(
    function: &Function,
    of: &[usize],
    name: &'static str,
    about: &'static str,
) -> Function {
    let b = Builder::new();
    let arguments: Vec<Vector<'_>> =
        function.arguments.iter().map(|argument| b.argument(argument.name, argument.len)).collect();
    let of_result = b.argument("adjoint", function.len());
    let mut values: Vec<Vector<'_>> = Vec::with_capacity(function.nodes.len());
    for node in &function.nodes {
        values.push(b.copy(node, &values));
    }
    let mut parts: Vec<Vec<Part<'_>>> = function.nodes.iter().map(|_| Vec::new()).collect();
    parts[function.result].push(Part { start: 0, adjoint: of_result });
    let mut of_arguments: Vec<Vector<'_>> =
        arguments.iter().map(|argument| b.constant(&vec![0.0; argument.len()])).collect();
    for (id, node) in function.nodes.iter().enumerate().rev() {
        let own = std::mem::take(&mut parts[id]);
        if own.is_empty() {
            continue;
        }
        let adjoint = total(&b, &own, node.len);
        if let Op::Argument(index) = node.op {
            of_arguments[index] = adjoint;
        }
        for (operand, start, adjoint) in pull_back(&b, &node.op, &values, values[id], adjoint) {
            // A number that stands for all elements of a vector.
            let broadcast = function.nodes[operand].len == 1 && adjoint.len() > 1;
            let adjoint = if broadcast { sum(&b, adjoint) } else { adjoint };
            parts[operand].push(Part { start, adjoint });
        }
    }
    let chosen: Vec<Vector<'_>> = of.iter().map(|&index| of_arguments[index]).collect();
    b.finish(name, about, b.concat(&chosen))
}

fn sum<'a>(b: &'a Builder, x: Vector<'a>) -> Vector<'a> {
    b.constant(&vec![1.0; x.len()]).product(x)
}

/// The sum of parts; elements without a part are zero.
fn total<'a>(b: &'a Builder, parts: &[Part<'a>], len: usize) -> Vector<'a> {
    let mut ends: Vec<usize> =
        parts.iter().flat_map(|part| [part.start, part.start + part.adjoint.len()]).chain([0, len]).collect();
    ends.sort_unstable();
    ends.dedup();
    let piece = |ends: &[usize]| {
        let (start, len) = (ends[0], ends[1] - ends[0]);
        let covers = |part: &&Part<'_>| part.start <= start && ends[1] <= part.start + part.adjoint.len();
        let pieces = parts.iter().filter(covers).map(|part| part.adjoint.slice(start - part.start, len));
        pieces.reduce(|a, b| a + b).unwrap_or_else(|| b.constant(&vec![0.0; len]))
    };
    b.concat(&ends.windows(2).map(piece).collect::<Vec<_>>())
}

/// Contributions of a node to the adjoints of its operands: operand, first element, adjoint.
fn pull_back<'a>(
    b: &'a Builder,
    op: &Op,
    values: &[Vector<'a>],
    value: Vector<'a>,
    adjoint: Vector<'a>,
) -> Vec<(usize, usize, Vector<'a>)> {
    let number = |x: f64| b.constant(&[x]);
    match op {
        Op::Argument(_) | Op::Constant(_) => Vec::new(),
        Op::Slice { of, start } => vec![(*of, *start, adjoint)],
        Op::Concat(parts) => {
            let mut start = 0;
            let mut slice = |part: &usize| {
                let len = values[*part].len();
                start += len;
                (*part, 0, adjoint.slice(start - len, len))
            };
            parts.iter().map(&mut slice).collect()
        }
        Op::Affine { weights, x, .. } => {
            vec![(*x, 0, b.constant(&weights.numbers).transposed_product(adjoint))]
        }
        Op::Product { matrix, x } => vec![
            (*matrix, 0, adjoint.outer(values[*x])),
            (*x, 0, values[*matrix].transposed_product(adjoint)),
        ],
        Op::Unary(f, x) => {
            let slope = slope(b, *f, values[*x], value);
            slope.map(|slope| (*x, 0, adjoint * slope)).into_iter().collect()
        }
        Op::Binary(f, x, y) => {
            let (of_x, of_y) = (values[*x], values[*y]);
            let [of_x, of_y] = match f {
                Binary::Add => [adjoint, adjoint],
                Binary::Sub => [adjoint, adjoint.unary(Unary::Neg)],
                Binary::Mul => [adjoint * of_y, adjoint * of_x],
                Binary::Div => [adjoint / of_y, (adjoint * value / of_y).unary(Unary::Neg)],
                Binary::Min => choice(of_x, of_y, adjoint, number(0.0)),
                Binary::Max => choice(of_y, of_x, adjoint, number(0.0)),
            };
            vec![(*x, 0, of_x), (*y, 0, of_y)]
        }
        Op::Select { test, a, b: with, then, otherwise } => {
            let (a, with, zero) = (values[*a], values[*with], number(0.0));
            vec![
                (*then, 0, a.select(*test, with, adjoint, zero)),
                (*otherwise, 0, a.select(*test, with, zero, adjoint)),
            ]
        }
        Op::TransposedProduct { .. }
        | Op::Outer { .. }
        | Op::Median { .. }
        | Op::Call { .. }
        | Op::Repeat { .. }
        | Op::Gru { .. }
        | Op::Lstm { .. } => unreachable!("no network with weights as arguments contains this: {op:?}"),
    }
}

/// The adjoint where `x <= y`, and where not; zero elsewhere.
fn choice<'a>(x: Vector<'a>, y: Vector<'a>, adjoint: Vector<'a>, zero: Vector<'a>) -> [Vector<'a>; 2] {
    [x.select(Test::LessOrEqual, y, adjoint, zero), x.select(Test::LessOrEqual, y, zero, adjoint)]
}

/// Derivative of `f` at `x` with the value `y`; none if it is zero.
fn slope<'a>(b: &'a Builder, f: Unary, x: Vector<'a>, y: Vector<'a>) -> Option<Vector<'a>> {
    let number = |x: f64| b.constant(&[x]);
    Some(match f {
        Unary::Neg => number(-1.0),
        Unary::Abs => x.unary(Unary::Sign),
        Unary::Sign => return None,
        Unary::Exp => y,
        Unary::Ln => number(1.0) / x,
        Unary::Sin => x.unary(Unary::Cos),
        Unary::Cos => x.unary(Unary::Sin).unary(Unary::Neg),
        Unary::Sqrt => number(0.5) / y,
        Unary::Tanh => number(1.0) - y * y,
        Unary::Logistic => y * (number(1.0) - y),
    })
}
