//! Levenberg-Marquardt iteration (Quart. Appl. Math. 2 (1944) 164; J. SIAM 11 (1963) 431) with prior and constraints.

use super::parameters::Parameters;
use super::shooting::{Linearization, Parametric, Windows};
use crate::progress::{self, Cancelled, Progress};
use crate::sindy::active_set::{Problem, solve};
use crate::sindy::constraints::{Coefficient, Constraints, Equality, Sign};
use crate::sindy::qr::{BLOCK_ROWS, QrFactor};

const MAX_STEPS: usize = 12;

/// Maximum number of damping values per iteration; each is ten times the one before.
const MAX_TRIALS: usize = 5;

const MIN_RELATIVE_DECREASE: f64 = 1e-4;

/// Damping of the first step that follows a rejected one.
const INITIAL_DAMPING: f64 = 1e-2;

#[derive(Clone, Debug, Default)]
pub(crate) struct LinearConstraints {
    pub(crate) equalities: Vec<(Vec<f64>, f64)>,
    pub(crate) signs: Vec<f64>,
}

impl LinearConstraints {
    /// Constraints on the parameters; other coefficients are zero.
    pub(super) fn new(constraints: &Constraints, parameters: &Parameters) -> Self {
        let place = |at: &Coefficient| {
            let place = at.equation * parameters.terms() + at.term;
            parameters.places().iter().position(|known| *known == place)
        };
        let mut signs = vec![0.0; parameters.len()];
        for (at, sign) in &constraints.signs {
            if let Some(at) = place(at) {
                signs[at] = if *sign == Sign::NotNegative { 1.0 } else { -1.0 };
            }
        }
        let equality = |equality: &Equality| {
            let mut weights = vec![0.0; parameters.len()];
            for (at, weight) in &equality.weights {
                if let Some(at) = place(at) {
                    weights[at] += weight;
                }
            }
            (weights.iter().any(|w| *w != 0.0)).then_some((weights, equality.value))
        };
        Self { equalities: constraints.equalities.iter().filter_map(equality).collect(), signs }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Prior {
    pub(crate) centre: Vec<f64>,
    /// Norm of the column of each parameter at the centre: the unit of a prior of strength 1.
    pub(crate) norms: Vec<f64>,
    /// Information of the prior relative to that of the windows about the parameter alone.
    pub(crate) strength: f64,
}

impl Prior {
    fn cost(&self, values: &[f64]) -> f64 {
        let parts = values.iter().zip(&self.centre).zip(&self.norms);
        self.strength * parts.map(|((x, c), d)| (d * (x - c)).powi(2)).sum::<f64>()
    }

    /// Solution of the problem linearised at `values`; none if the constraints are infeasible.
    fn solve(
        &self,
        merged: &QrFactor,
        values: &[f64],
        damping: f64,
        constraints: &LinearConstraints,
    ) -> Option<Vec<f64>> {
        // The unknowns are scaled by the norms of their columns.
        let scaled = |x: &[f64]| x.iter().zip(&self.norms).map(|(x, d)| d * x).collect::<Vec<f64>>();
        let inverse: Vec<f64> = self.norms.iter().map(|d| 1.0 / d).chain([1.0]).collect();
        let now = scaled(values);
        let mut problem = merged.scaled(&inverse).shift_target(&now);
        for (weight, aims) in [(self.strength, scaled(&self.centre)), (damping, now)] {
            if weight > 0.0 {
                append_diagonal_rows(&mut problem, weight.sqrt(), &aims);
            }
        }
        let equalities: Vec<(Vec<f64>, f64)> = constraints
            .equalities
            .iter()
            .map(|(weights, value)| (weights.iter().zip(&inverse).map(|(a, i)| a * i).collect(), *value))
            .collect();
        let solution = solve(&Problem { qr: &problem, equalities: &equalities, signs: &constraints.signs });
        Some(solution.ok()?.iter().zip(&inverse).map(|(z, i)| z * i).collect())
    }
}

/// Adds a row `weight (x_j - aims_j)` for each unknown.
fn append_diagonal_rows(problem: &mut QrFactor, weight: f64, aims: &[f64]) {
    let p = aims.len();
    let mut block = vec![0.0; (p + 1) * BLOCK_ROWS];
    for start in (0..p).step_by(BLOCK_ROWS) {
        block.fill(0.0);
        for j in start..p.min(start + BLOCK_ROWS) {
            block[j * BLOCK_ROWS + j - start] = weight;
            block[p * BLOCK_ROWS + j - start] = weight * aims[j];
        }
        problem.append_rows(&mut block, 0);
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Minimum {
    pub(crate) values: Vec<f64>,
    pub(crate) linear: Linearization,
    pub(crate) steps: usize,
}

pub(crate) fn levenberg_marquardt<P: Parametric>(
    windows: &Windows<'_>,
    parameters: &P,
    start: (Vec<f64>, Linearization),
    prior: &Prior,
    constraints: &LinearConstraints,
    progress: Progress<'_>,
) -> Result<Minimum, Cancelled> {
    let (mut values, mut linear) = start;
    let mut damping = 0.0;
    let mut steps = 0;
    for step in 0..MAX_STEPS {
        let Some(merged) = linear.merged() else { break };
        let now = linear.cost + prior.cost(&values);
        let mut accepted = None;
        for _ in 0..MAX_TRIALS {
            progress::report(progress, step as f64 / MAX_STEPS as f64)?;
            let candidate = prior.solve(&merged, &values, damping, constraints);
            let next =
                candidate.and_then(|candidate| Some((windows.linearise(parameters, &candidate)?, candidate)));
            match next {
                Some((next, candidate)) if next.cost + prior.cost(&candidate) < now => {
                    accepted = Some((candidate, next));
                    break;
                }
                _ => damping = if damping == 0.0 { INITIAL_DAMPING } else { 10.0 * damping },
            }
        }
        let Some((candidate, next)) = accepted else { break };
        let gain = now - (next.cost + prior.cost(&candidate));
        (values, linear) = (candidate, next);
        steps += 1;
        damping = if damping <= INITIAL_DAMPING { 0.0 } else { 0.1 * damping };
        if gain < MIN_RELATIVE_DECREASE * now {
            break;
        }
    }
    Ok(Minimum { values, linear, steps })
}
