//! A model as functions of vectors: the common form behind the formats that contain equations.
//!
//! A [`Function`] is a list of [`Node`]s in the order of evaluation. Each node is a vector that is computed from earlier nodes
//! by an [`Op`]. Functions call only earlier functions of their [`Module`]. A printer of a format writes each `Op` in its
//! language; [`evaluate`](Module::evaluate) computes them in `f64`.

mod builder;
mod derivative;
mod evaluate;

pub(crate) use builder::{Builder, Scalar, Vector};
pub(crate) use derivative::vector_jacobian_product;

/// Index of a node in its function.
pub(crate) type Id = usize;

/// A function of one variable, element by element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Unary {
    Neg,
    Abs,
    /// -1, 0 or 1.
    Sign,
    Exp,
    Ln,
    Sin,
    Cos,
    Sqrt,
    Tanh,
    /// `1 / (1 + exp(-x))`.
    Logistic,
}

/// A function of two variables, element by element; a vector of one number stands for all elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    Min,
    Max,
}

/// A comparison, element by element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Test {
    /// `a < b`; false for NaN.
    Less,
    /// `a <= b`; false for NaN.
    LessOrEqual,
    /// `a` is a number, not NaN; `b` has no effect.
    IsNumber,
}

/// A matrix of constants, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Matrix {
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) numbers: Vec<f64>,
}

impl Matrix {
    pub(crate) fn row(&self, row: usize) -> &[f64] {
        &self.numbers[row * self.columns..][..self.columns]
    }
}

/// Weights of a layer of a recurrent network, in PyTorch's order of the gates.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cell {
    pub(crate) weight_ih: Matrix,
    pub(crate) weight_hh: Matrix,
    pub(crate) bias_ih: Vec<f64>,
    pub(crate) bias_hh: Vec<f64>,
}

/// How a node is computed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Op {
    /// An argument of the function.
    Argument(usize),
    Constant(Vec<f64>),
    /// Consecutive elements from `start` on.
    Slice {
        of: Id,
        start: usize,
    },
    Concat(Vec<Id>),
    /// `W x + b`.
    Affine {
        weights: Matrix,
        bias: Vec<f64>,
        x: Id,
    },
    Unary(Unary, Id),
    Binary(Binary, Id, Id),
    /// `then` where the test of `a` and `b` holds, `otherwise` elsewhere.
    Select {
        test: Test,
        a: Id,
        b: Id,
        then: Id,
        otherwise: Id,
    },
    /// `W x` with a matrix that is a vector, row by row. Only models that learn have such matrices.
    Product {
        matrix: Id,
        x: Id,
    },
    /// `W' x`.
    TransposedProduct {
        matrix: Id,
        x: Id,
    },
    /// `a b'`, row by row.
    Outer {
        a: Id,
        b: Id,
    },
    /// Element by element, the weighted median of vectors: half of the votes are below it, half above. A value that is not a
    /// number counts as infinite.
    Median {
        values: Vec<Id>,
        votes: Vec<u32>,
    },
    /// Result of another function.
    Call {
        function: usize,
        arguments: Vec<Id>,
    },
    /// The first argument after `times` calls of a function that replace it.
    Repeat {
        function: usize,
        times: usize,
        arguments: Vec<Id>,
    },
    /// The next state `h` of a gated recurrent unit.
    Gru {
        cell: Box<Cell>,
        x: Id,
        h: Id,
    },
    /// The next state `[c m]` of a long short-term memory, `m` before a projection, from `c` and the visible state `h`.
    Lstm {
        cell: Box<Cell>,
        x: Id,
        c: Id,
        h: Id,
    },
}

/// A vector in a function.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    pub(crate) op: Op,
    pub(crate) len: usize,
}

/// An argument of a function.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Argument {
    /// An identifier.
    pub(crate) name: &'static str,
    pub(crate) len: usize,
}

/// A function of vectors with one vector as its result.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Function {
    /// An identifier.
    pub(crate) name: &'static str,
    /// What it computes, in one line of plain text.
    pub(crate) about: &'static str,
    pub(crate) arguments: Vec<Argument>,
    pub(crate) nodes: Vec<Node>,
    pub(crate) result: Id,
}

impl Function {
    /// Length of the result.
    pub(crate) fn len(&self) -> usize {
        self.nodes[self.result].len
    }

    /// Number of uses of each node by others and as the result.
    pub(crate) fn uses(&self) -> Vec<usize> {
        let mut uses = vec![0; self.nodes.len()];
        uses[self.result] += 1;
        for node in &self.nodes {
            node.op.operands().into_iter().for_each(|id| uses[id] += 1);
        }
        uses
    }
}

impl Op {
    /// The nodes from which this one is computed.
    pub(crate) fn operands(&self) -> Vec<Id> {
        match self {
            Self::Argument(_) | Self::Constant(_) => Vec::new(),
            Self::Slice { of: x, .. } | Self::Affine { x, .. } | Self::Unary(_, x) => vec![*x],
            Self::Binary(_, a, b)
            | Self::Outer { a, b }
            | Self::Product { matrix: a, x: b }
            | Self::TransposedProduct { matrix: a, x: b } => vec![*a, *b],
            Self::Select { a, b, then, otherwise, .. } => vec![*a, *b, *then, *otherwise],
            Self::Gru { x, h, .. } => vec![*x, *h],
            Self::Lstm { x, c, h, .. } => vec![*x, *c, *h],
            Self::Concat(of)
            | Self::Median { values: of, .. }
            | Self::Call { arguments: of, .. }
            | Self::Repeat { arguments: of, .. } => of.clone(),
        }
    }
}

impl Op {
    /// The function that is called.
    pub(crate) fn called(&self) -> Option<usize> {
        match self {
            Self::Call { function, .. } | Self::Repeat { function, .. } => Some(*function),
            _ => None,
        }
    }
}

/// Functions, each of which calls earlier ones only.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Module {
    pub(crate) functions: Vec<Function>,
}

impl Module {
    /// Adds a function, and gives its index.
    pub(crate) fn add(&mut self, function: Function) -> usize {
        self.functions.push(function);
        self.functions.len() - 1
    }
}
