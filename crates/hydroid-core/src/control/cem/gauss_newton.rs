//! Gauss-Newton refinement of the best candidate.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::cost::{Cost, PlanningProblem, Simulator};
use crate::predict::BATCH;

/// Step of the finite differences, relative to half of the range of a command.
const SHARE: f64 = 0.01;

/// Damping factors of parallel rollouts, from a full step to one along the gradient.
const DAMPINGS: [f64; 8] = [1e-6, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0];

/// Regularization of commands without effect, relative to the largest diagonal entry.
const LEAST: f64 = 1e-9;

/// Gauss-Newton steps on a plan, with derivatives by differences.
///
/// Random search leaves noise in every command of a plan. The cost is a mean of squares `r_k^2`, so that a few more
/// rollouts find the optimum near the best candidate. With `J_ki = dr_k/dc_i` from one rollout for each command,
///
/// ```text
/// (J'J + lambda diag(J'J)) step = -J' r,     lambda = 1e-6 .. 100
/// ```
///
/// for all `lambda` in parallel. The best step is taken if its cost is lower. Commands at a limit with an outward
/// gradient are fixed (projected Newton); all steps are clamped to limits and rate limits.
///
/// Sources: K. Levenberg, 1944, and D. W. Marquardt, 1963; D. P. Bertsekas, *Projected Newton methods for optimization
/// problems with simple constraints*, 1982; see [`Planner`](super::Planner) for the refinement of random search.
#[derive(Clone, Debug)]
pub(super) struct GaussNewton {
    len: usize,
    rows: usize,
    /// `r`, then a column of `J` for each command.
    residuals: Vec<f64>,
    /// `J'J`, the lower triangle of the damped system, the gradient and a step.
    normal: Vec<f64>,
    factor: Vec<f64>,
    gradient: Vec<f64>,
    step: Vec<f64>,
    free: Vec<bool>,
    candidates: Vec<f64>,
}

impl GaussNewton {
    /// Memory for plans of `horizon` samples; empty if it is not `used`.
    pub(super) fn new(cost: &Cost, horizon: usize, inputs: usize, used: bool) -> Self {
        let len = if used { horizon * inputs } else { 0 };
        let rows = horizon * cost.residuals_of_a_sample(inputs);
        Self {
            len,
            rows,
            residuals: vec![0.0; if used { (len + 1) * rows } else { 0 }],
            normal: vec![0.0; len * len],
            factor: vec![0.0; len * len],
            gradient: vec![0.0; len],
            step: vec![0.0; len],
            free: vec![false; len],
            candidates: vec![0.0; BATCH * len],
        }
    }

    /// Returns the number of candidates and the new cost of the plan. `y` has room for the outputs of 64 candidates.
    pub(super) fn step(
        &mut self,
        simulator: &mut Simulator<'_>,
        cost: &Cost,
        moment: &PlanningProblem<'_>,
        (plan, mut best): (&mut [f64], f64),
        y: &mut [f64],
    ) -> (usize, f64) {
        let rows = moment.rows();
        if !self.differentiate(simulator, cost, moment, plan, y) {
            return (self.len + 1, best);
        }
        self.square();
        self.hold(moment, plan);
        let mut count = 0;
        for damping in DAMPINGS {
            if !self.solve(damping) {
                continue;
            }
            let candidate = &mut self.candidates[count * self.len..][..self.len];
            for (at, to) in candidate.iter_mut().enumerate() {
                *to = plan[at] + half(moment, at, moment.limits.len()) * self.step[at];
            }
            moment.clamp(candidate);
            count += 1;
        }
        let tried = self.len + 1 + count;
        if count == 0 {
            return (tried, best);
        }
        let candidates = &self.candidates[..count * self.len];
        let y = &mut y[..count * rows];
        moment.roll_out(simulator, count, candidates, y);
        for (candidate, y) in candidates.chunks_exact(self.len).zip(y.chunks_exact(rows)) {
            let new = cost.of(moment, y, candidate);
            if new < best {
                best = new;
                plan.copy_from_slice(candidate);
            }
        }
        (tried, best)
    }

    /// Computes `r` and `J` by forward differences; false if they are not finite.
    fn differentiate(
        &mut self,
        simulator: &mut Simulator<'_>,
        cost: &Cost,
        moment: &PlanningProblem<'_>,
        plan: &[f64],
        y: &mut [f64],
    ) -> bool {
        let (len, inputs) = (self.len, moment.limits.len());
        let rows = moment.rows();
        self.residuals.fill(0.0);
        for first in (0..=len).step_by(BATCH) {
            let count = BATCH.min(len + 1 - first);
            for (k, candidate) in self.candidates.chunks_exact_mut(len).take(count).enumerate() {
                candidate.copy_from_slice(plan);
                if let Some(at) = (first + k).checked_sub(1) {
                    candidate[at] += moved(moment, plan, at, inputs);
                }
            }
            let candidates = &self.candidates[..count * len];
            let y = &mut y[..count * rows];
            moment.roll_out(simulator, count, candidates, y);
            for k in 0..count {
                let mut into = self.residuals[(first + k) * self.rows..][..self.rows].iter_mut();
                let (of, y) = (&candidates[k * len..(k + 1) * len], &y[k * rows..(k + 1) * rows]);
                let known = cost.residuals(moment, y, of, |residual| {
                    if let Some(into) = into.next() {
                        *into = residual;
                    }
                });
                if !known.is_finite() {
                    return false;
                }
            }
        }
        let (base, columns) = self.residuals.split_at_mut(self.rows);
        for (at, column) in columns.chunks_exact_mut(self.rows).enumerate() {
            // Relative to half of the range: commands of any unit weigh alike.
            let change = moved(moment, plan, at, inputs);
            let inverse = if change == 0.0 { 0.0 } else { half(moment, at, inputs) / change };
            for (moved, base) in column.iter_mut().zip(&*base) {
                *moved = (*moved - base) * inverse;
            }
        }
        self.residuals.iter().all(|r| r.is_finite())
    }

    fn square(&mut self) {
        let (base, columns) = self.residuals.split_at(self.rows);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for (i, column) in columns.chunks_exact(self.rows).enumerate() {
            self.gradient[i] = dot(column, base);
            for (j, other) in columns.chunks_exact(self.rows).enumerate().take(i + 1) {
                let product = dot(column, other);
                self.normal[i * self.len + j] = product;
                self.normal[j * self.len + i] = product;
            }
        }
    }

    /// Marks the free commands: all but those at a limit with an outward gradient, and held inputs.
    fn hold(&mut self, moment: &PlanningProblem<'_>, plan: &[f64]) {
        let inputs = moment.limits.len();
        for (at, free) in self.free.iter_mut().enumerate() {
            let (limits, uphill) = (&moment.limits[at % inputs], self.gradient[at]);
            let outwards = plan[at] >= limits.high && uphill < 0.0 || plan[at] <= limits.low && uphill > 0.0;
            *free = !outwards && !limits.are_held();
        }
    }

    /// Solves for the damped step by a Cholesky factorization; false if there is none.
    fn solve(&mut self, damping: f64) -> bool {
        let n = self.len;
        let largest = (0..n).map(|i| self.normal[i * n + i]).fold(0.0, f64::max);
        let Self { normal, factor: l, gradient, step, free, .. } = self;
        for i in 0..n {
            for j in 0..=i {
                let held = !(free[i] && free[j]);
                let given = match (i == j, held) {
                    (true, true) => 1.0,
                    (false, true) => 0.0,
                    (true, false) => normal[i * n + i] * (1.0 + damping) + LEAST * largest,
                    (false, false) => normal[i * n + j],
                };
                let (row, other) = (&l[i * n..i * n + j], &l[j * n..j * n + j]);
                let rest = given - row.iter().zip(other).map(|(a, b)| a * b).sum::<f64>();
                if i == j {
                    if !(rest > 0.0 && rest.is_finite()) {
                        return false;
                    }
                    l[i * n + i] = Float::sqrt(rest);
                } else {
                    l[i * n + j] = rest / l[j * n + j];
                }
            }
        }
        for i in 0..n {
            let known: f64 = (0..i).map(|j| l[i * n + j] * step[j]).sum();
            let given = if free[i] { -gradient[i] } else { 0.0 };
            step[i] = (given - known) / l[i * n + i];
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|j| l[j * n + i] * step[j]).sum();
            step[i] = (step[i] - known) / l[i * n + i];
        }
        true
    }
}

fn half(moment: &PlanningProblem<'_>, at: usize, inputs: usize) -> f64 {
    moment.limits[at % inputs].half()
}

/// Change of a command for its derivative, towards the inside of its range.
fn moved(moment: &PlanningProblem<'_>, plan: &[f64], at: usize, inputs: usize) -> f64 {
    let size = SHARE * half(moment, at, inputs);
    if plan[at] + size > moment.limits[at % inputs].high { -size } else { size }
}
