//! Terms compiled to a flat program that evaluates shared sub-products once.

use alloc::collections::BTreeMap;
use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::shape::{Gate, Shape, sign};
use super::term::{Factor, Term};

/// Reasons why terms cannot be compiled.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum ProgramError {
    #[error("term {term} uses variable {variable}, but there are only {variables} variables")]
    UnknownVariable { term: usize, variable: u16, variables: usize },
    #[error("term {term} has a parameter that is not a finite number")]
    Parameter { term: usize },
    #[error("the library needs more than 65,535 sub-products")]
    TooLarge,
}

/// Terms compiled for evaluation.
///
/// Slot 0 holds the constant 1, slots `1..=n` the `n` variables, then come the functions of single variables, and the
/// products, each of two earlier slots. Every term is a slot. A degree-3 monomial costs one multiplication more than
/// its degree-2 part. Functions and products of *held* variables alone come before the others, so that an integrator
/// evaluates them once for several stages under the same command.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    variables: usize,
    functions: Vec<(Function, u16)>,
    products: Vec<(u16, u16)>,
    held_functions: usize,
    held_products: usize,
    terms: Vec<u16>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Function {
    Abs,
    Sign,
    Sin,
    Cos,
    Reciprocal,
    Log,
    Above(Gate),
    /// `1 - x`: the weight below a gate, from the weight above.
    Complement,
}

impl Function {
    #[inline]
    fn of(self, x: f64) -> f64 {
        match self {
            Self::Abs => x.abs(),
            Self::Sign => sign(x),
            Self::Sin => Float::sin(x),
            Self::Cos => Float::cos(x),
            Self::Reciprocal => 1.0 / x,
            Self::Log => Float::ln(x),
            Self::Above(gate) => gate.above(x),
            Self::Complement => 1.0 - x,
        }
    }
}

impl Program {
    /// Compiles terms over `variables` variables, none of them held.
    ///
    /// # Errors
    /// If a term names an unknown variable, or the program grows too large.
    pub fn new(terms: &[Term], variables: usize) -> Result<Self, ProgramError> {
        Self::with_held(terms, &vec![false; variables])
    }

    /// Compiles terms over variables, some of them held.
    ///
    /// # Errors
    /// If a term names an unknown variable, or the program grows too large.
    pub fn with_held(terms: &[Term], held: &[bool]) -> Result<Self, ProgramError> {
        let variables = held.len();
        for (index, term) in terms.iter().enumerate() {
            if let Some(variable) = term.highest_variable().filter(|&v| usize::from(v) >= variables) {
                return Err(ProgramError::UnknownVariable { term: index, variable, variables });
            }
            if term.factors().iter().any(|factor| !factor.shape.is_finite()) {
                return Err(ProgramError::Parameter { term: index });
            }
        }
        let mut builder = Builder { variables, ..Builder::default() };
        // Functions first, those of held variables in front: products refer to their slots.
        let factors = || terms.iter().flat_map(Term::factors);
        for factor in factors().filter(|f| held[usize::from(f.variable)]) {
            builder.function_of(*factor)?;
        }
        let held_functions = builder.functions.len();
        for factor in factors() {
            builder.function_of(*factor)?;
        }
        let mut slots = vec![0; terms.len()];
        for (slot, term) in slots.iter_mut().zip(terms).filter(|(_, term)| is_held(term, held)) {
            *slot = builder.term(term)?;
        }
        let held_products = builder.products.len();
        for (slot, term) in slots.iter_mut().zip(terms).filter(|(_, term)| !is_held(term, held)) {
            *slot = builder.term(term)?;
        }
        let Builder { functions, products, .. } = builder;
        Ok(Self { variables, functions, products, held_functions, held_products, terms: slots })
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

    /// Number of slots of [`evaluate`](Self::evaluate).
    pub fn slots(&self) -> usize {
        self.first_product() + self.products.len()
    }

    /// The slot of a term after evaluation.
    pub fn slot(&self, term: usize) -> usize {
        usize::from(self.terms[term])
    }

    fn first_product(&self) -> usize {
        1 + self.variables + self.functions.len()
    }

    /// Evaluates all terms at the variables in `slots[1..=n]`.
    ///
    /// # Panics
    /// If `slots` is shorter than [`slots`](Self::slots).
    #[inline]
    pub fn evaluate(&self, slots: &mut [f64]) {
        self.evaluate_held(slots);
        self.evaluate_moving(slots);
    }

    /// The part of [`evaluate`](Self::evaluate) that depends on held variables alone.
    ///
    /// # Panics
    /// If `slots` is shorter than [`slots`](Self::slots).
    #[inline]
    pub fn evaluate_held(&self, slots: &mut [f64]) {
        slots[0] = 1.0;
        self.take_functions(slots, 0, self.held_functions);
        self.multiply(slots, 0, self.held_products);
    }

    /// The other part of [`evaluate`](Self::evaluate), after [`evaluate_held`](Self::evaluate_held).
    ///
    /// # Panics
    /// If `slots` is shorter than [`slots`](Self::slots).
    #[inline]
    pub fn evaluate_moving(&self, slots: &mut [f64]) {
        self.take_functions(slots, self.held_functions, self.functions.len());
        self.multiply(slots, self.held_products, self.products.len());
    }

    #[inline]
    fn take_functions(&self, slots: &mut [f64], from: usize, to: usize) {
        let first = 1 + self.variables;
        for (index, &(function, a)) in (from..to).zip(&self.functions[from..to]) {
            slots[first + index] = function.of(slots[usize::from(a)]);
        }
    }

    #[inline]
    fn multiply(&self, slots: &mut [f64], from: usize, to: usize) {
        let slots = &mut slots[..self.slots()];
        let first = self.first_product();
        for (index, &(a, b)) in (from..to).zip(&self.products[from..to]) {
            slots[first + index] = slots[usize::from(a)] * slots[usize::from(b)];
        }
    }

    /// Evaluates all terms at `rows` points at once, vectorised over the points: slot `s` of point `i` is
    /// `slots[s * rows + i]`, with the variables in slots `1..=n`.
    ///
    /// # Panics
    /// If `slots` is shorter than `self.slots() * rows`.
    pub fn evaluate_block(&self, slots: &mut [f64], rows: usize) {
        let slots = &mut slots[..self.slots() * rows];
        slots[..rows].fill(1.0);
        for (index, &(function, a)) in self.functions.iter().enumerate() {
            let (known, rest) = slots.split_at_mut((1 + self.variables + index) * rows);
            for (r, x) in rest[..rows].iter_mut().zip(&known[usize::from(a) * rows..][..rows]) {
                *r = function.of(*x);
            }
        }
        for (index, &(a, b)) in self.products.iter().enumerate() {
            let (known, rest) = slots.split_at_mut((self.first_product() + index) * rows);
            let column = |slot: u16| &known[usize::from(slot) * rows..][..rows];
            for ((r, x), y) in rest[..rows].iter_mut().zip(column(a)).zip(column(b)) {
                *r = x * y;
            }
        }
    }
}

impl Program {
    /// The functions of [`evaluate_block`](Self::evaluate_block), of held variables or of the others. Gates use the
    /// vector function [`sigmoid`](crate::math::sigmoid).
    pub(super) fn block_functions(&self, slots: &mut [f64], rows: usize, held: bool) {
        let range = if held { 0..self.held_functions } else { self.held_functions..self.functions.len() };
        for index in range {
            let (function, a) = self.functions[index];
            let (known, rest) = slots.split_at_mut((1 + self.variables + index) * rows);
            let (into, from) = (&mut rest[..rows], &known[usize::from(a) * rows..][..rows]);
            if let Function::Above(gate) = function {
                for (r, x) in into.iter_mut().zip(from) {
                    *r = gate.slope.0 * (x - gate.centre.0);
                }
                crate::math::sigmoid(into);
            } else {
                for (r, x) in into.iter_mut().zip(from) {
                    *r = function.of(*x);
                }
            }
        }
    }

    #[allow(clippy::inline_always)] // inlined into functions compiled for the processor
    #[inline(always)]
    pub(super) fn block_products(&self, slots: &mut [f64], rows: usize, held: bool) {
        let range = if held { 0..self.held_products } else { self.held_products..self.products.len() };
        for index in range {
            let (a, b) = self.products[index];
            let (known, rest) = slots.split_at_mut((self.first_product() + index) * rows);
            let column = |slot: u16| &known[usize::from(slot) * rows..][..rows];
            for ((r, x), y) in rest[..rows].iter_mut().zip(column(a)).zip(column(b)) {
                *r = x * y;
            }
        }
    }
}

/// Whether a term depends on held variables alone; true for the constant.
pub(super) fn is_held(term: &Term, held: &[bool]) -> bool {
    term.factors().iter().all(|factor| held[usize::from(factor.variable)])
}

#[derive(Default)]
struct Builder {
    variables: usize,
    functions: Vec<(Function, u16)>,
    products: Vec<(u16, u16)>,
    known_functions: BTreeMap<Factor, u16>,
    known: BTreeMap<(u16, u16), u16>,
}

impl Builder {
    /// The slot of a function of a variable; for a power, the slot of the variable, which products multiply.
    fn function_of(&mut self, factor: Factor) -> Result<u16, ProgramError> {
        let x = factor.variable.checked_add(1).ok_or(ProgramError::TooLarge)?;
        if let Some(&known) = self.known_functions.get(&factor) {
            return Ok(known);
        }
        let (function, of) = match factor.shape {
            Shape::Power(_) => return Ok(x),
            Shape::Abs => (Function::Abs, x),
            Shape::Sign => (Function::Sign, x),
            Shape::Sin => (Function::Sin, x),
            Shape::Cos => (Function::Cos, x),
            Shape::Reciprocal => (Function::Reciprocal, x),
            Shape::Log => (Function::Log, x),
            Shape::Above(gate) => (Function::Above(gate), x),
            Shape::Below(gate) => {
                let above = Factor { variable: factor.variable, shape: Shape::Above(gate) };
                (Function::Complement, self.function_of(above)?)
            }
        };
        let slot = slot_number(1 + self.variables + self.functions.len())?;
        self.functions.push((function, of));
        self.known_functions.insert(factor, slot);
        Ok(slot)
    }

    fn term(&mut self, term: &Term) -> Result<u16, ProgramError> {
        let mut slot: Option<u16> = None;
        for &factor in term.factors() {
            let of = self.function_of(factor)?;
            let times = if let Shape::Power(n) = factor.shape { n } else { 1 };
            for _ in 0..times {
                slot = Some(self.times(slot, of)?);
            }
        }
        Ok(slot.unwrap_or(0))
    }

    fn times(&mut self, slot: Option<u16>, factor: u16) -> Result<u16, ProgramError> {
        let Some(slot) = slot else { return Ok(factor) };
        if let Some(&known) = self.known.get(&(slot, factor)) {
            return Ok(known);
        }
        let next = slot_number(1 + self.variables + self.functions.len() + self.products.len())?;
        self.products.push((slot, factor));
        self.known.insert((slot, factor), next);
        Ok(next)
    }
}

fn slot_number(number: usize) -> Result<u16, ProgramError> {
    u16::try_from(number).map_err(|_| ProgramError::TooLarge)
}
