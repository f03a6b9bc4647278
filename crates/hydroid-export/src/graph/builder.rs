//! Construction of functions with the operators of Rust.

use std::cell::RefCell;
use std::collections::HashMap;
use std::fmt;
use std::ops::{Add, Div, Mul, Neg, Sub};

use hydroid_core::vessel::Number;

use super::{Argument, Binary, Cell, Function, Id, Matrix, Node, Op, Test, Unary};

/// A function under construction. Equal nodes are stored once, and functions of constants are computed at once.
#[derive(Default)]
pub(crate) struct Builder {
    arguments: RefCell<Vec<Argument>>,
    nodes: RefCell<Vec<Node>>,
    known: RefCell<HashMap<String, Id>>,
}

/// A vector of a function under construction.
#[derive(Clone, Copy)]
pub(crate) struct Vector<'a> {
    builder: &'a Builder,
    id: Id,
}

/// A number: a constant, or a vector of length 1.
#[derive(Clone, Copy)]
pub(crate) enum Scalar<'a> {
    Constant(f64),
    Node(Vector<'a>),
}

impl fmt::Debug for Scalar<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Constant(value) => value.fmt(f),
            Self::Node(node) => write!(f, "node {}", node.id),
        }
    }
}

impl Builder {
    pub(crate) fn new() -> Self {
        Self::default()
    }

    /// The next argument of the function.
    pub(crate) fn argument(&self, name: &'static str, len: usize) -> Vector<'_> {
        let mut arguments = self.arguments.borrow_mut();
        arguments.push(Argument { name, len });
        self.node(Op::Argument(arguments.len() - 1), len)
    }

    /// The function with a result.
    pub(crate) fn finish(&self, name: &'static str, about: &'static str, result: Vector<'_>) -> Function {
        let mut function = Function {
            name,
            about,
            arguments: self.arguments.borrow().clone(),
            nodes: self.nodes.borrow().clone(),
            result: result.id,
        };
        prune(&mut function);
        function
    }

    fn node(&self, op: Op, len: usize) -> Vector<'_> {
        // Large constants are compared by their text as well: they occur a few times only.
        let key = format!("{op:?} {len}");
        let mut nodes = self.nodes.borrow_mut();
        let id = *self.known.borrow_mut().entry(key).or_insert_with(|| {
            nodes.push(Node { op, len });
            nodes.len() - 1
        });
        Vector { builder: self, id }
    }

    /// A node of another function, whose operands are at `places`.
    pub(super) fn copy<'a>(&'a self, node: &Node, places: &[Vector<'a>]) -> Vector<'a> {
        let mut op = node.op.clone();
        op.operands_mut().into_iter().for_each(|operand| *operand = places[*operand].id);
        self.node(op, node.len)
    }

    fn len(&self, id: Id) -> usize {
        self.nodes.borrow()[id].len
    }

    fn constant_of(&self, id: Id) -> Option<Vec<f64>> {
        match &self.nodes.borrow()[id].op {
            Op::Constant(numbers) => Some(numbers.clone()),
            _ => None,
        }
    }

    pub(crate) fn constant(&self, numbers: &[f64]) -> Vector<'_> {
        self.node(Op::Constant(numbers.to_vec()), numbers.len())
    }

    /// Vectors one after the other.
    pub(crate) fn concat<'a>(&'a self, parts: &[Vector<'a>]) -> Vector<'a> {
        let mut flat: Vec<Id> = Vec::new();
        for part in parts.iter().filter(|part| part.len() > 0) {
            match &self.nodes.borrow()[part.id].op {
                Op::Concat(parts) => flat.extend(parts),
                _ => flat.push(part.id),
            }
        }
        let flat = self.merged(&flat);
        if let [one] = flat[..] {
            return Vector { builder: self, id: one };
        }
        let len = flat.iter().map(|&id| self.len(id)).sum();
        self.node(Op::Concat(flat), len)
    }

    /// Parts of a concatenation, with slices that follow one another as one.
    fn merged(&self, parts: &[Id]) -> Vec<Id> {
        let slice = |id: Id| match &self.nodes.borrow()[id] {
            Node { op: Op::Slice { of, start }, len } => Some((*of, *start, *len)),
            _ => None,
        };
        let mut merged: Vec<Id> = Vec::new();
        for &part in parts {
            let before = merged.last().and_then(|&id| slice(id));
            match (before, slice(part)) {
                (Some((of, start, len)), Some((same, next, more))) if of == same && next == start + len => {
                    let whole = Vector { builder: self, id: of }.slice(start, len + more);
                    merged.pop();
                    merged.push(whole.id);
                }
                _ => merged.push(part),
            }
        }
        merged
    }

    /// A vector of numbers.
    pub(crate) fn gather<'a>(&'a self, numbers: &[Scalar<'a>]) -> Vector<'a> {
        let parts: Vec<Vector<'_>> = numbers.iter().map(|number| self.vector_of(*number)).collect();
        self.concat(&parts)
    }

    /// A number as a vector of length 1.
    pub(crate) fn vector_of<'a>(&'a self, number: Scalar<'a>) -> Vector<'a> {
        match number {
            Scalar::Constant(value) => self.constant(&[value]),
            Scalar::Node(node) => node,
        }
    }

    /// The weighted median of vectors, element by element.
    pub(crate) fn median<'a>(&'a self, values: &[Vector<'a>], votes: &[u32]) -> Vector<'a> {
        if let [one] = values {
            return *one;
        }
        let len = values[0].len();
        let values = values.iter().map(|value| value.id).collect();
        self.node(Op::Median { values, votes: votes.to_vec() }, len)
    }

    /// The result of a function with a result of length `len`.
    pub(crate) fn call<'a>(&'a self, function: usize, len: usize, arguments: &[Vector<'a>]) -> Vector<'a> {
        let arguments = arguments.iter().map(|argument| argument.id).collect();
        self.node(Op::Call { function, arguments }, len)
    }

    /// The first argument after `times` calls of a function that replace it.
    pub(crate) fn repeat<'a>(
        &'a self,
        function: usize,
        times: usize,
        arguments: &[Vector<'a>],
    ) -> Vector<'a> {
        let len = arguments[0].len();
        if times == 1 {
            return self.call(function, len, arguments);
        }
        let arguments = arguments.iter().map(|argument| argument.id).collect();
        self.node(Op::Repeat { function, times, arguments }, len)
    }
}

/// Removes nodes on which the result does not depend.
fn prune(function: &mut Function) {
    let mut used = vec![false; function.nodes.len()];
    used[function.result] = true;
    for id in (0..function.nodes.len()).rev() {
        if used[id] {
            function.nodes[id].op.operands().into_iter().for_each(|operand| used[operand] = true);
        }
    }
    let mut place = vec![0; used.len()];
    let mut kept = Vec::new();
    for (id, mut node) in std::mem::take(&mut function.nodes).into_iter().enumerate() {
        if used[id] {
            node.op.operands_mut().into_iter().for_each(|operand| *operand = place[*operand]);
            place[id] = kept.len();
            kept.push(node);
        }
    }
    function.result = place[function.result];
    function.nodes = kept;
}

impl Op {
    fn operands_mut(&mut self) -> Vec<&mut Id> {
        match self {
            Self::Argument(_) | Self::Constant(_) => Vec::new(),
            Self::Slice { of: x, .. } | Self::Affine { x, .. } | Self::Unary(_, x) => vec![x],
            Self::Binary(_, a, b)
            | Self::Outer { a, b }
            | Self::Product { matrix: a, x: b }
            | Self::TransposedProduct { matrix: a, x: b } => vec![a, b],
            Self::Select { a, b, then, otherwise, .. } => vec![a, b, then, otherwise],
            Self::Gru { x, h, .. } => vec![x, h],
            Self::Lstm { x, c, h, .. } => vec![x, c, h],
            Self::Concat(of)
            | Self::Median { values: of, .. }
            | Self::Call { arguments: of, .. }
            | Self::Repeat { arguments: of, .. } => of.iter_mut().collect(),
        }
    }
}

impl<'a> Vector<'a> {
    pub(crate) fn len(self) -> usize {
        self.builder.len(self.id)
    }

    /// `len` elements from `start` on.
    pub(crate) fn slice(self, start: usize, len: usize) -> Self {
        if start == 0 && len == self.len() {
            return self;
        }
        let op = self.builder.nodes.borrow()[self.id].op.clone();
        match op {
            Op::Constant(numbers) => self.builder.constant(&numbers[start..start + len]),
            Op::Slice { of, start: first } => self.builder.node(Op::Slice { of, start: first + start }, len),
            Op::Concat(parts) => {
                // The elements of the parts, so that no copy is made.
                let (mut first, mut pieces) = (0, Vec::new());
                for part in parts {
                    let part = Vector { builder: self.builder, id: part };
                    let (from, to) = (start.max(first), (start + len).min(first + part.len()));
                    if from < to {
                        pieces.push(part.slice(from - first, to - from));
                    }
                    first += part.len();
                }
                self.builder.concat(&pieces)
            }
            _ => self.builder.node(Op::Slice { of: self.id, start }, len),
        }
    }

    /// The last `len` elements.
    pub(crate) fn slice_last(self, len: usize) -> Self {
        self.slice(self.len() - len, len)
    }

    pub(crate) fn at(self, index: usize) -> Scalar<'a> {
        let one = self.slice(index, 1);
        match self.builder.constant_of(one.id) {
            Some(numbers) => Scalar::Constant(numbers[0]),
            None => Scalar::Node(one),
        }
    }

    pub(crate) fn elements(self) -> Vec<Scalar<'a>> {
        (0..self.len()).map(|i| self.at(i)).collect()
    }

    pub(crate) fn unary(self, f: Unary) -> Self {
        match self.builder.constant_of(self.id) {
            Some(numbers) => {
                self.builder.constant(&numbers.iter().map(|x| f.value(*x)).collect::<Vec<f64>>())
            }
            None => self.builder.node(Op::Unary(f, self.id), self.len()),
        }
    }

    pub(crate) fn binary(self, f: Binary, other: Self) -> Self {
        let len = self.len().max(other.len());
        if let (Some(a), Some(b)) = (self.builder.constant_of(self.id), self.builder.constant_of(other.id)) {
            let of = |numbers: &[f64], i: usize| numbers[if numbers.len() == 1 { 0 } else { i }];
            let numbers: Vec<f64> = (0..len).map(|i| f.value(of(&a, i), of(&b, i))).collect();
            return self.builder.constant(&numbers);
        }
        self.builder.node(Op::Binary(f, self.id, other.id), len)
    }

    /// Element by element, `then` where the test holds and `otherwise` elsewhere.
    pub(crate) fn select(self, test: Test, b: Self, then: Self, otherwise: Self) -> Self {
        let len = self.len().max(then.len()).max(otherwise.len());
        let op = Op::Select { test, a: self.id, b: b.id, then: then.id, otherwise: otherwise.id };
        self.builder.node(op, len)
    }

    /// This, where it is a number; `otherwise` where it is NaN.
    pub(crate) fn or(self, otherwise: Self) -> Self {
        self.select(Test::IsNumber, self, self, otherwise)
    }

    /// `W x + b`.
    pub(crate) fn affine(self, weights: Matrix, bias: Vec<f64>) -> Self {
        let len = weights.rows;
        self.builder.node(Op::Affine { weights, bias, x: self.id }, len)
    }

    /// `W x` with the matrix `self`, row by row.
    pub(crate) fn product(self, x: Self) -> Self {
        self.builder.node(Op::Product { matrix: self.id, x: x.id }, self.len() / x.len())
    }

    /// `W' x` with the matrix `self`, row by row.
    pub(crate) fn transposed_product(self, x: Self) -> Self {
        self.builder.node(Op::TransposedProduct { matrix: self.id, x: x.id }, self.len() / x.len())
    }

    /// The matrix `a b'` of `self` and `b`, row by row.
    pub(crate) fn outer(self, b: Self) -> Self {
        self.builder.node(Op::Outer { a: self.id, b: b.id }, self.len() * b.len())
    }

    /// The next state of a gated recurrent unit with the input `self`.
    pub(crate) fn gru(self, cell: Cell, h: Self) -> Self {
        self.builder.node(Op::Gru { cell: Box::new(cell), x: self.id, h: h.id }, h.len())
    }

    /// The next `[c m]` of a long short-term memory with the input `self`.
    pub(crate) fn lstm(self, cell: Cell, c: Self, h: Self) -> Self {
        let op = Op::Lstm { cell: Box::new(cell), x: self.id, c: c.id, h: h.id };
        self.builder.node(op, 2 * c.len())
    }
}

impl Scalar<'_> {
    pub(crate) fn unary(self, f: Unary) -> Self {
        match self {
            Self::Constant(value) => Self::Constant(f.value(value)),
            Self::Node(node) => Self::Node(node.unary(f)),
        }
    }

    pub(crate) fn binary(self, f: Binary, other: Self) -> Self {
        let builder = match (self, other) {
            (Self::Constant(a), Self::Constant(b)) => return Self::Constant(f.value(a, b)),
            (Self::Node(node), _) | (_, Self::Node(node)) => node.builder,
        };
        match (f, self, other) {
            // Exact but for the sign of zero, and for the product of zero and a number that is not finite.
            (Binary::Mul, Self::Constant(0.0), _) | (Binary::Mul, _, Self::Constant(0.0)) => {
                Self::Constant(0.0)
            }
            (Binary::Add, Self::Constant(0.0), x)
            | (Binary::Add | Binary::Sub, x, Self::Constant(0.0))
            | (Binary::Mul, Self::Constant(1.0), x)
            | (Binary::Mul | Binary::Div, x, Self::Constant(1.0)) => x,
            _ => Self::Node(builder.vector_of(self).binary(f, builder.vector_of(other))),
        }
    }

    /// `then` where the test of this and `b` holds, else `otherwise`.
    pub(crate) fn select(self, test: Test, b: Self, then: Self, otherwise: Self) -> Self {
        let builder = match (self, b, then, otherwise) {
            (Self::Constant(a), Self::Constant(b), _, _) => {
                return if test.holds(a, b) { then } else { otherwise };
            }
            (Self::Node(node), ..) | (_, Self::Node(node), ..) => node.builder,
        };
        let [a, b, then, otherwise] = [self, b, then, otherwise].map(|x| builder.vector_of(x));
        Self::Node(a.select(test, b, then, otherwise))
    }

    pub(crate) fn min(self, other: Self) -> Self {
        self.binary(Binary::Min, other)
    }

    pub(crate) fn max(self, other: Self) -> Self {
        self.binary(Binary::Max, other)
    }
}

macro_rules! operators {
    ($($name:ident $method:ident)*) => {$(
        impl $name for Scalar<'_> {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                self.binary(Binary::$name, other)
            }
        }
        impl $name<f64> for Scalar<'_> {
            type Output = Self;
            fn $method(self, other: f64) -> Self {
                self.binary(Binary::$name, Self::Constant(other))
            }
        }
        impl $name for Vector<'_> {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                self.binary(Binary::$name, other)
            }
        }
    )*};
}

operators!(Add add Sub sub Mul mul Div div);

impl Neg for Scalar<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        self.unary(Unary::Neg)
    }
}

impl Number for Scalar<'_> {
    fn constant(value: f64) -> Self {
        Self::Constant(value)
    }

    fn abs(self) -> Self {
        self.unary(Unary::Abs)
    }

    fn logistic(self) -> Self {
        self.unary(Unary::Logistic)
    }
}
