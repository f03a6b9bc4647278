//! A list of terms compiled to a flat program that evaluates shared sub-products once.

use alloc::collections::BTreeMap;
use alloc::vec::Vec;

use super::term::{Factor, Shape, Term};

/// One instruction; the result goes to the next free slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Op {
    /// Product of two slots.
    Mul(u16, u16),
    /// Absolute value of a slot.
    Abs(u16),
}

/// Why a list of terms cannot be compiled.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ProgramError {
    /// A term names a variable that there is not.
    UnknownVariable {
        /// Index of the term in the list.
        term: usize,
        /// The variable it names.
        variable: u16,
        /// How many variables there are.
        variables: usize,
    },
    /// More sub-products than the instruction format can address (65,535).
    TooLarge,
}

impl core::fmt::Display for ProgramError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::UnknownVariable { term, variable, variables } => {
                write!(f, "term {term} uses variable {variable}, but there are only {variables} variables")
            }
            Self::TooLarge => write!(f, "the library needs more than 65,535 sub-products"),
        }
    }
}

impl core::error::Error for ProgramError {}

/// Terms compiled for evaluation.
///
/// Memory layout of the slots: slot 0 holds the constant 1, slots `1..=n` the `n` variables, the rest
/// the sub-products in the order of the instructions. Every term is a slot. A degree-3 monomial costs one
/// multiplication, because its degree-2 part is there already.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    variables: usize,
    ops: Vec<Op>,
    terms: Vec<u16>,
}

impl Program {
    /// Compiles terms over `variables` variables.
    ///
    /// # Errors
    /// If a term names a variable that there is not, or the program grows too large.
    pub fn new(terms: &[Term], variables: usize) -> Result<Self, ProgramError> {
        let mut builder = Builder { variables, ops: Vec::new(), known: BTreeMap::new() };
        let mut slots = Vec::with_capacity(terms.len());
        for (index, term) in terms.iter().enumerate() {
            if let Some(variable) = term.highest_variable().filter(|&v| usize::from(v) >= variables) {
                return Err(ProgramError::UnknownVariable { term: index, variable, variables });
            }
            slots.push(builder.term(term)?);
        }
        Ok(Self { variables, ops: builder.ops, terms: slots })
    }

    /// Number of variables.
    pub fn variables(&self) -> usize {
        self.variables
    }

    /// Number of terms.
    pub fn len(&self) -> usize {
        self.terms.len()
    }

    /// Whether there are no terms.
    pub fn is_empty(&self) -> bool {
        self.terms.is_empty()
    }

    /// Number of slots that [`evaluate`](Self::evaluate) needs.
    pub fn slots(&self) -> usize {
        1 + self.variables + self.ops.len()
    }

    /// The slot that holds a term after evaluation.
    pub fn slot(&self, term: usize) -> usize {
        usize::from(self.terms[term])
    }

    /// Evaluates all terms at one point. The variables stand in `slots[1..=n]`.
    ///
    /// # Panics
    /// If `slots` is shorter than [`slots`](Self::slots).
    #[inline]
    pub fn evaluate(&self, slots: &mut [f64]) {
        let slots = &mut slots[..self.slots()];
        slots[0] = 1.0;
        let first = 1 + self.variables;
        for (index, op) in self.ops.iter().enumerate() {
            slots[first + index] = match *op {
                Op::Mul(a, b) => slots[usize::from(a)] * slots[usize::from(b)],
                Op::Abs(a) => slots[usize::from(a)].abs(),
            };
        }
    }

    /// Evaluates all terms at `rows` points at once: slot `s` of point `i` is `slots[s * rows + i]`, and
    /// the variables stand in slots `1..=n`. Vectorises over the points.
    ///
    /// # Panics
    /// If `slots` is shorter than `self.slots() * rows`.
    pub fn evaluate_block(&self, slots: &mut [f64], rows: usize) {
        let slots = &mut slots[..self.slots() * rows];
        slots[..rows].fill(1.0);
        for (index, op) in self.ops.iter().enumerate() {
            let (known, rest) = slots.split_at_mut((1 + self.variables + index) * rows);
            let result = &mut rest[..rows];
            let column = |slot: u16| &known[usize::from(slot) * rows..][..rows];
            match *op {
                Op::Mul(a, b) => {
                    for ((r, x), y) in result.iter_mut().zip(column(a)).zip(column(b)) {
                        *r = x * y;
                    }
                }
                Op::Abs(a) => {
                    for (r, x) in result.iter_mut().zip(column(a)) {
                        *r = x.abs();
                    }
                }
            }
        }
    }
}

struct Builder {
    variables: usize,
    ops: Vec<Op>,
    known: BTreeMap<(u8, u16, u16), u16>,
}

impl Builder {
    fn term(&mut self, term: &Term) -> Result<u16, ProgramError> {
        let mut slot: Option<u16> = None;
        for &Factor { variable, shape } in term.factors() {
            // Variables are checked against `variables` before, which fits: slots are 16 bit.
            let x = variable.checked_add(1).ok_or(ProgramError::TooLarge)?;
            match shape {
                Shape::Power(n) => {
                    for _ in 0..n {
                        slot = Some(self.times(slot, x)?);
                    }
                }
                Shape::Abs => {
                    let abs = self.push(Op::Abs(x))?;
                    slot = Some(self.times(slot, abs)?);
                }
            }
        }
        Ok(slot.unwrap_or(0))
    }

    fn times(&mut self, slot: Option<u16>, factor: u16) -> Result<u16, ProgramError> {
        slot.map_or(Ok(factor), |slot| self.push(Op::Mul(slot, factor)))
    }

    fn push(&mut self, op: Op) -> Result<u16, ProgramError> {
        let key = match op {
            Op::Mul(a, b) => (0, a, b),
            Op::Abs(a) => (1, a, 0),
        };
        if let Some(&slot) = self.known.get(&key) {
            return Ok(slot);
        }
        let slot = u16::try_from(1 + self.variables + self.ops.len()).map_err(|_| ProgramError::TooLarge)?;
        self.ops.push(op);
        self.known.insert(key, slot);
        Ok(slot)
    }
}
