//! Linear constraints on the coefficients: signs, and linear equalities across equations.
//!
//! Examples: `xi_u|u| <= 0` (drag), a symmetric mass matrix. Signs hold exactly, equalities to rounding.

use super::active_set::{Problem, solve};
use super::fit::LinearRegression;
use super::options::{FitOptions, Optimizer};
use super::qr::{BLOCK_ROWS, QrFactor};
use super::stepwise::independent_columns;
use super::stlsq::SparseSolution;

/// The coefficient of a term in an equation, both counted from 0 in the order of outputs and library.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Coefficient {
    /// Index of the output.
    pub equation: usize,
    /// Index in the library.
    pub term: usize,
}

/// Sign constraint of a coefficient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// `xi >= 0`.
    NotNegative,
    /// `xi <= 0`.
    NotPositive,
}

/// `sum a xi = b`, in physical units.
#[derive(Clone, Debug, PartialEq)]
pub struct Equality {
    /// Coefficients with their weights `a`.
    pub weights: Vec<(Coefficient, f64)>,
    /// The sum `b`.
    pub value: f64,
}

/// Constraints on the coefficients.
///
/// A term whose coefficient reaches its bound of zero is removed, and the selection is repeated without it.
/// Coefficients in an equality are exempt from the selection, and zero if the data cannot identify them. Equations
/// coupled by an equality are solved together, each weighted by the inverse of its residual.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Constraints {
    /// Signs of single coefficients.
    pub signs: Vec<(Coefficient, Sign)>,
    /// Linear relations.
    pub equalities: Vec<Equality>,
}

/// Constraints that cannot be satisfied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum ConstraintError {
    #[error(
        "a constraint names term {} of equation {}, and there are {terms} terms and {equations} equations, counted from 0",
        .at.term,
        .at.equation
    )]
    OutOfRange { at: Coefficient, equations: usize, terms: usize },
    #[error("equality {0} (from 0) has only zero weights, or a number that is not finite")]
    Empty(usize),
    #[error(
        "no coefficients obey all constraints of equation {equation} (from 0) and the equations coupled to it: check for an equality that contradicts a sign, two contradictory equalities, or an equality on terms that the data cannot identify"
    )]
    Contradiction { equation: usize },
}

impl Constraints {
    /// Whether there are no constraints.
    pub fn is_empty(&self) -> bool {
        self.signs.is_empty() && self.equalities.is_empty()
    }

    fn check(&self, equations: usize, terms: usize) -> Result<(), ConstraintError> {
        let named = self.equalities.iter().flat_map(|e| e.weights.iter().map(|(at, _)| at));
        for at in self.signs.iter().map(|(at, _)| at).chain(named) {
            if at.equation >= equations || at.term >= terms {
                return Err(ConstraintError::OutOfRange { at: *at, equations, terms });
            }
        }
        for (index, equality) in self.equalities.iter().enumerate() {
            let finite = equality.value.is_finite() && equality.weights.iter().all(|(_, a)| a.is_finite());
            if !finite || equality.weights.iter().all(|(_, a)| *a == 0.0) {
                return Err(ConstraintError::Empty(index));
            }
        }
        Ok(())
    }

    /// Sign of a coefficient: 1, -1, or 0 for any; none for contradictory signs, which exclude the term.
    fn sign(&self, equation: usize, term: usize) -> Option<f64> {
        let at = Coefficient { equation, term };
        let mut signs = self.signs.iter().filter(|(other, _)| *other == at).map(|(_, sign)| match sign {
            Sign::NotNegative => 1.0,
            Sign::NotPositive => -1.0,
        });
        let first = signs.next().unwrap_or(0.0);
        signs.all(|sign| sign == first).then_some(first)
    }

    fn coupled_terms(&self, equation: usize) -> impl Iterator<Item = usize> + '_ {
        let named = self.equalities.iter().flat_map(|e| &e.weights);
        named.filter(move |(at, _)| at.equation == equation).map(|(at, _)| at.term)
    }

    /// Equations that must be solved together, each list ascending.
    fn coupled_groups(&self, equations: usize) -> Vec<Vec<usize>> {
        let mut system: Vec<usize> = (0..equations).collect();
        for equality in &self.equalities {
            let members: Vec<usize> = equality.weights.iter().map(|(at, _)| system[at.equation]).collect();
            let Some(&first) = members.iter().min() else { continue };
            system.iter_mut().filter(|s| members.contains(s)).for_each(|s| *s = first);
        }
        (0..equations)
            .map(|first| (0..equations).filter(|&i| system[i] == first).collect::<Vec<usize>>())
            .filter(|members| !members.is_empty())
            .collect()
    }
}

pub(super) fn fit_constrained(
    prepared: &LinearRegression,
    plain: &QrFactor,
    ridged: &QrFactor,
    options: &FitOptions,
) -> Result<Vec<SparseSolution>, ConstraintError> {
    let constraints = &options.constraints;
    let terms = prepared.terms().len();
    constraints.check(prepared.outputs(), terms)?;
    let mut solutions: Vec<Option<SparseSolution>> = vec![None; prepared.outputs()];
    for equations in constraints.coupled_groups(prepared.outputs()) {
        for (equation, solution) in solve_group(prepared, plain, ridged, options, &equations)? {
            solutions[equation] = Some(solution);
        }
    }
    Ok(solutions.into_iter().flatten().collect())
}

fn solve_group(
    prepared: &LinearRegression,
    plain: &QrFactor,
    ridged: &QrFactor,
    options: &FitOptions,
    equations: &[usize],
) -> Result<Vec<(usize, SparseSolution)>, ConstraintError> {
    let constraints = &options.constraints;
    let count = prepared.terms().len();
    let mut excluded: Vec<Vec<bool>> =
        equations.iter().map(|&i| (0..count).map(|j| constraints.sign(i, j).is_none()).collect()).collect();
    // The factor from which the optimizer computes its coefficients.
    let is_plain = matches!(options.optimizer, Optimizer::Stlsq(_) | Optimizer::Subset);
    let source = if is_plain { plain } else { ridged };
    // Inverse residual with all terms, bounded for exact data.
    let weights: Vec<f64> = equations
        .iter()
        .map(|&i| {
            let all = independent_columns(plain, count, count + i);
            let floor = 1e-9 * plain.column_norm(count + i);
            1.0 / plain.solve(&all, count + i).residual.max(floor).max(f64::MIN_POSITIVE)
        })
        .collect();
    loop {
        let mut parts = Vec::new();
        for ((&i, &weight), excluded) in equations.iter().zip(&weights).zip(&excluded) {
            let mask: Vec<f64> = (0..plain.width())
                .map(|j| if excluded.get(j).copied().unwrap_or(false) { 0.0 } else { 1.0 })
                .collect();
            let (plain, ridged) = (plain.scaled(&mask), ridged.scaled(&mask));
            let chosen = prepared.select(&plain, &ridged, i, options.optimizer);
            let identifiable = independent_columns(&plain, count, count + i);
            let coupled: Vec<usize> = constraints.coupled_terms(i).collect();
            let support: Vec<usize> = identifiable
                .into_iter()
                .filter(|j| chosen.coefficients[*j] != 0.0 || coupled.contains(j))
                .collect();
            parts.push(EquationSupport { equation: i, weight, support });
        }
        let stacked = CoupledSystem::new(prepared, source, constraints, &parts);
        let problem = Problem { qr: &stacked.qr, equalities: &stacked.equalities, signs: &stacked.signs };
        let x = solve(&problem).map_err(|_| ConstraintError::Contradiction { equation: equations[0] })?;
        let mut removed = false;
        let mut position = 0;
        let mut solutions = Vec::new();
        for (part, excluded) in parts.iter().zip(&mut excluded) {
            let own = &x[position..position + part.support.len()];
            position += part.support.len();
            let mut coefficients = vec![0.0; count];
            for (&j, &x) in part.support.iter().zip(own) {
                coefficients[j] = x;
                // At its bound; in an equality, zero is a regular value.
                if x == 0.0 && !constraints.coupled_terms(part.equation).any(|term| term == j) {
                    excluded[j] = true;
                    removed = true;
                }
            }
            let columns: Vec<usize> = (0..count).collect();
            let residual = source.residual(&columns, &coefficients, count + part.equation);
            solutions.push((part.equation, SparseSolution { coefficients, residual }));
        }
        if !removed {
            return Ok(solutions);
        }
    }
}

struct EquationSupport {
    equation: usize,
    weight: f64,
    support: Vec<usize>,
}

/// Several equations as one problem, coefficients one after another.
struct CoupledSystem {
    qr: QrFactor,
    equalities: Vec<(Vec<f64>, f64)>,
    signs: Vec<f64>,
}

impl CoupledSystem {
    fn new(
        prepared: &LinearRegression,
        source: &QrFactor,
        constraints: &Constraints,
        parts: &[EquationSupport],
    ) -> Self {
        let count = prepared.terms().len();
        let places: Vec<Coefficient> = parts
            .iter()
            .flat_map(|p| p.support.iter().map(|&term| Coefficient { equation: p.equation, term }))
            .collect();
        let n = places.len();
        let mut qr = QrFactor::new(n + 1);
        let mut block = vec![0.0; (n + 1) * BLOCK_ROWS];
        let mut first = 0;
        for part in parts {
            let target = count + part.equation;
            let columns: Vec<usize> = part.support.iter().copied().chain([target]).collect();
            let own = source.select(&columns);
            let k = part.support.len();
            for start in (0..=k).step_by(BLOCK_ROWS) {
                block.fill(0.0);
                for row in start..(start + BLOCK_ROWS).min(k + 1) {
                    for column in row..=k {
                        let place = if column == k { n } else { first + column };
                        block[place * BLOCK_ROWS + row - start] = part.weight * own.get(row, column);
                    }
                }
                qr.append_rows(&mut block, 0);
            }
            first += k;
        }
        let weights_of = |equality: &Equality| {
            let mut weights = vec![0.0; n];
            for (at, a) in &equality.weights {
                if let Some(position) = places.iter().position(|place| place == at) {
                    weights[position] += a * prepared.unit(at.equation, at.term);
                }
            }
            weights
        };
        let concerned =
            |e: &&Equality| e.weights.iter().any(|(at, _)| parts.iter().any(|p| p.equation == at.equation));
        Self {
            equalities: constraints
                .equalities
                .iter()
                .filter(concerned)
                .map(|e| (weights_of(e), e.value))
                .collect(),
            signs: places.iter().map(|at| constraints.sign(at.equation, at.term).unwrap_or(0.0)).collect(),
            qr,
        }
    }
}
