//! Jacobians of equations, for controllers and filters.

use alloc::collections::BTreeMap;
use alloc::vec;
use alloc::vec::Vec;

use super::equations::Equations;
use super::program::{Program, ProgramError};
use super::term::Term;

/// The derivatives of `f(y, c, s) = Xi theta(y, c, s)` with respect to all variables, compiled from the derivatives of
/// the terms: `A = df/dy` (`outputs x outputs`), `B = df/dc` (`outputs x inputs`), and with respect to the signals.
/// They are exact except at the kink of `|x|`, where the derivative is taken as 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Jacobian {
    outputs: usize,
    variables: usize,
    program: Program,
    /// `(row x variables + column, slot, factor)`.
    entries: Vec<(usize, usize, f64)>,
}

impl Jacobian {
    /// The Jacobian of equations.
    ///
    /// # Errors
    /// If the derivatives need more sub-products than a program can hold.
    pub fn new(equations: &Equations) -> Result<Self, ProgramError> {
        let (outputs, variables) = (equations.outputs(), equations.variables());
        let mut index: BTreeMap<Term, usize> = BTreeMap::new();
        let mut terms: Vec<Term> = Vec::new();
        let mut entries = Vec::new();
        for (j, term) in equations.terms().iter().enumerate() {
            for variable in 0..variables {
                // Equations are compiled for 16-bit variables.
                let Ok(v) = u16::try_from(variable) else { return Err(ProgramError::TooLarge) };
                for (scale, derivative) in term.derivative(v) {
                    let place = *index.entry(derivative.clone()).or_insert_with(|| {
                        terms.push(derivative);
                        terms.len() - 1
                    });
                    for output in 0..outputs {
                        let coefficient = equations.coefficient(output, j);
                        if coefficient != 0.0 {
                            entries.push((output * variables + variable, place, scale * coefficient));
                        }
                    }
                }
            }
        }
        let program = Program::new(&terms, variables)?;
        for entry in &mut entries {
            entry.1 = program.slot(entry.1);
        }
        Ok(Self { outputs, variables, program, entries })
    }

    /// Length of the scratch of [`evaluate`](Self::evaluate).
    pub fn slots(&self) -> usize {
        self.program.slots()
    }

    /// Writes the Jacobian, `outputs x variables`, row by row, at the variables in `slots[1..]` ([`Equations::load`]).
    ///
    /// # Panics
    /// If `slots` is shorter than [`slots`](Self::slots), or `into` has another size.
    pub fn evaluate(&self, slots: &mut [f64], into: &mut [f64]) {
        assert_eq!(into.len(), self.outputs * self.variables, "outputs x variables numbers");
        self.program.evaluate(slots);
        into.fill(0.0);
        for &(at, slot, factor) in &self.entries {
            into[at] += factor * slots[slot];
        }
    }

    /// The matrices `A` and `B` of equations without signals at `y`, `c`. It allocates; not for a control loop.
    pub fn matrices(&self, y: &[f64], c: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let n = self.outputs;
        let mut slots = vec![0.0; self.slots()];
        slots[1..=n].copy_from_slice(y);
        slots[1 + n..=n + c.len()].copy_from_slice(c);
        let mut all = vec![0.0; n * self.variables];
        self.evaluate(&mut slots, &mut all);
        let columns = |from: usize, to: usize| {
            all.chunks_exact(self.variables).flat_map(|row| row[from..to].to_vec()).collect()
        };
        (columns(0, n), columns(n, n + c.len()))
    }
}
