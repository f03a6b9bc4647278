//! A list of terms compiled to a flat program that evaluates shared sub-products once.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec;
use alloc::vec::Vec;

use super::term::{Factor, Shape, Term};

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
/// Memory layout of the slots: slot 0 holds the constant 1, slots `1..=n` the `n` variables, then come the
/// absolute values of variables and the products, each of two earlier slots. Every term is a slot. A
/// degree-3 monomial costs one multiplication, because its degree-2 part is there already.
///
/// The variables from some point on may be *held*: products of these alone come before the others, so that
/// an integrator which moves the other variables several times under the same command evaluates them once.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    variables: usize,
    /// Slots whose absolute values are taken.
    absolutes: Vec<u16>,
    /// Pairs of slots to multiply.
    products: Vec<(u16, u16)>,
    /// How many of the products are of held variables alone.
    held: usize,
    terms: Vec<u16>,
}

impl Program {
    /// Compiles terms over `variables` variables, none of which is held.
    ///
    /// # Errors
    /// If a term names a variable that there is not, or the program grows too large.
    pub fn new(terms: &[Term], variables: usize) -> Result<Self, ProgramError> {
        Self::with_held(terms, variables, 0)
    }

    /// Compiles terms over `moving` variables and, after them, `held` ones.
    ///
    /// # Errors
    /// If a term names a variable that there is not, or the program grows too large.
    pub fn with_held(terms: &[Term], moving: usize, held: usize) -> Result<Self, ProgramError> {
        let variables = moving + held;
        for (index, term) in terms.iter().enumerate() {
            if let Some(variable) = term.highest_variable().filter(|&v| usize::from(v) >= variables) {
                return Err(ProgramError::UnknownVariable { term: index, variable, variables });
            }
        }
        let mut builder = Builder::new(terms, variables);
        let mut slots = vec![0; terms.len()];
        for (slot, term) in slots.iter_mut().zip(terms).filter(|(_, term)| is_held(term, moving)) {
            *slot = builder.term(term)?;
        }
        let held = builder.products.len();
        for (slot, term) in slots.iter_mut().zip(terms).filter(|(_, term)| !is_held(term, moving)) {
            *slot = builder.term(term)?;
        }
        let Builder { absolutes, products, .. } = builder;
        Ok(Self { variables, absolutes, products, held, terms: slots })
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
        self.first_product() + self.products.len()
    }

    /// The slot that holds a term after evaluation.
    pub fn slot(&self, term: usize) -> usize {
        usize::from(self.terms[term])
    }

    fn first_product(&self) -> usize {
        1 + self.variables + self.absolutes.len()
    }

    /// Evaluates all terms at one point. The variables stand in `slots[1..=n]`.
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
        self.take_absolutes(slots);
        self.multiply(slots, 0, self.held);
    }

    /// The other part; the held part must have been evaluated before.
    ///
    /// # Panics
    /// If `slots` is shorter than [`slots`](Self::slots).
    #[inline]
    pub fn evaluate_moving(&self, slots: &mut [f64]) {
        self.take_absolutes(slots);
        self.multiply(slots, self.held, self.products.len());
    }

    #[inline]
    fn take_absolutes(&self, slots: &mut [f64]) {
        let first = 1 + self.variables;
        for (index, &a) in self.absolutes.iter().enumerate() {
            slots[first + index] = slots[usize::from(a)].abs();
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

    /// Evaluates all terms at `rows` points at once: slot `s` of point `i` is `slots[s * rows + i]`, and
    /// the variables stand in slots `1..=n`. Vectorises over the points.
    ///
    /// # Panics
    /// If `slots` is shorter than `self.slots() * rows`.
    pub fn evaluate_block(&self, slots: &mut [f64], rows: usize) {
        let slots = &mut slots[..self.slots() * rows];
        slots[..rows].fill(1.0);
        for (index, &a) in self.absolutes.iter().enumerate() {
            let (known, rest) = slots.split_at_mut((1 + self.variables + index) * rows);
            for (r, x) in rest[..rows].iter_mut().zip(&known[usize::from(a) * rows..][..rows]) {
                *r = x.abs();
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

/// Whether a term depends on held variables alone; the constant does.
pub(super) fn is_held(term: &Term, moving: usize) -> bool {
    term.factors().iter().all(|factor| usize::from(factor.variable) >= moving)
}

struct Builder {
    variables: usize,
    absolutes: Vec<u16>,
    products: Vec<(u16, u16)>,
    known: BTreeMap<(u16, u16), u16>,
}

impl Builder {
    /// A program that takes the absolute values which the terms need, and multiplies nothing yet. The
    /// variables of the terms are checked before.
    fn new(terms: &[Term], variables: usize) -> Self {
        let factors = terms.iter().flat_map(Term::factors);
        let variables_of: BTreeSet<u16> =
            factors.filter(|f| f.shape == Shape::Abs).map(|f| f.variable).collect();
        // A variable too high for a slot is refused where its term is compiled.
        let absolutes = variables_of.into_iter().map(|v| v.saturating_add(1)).collect();
        Self { variables, absolutes, products: Vec::new(), known: BTreeMap::new() }
    }

    fn term(&mut self, term: &Term) -> Result<u16, ProgramError> {
        let mut slot: Option<u16> = None;
        for &Factor { variable, shape } in term.factors() {
            let x = variable.checked_add(1).ok_or(ProgramError::TooLarge)?;
            match shape {
                Shape::Power(n) => {
                    for _ in 0..n {
                        slot = Some(self.times(slot, x)?);
                    }
                }
                Shape::Abs => {
                    let index = self.absolutes.binary_search(&x).map_err(|_| ProgramError::TooLarge)?;
                    let absolute = slot_number(1 + self.variables + index)?;
                    slot = Some(self.times(slot, absolute)?);
                }
            }
        }
        Ok(slot.unwrap_or(0))
    }

    fn times(&mut self, slot: Option<u16>, factor: u16) -> Result<u16, ProgramError> {
        let Some(slot) = slot else { return Ok(factor) };
        if let Some(&known) = self.known.get(&(slot, factor)) {
            return Ok(known);
        }
        let next = slot_number(1 + self.variables + self.absolutes.len() + self.products.len())?;
        self.products.push((slot, factor));
        self.known.insert((slot, factor), next);
        Ok(next)
    }
}

fn slot_number(number: usize) -> Result<u16, ProgramError> {
    u16::try_from(number).map_err(|_| ProgramError::TooLarge)
}
