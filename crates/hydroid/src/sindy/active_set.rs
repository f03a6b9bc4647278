//! Least squares with linear equalities and signs: dual active set (Goldfarb, Idnani, Math. Programming 27 (1983) 1).
//!
//! `min |R x - d|^2` with `R` upper triangular, `a_e . x = b_e` for every equality, and `s_j x_j >= 0` for some `j`.
//! The method starts from the unconstrained solution and activates violated constraints one by one; a constraint whose
//! multiplier would become negative is dropped. The minimum increases with every step, so the method terminates. A
//! violated constraint that is inconsistent with the active ones makes the problem infeasible.

use super::qr::QrFactor;

/// A normal depends on the active ones if its orthogonal part is below this share of its length.
const DEPENDENT: f64 = 1e-10;

/// Relative tolerance of a constraint.
const OBEYED: f64 = 1e-12;

/// Least-squares problem; the last column of the factor is the right-hand side.
pub(super) struct Problem<'a> {
    /// Factor of `[R d]`, without dependent columns.
    pub(super) qr: &'a QrFactor,
    pub(super) equalities: &'a [(Vec<f64>, f64)],
    /// Sign of each coefficient: 1, -1, or 0 for any.
    pub(super) signs: &'a [f64],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Infeasible;

/// An active constraint `n . x >= b` (or `= b`); its normal is `R^-T n`, in the metric of `R`.
struct Active {
    /// The coefficient at its bound; none for an equality.
    bound: Option<usize>,
    normal: Vec<f64>,
    multiplier: f64,
}

pub(super) fn solve(problem: &Problem<'_>) -> Result<Vec<f64>, Infeasible> {
    let qr = problem.qr;
    let n = qr.width() - 1;
    let right: Vec<f64> = (0..n).map(|i| qr.get(i, n)).collect();
    let mut x = solve_upper(qr, &right);
    let mut active: Vec<Active> = Vec::new();
    for (weights, value) in problem.equalities {
        let size = weights.iter().zip(&x).map(|(a, x)| (a * x).abs()).sum::<f64>() + value.abs();
        let violation = dot(weights, &x) - value;
        let normal = solve_lower(qr, weights);
        let (free, _) = project(&active, &normal);
        let length = dot(&free, &free);
        if length.sqrt() <= DEPENDENT * dot(&normal, &normal).sqrt() {
            // Redundant or inconsistent.
            if violation.abs() > 1e-9 * size {
                return Err(Infeasible);
            }
            continue;
        }
        axpy(&mut x, &solve_upper(qr, &free), -violation / length);
        active.push(Active { bound: None, normal, multiplier: 0.0 });
    }
    let units: Vec<Vec<f64>> = (0..n)
        .map(|j| {
            let mut unit = vec![0.0; n];
            unit[j] = 1.0;
            solve_lower(qr, &unit)
        })
        .collect();
    let deviations: Vec<f64> = units.iter().map(|unit| dot(unit, unit).sqrt()).collect();
    // Largest change of a coefficient in its standard deviations, for a right-hand side of this size.
    let scale = dot(&right, &right).sqrt();
    // A bound far above the number of steps; without convergence there is no solution.
    for _ in 0..100 * (n + 1) {
        let violated = |j: usize| problem.signs[j] * x[j] / deviations[j];
        let worst = (0..n)
            .filter(|&j| problem.signs[j] != 0.0 && active.iter().all(|a| a.bound != Some(j)))
            .min_by(|&a, &b| violated(a).total_cmp(&violated(b)));
        let Some(worst) = worst.filter(|&j| violated(j) < -OBEYED * scale) else {
            // Values within rounding of zero become zero, as do coefficients that an equality ties to a zero.
            for ((x, sign), deviation) in x.iter_mut().zip(problem.signs).zip(&deviations) {
                if x.abs() <= OBEYED * scale * deviation || *x * sign < 0.0 {
                    *x = 0.0;
                }
            }
            return Ok(x);
        };
        let normal: Vec<f64> = units[worst].iter().map(|value| problem.signs[worst] * value).collect();
        activate(problem, &mut x, &mut active, worst, &normal)?;
    }
    Err(Infeasible)
}

/// Moves along the normal until the sign of `x_j` holds, and drops blocking constraints.
fn activate(
    problem: &Problem<'_>,
    x: &mut [f64],
    active: &mut Vec<Active>,
    j: usize,
    normal: &[f64],
) -> Result<(), Infeasible> {
    let mut multiplier = 0.0;
    loop {
        let (free, shares) = project(active, normal);
        let length = dot(&free, &free);
        let blocking = active
            .iter()
            .zip(&shares)
            .enumerate()
            .filter(|(_, (a, share))| a.bound.is_some() && **share > 0.0)
            .map(|(k, (a, share))| (k, a.multiplier / share))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let full = if length.sqrt() <= DEPENDENT * dot(normal, normal).sqrt() {
            f64::INFINITY
        } else {
            -problem.signs[j] * x[j] / length
        };
        let length_of_step = blocking.map_or(full, |(_, partial)| partial.min(full));
        if length_of_step.is_infinite() {
            return Err(Infeasible);
        }
        if full.is_finite() {
            axpy(x, &solve_upper(problem.qr, &free), length_of_step);
        }
        for (a, share) in active.iter_mut().zip(&shares) {
            a.multiplier -= length_of_step * share;
        }
        multiplier += length_of_step;
        match blocking {
            Some((k, partial)) if partial < full => drop(active.remove(k)),
            _ => {
                active.push(Active { bound: Some(j), normal: normal.to_vec(), multiplier });
                return Ok(());
            }
        }
    }
}

/// Part of a normal that is orthogonal to the active ones, and the shares of these in the remainder.
fn project(active: &[Active], normal: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let k = active.len();
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(k);
    // Upper triangular: the active normals in the basis.
    let mut factor = vec![0.0; k * k];
    for (column, a) in active.iter().enumerate() {
        let (mut rest, shares) = orthogonal(&basis, &a.normal);
        let length = dot(&rest, &rest).sqrt();
        for value in &mut rest {
            *value /= length;
        }
        for (row, share) in shares.iter().enumerate() {
            factor[row * k + column] = *share;
        }
        factor[column * k + column] = length;
        basis.push(rest);
    }
    let (free, mut shares) = orthogonal(&basis, normal);
    for row in (0..k).rev() {
        let known: f64 = (row + 1..k).map(|column| factor[row * k + column] * shares[column]).sum();
        shares[row] = (shares[row] - known) / factor[row * k + row];
    }
    (free, shares)
}

/// Gram-Schmidt, repeated once for orthogonality to rounding.
fn orthogonal(basis: &[Vec<f64>], vector: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mut rest = vector.to_vec();
    let mut shares = vec![0.0; basis.len()];
    for _ in 0..2 {
        for (direction, share) in basis.iter().zip(&mut shares) {
            let part = dot(direction, &rest);
            *share += part;
            axpy(&mut rest, direction, -part);
        }
    }
    (rest, shares)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn axpy(x: &mut [f64], direction: &[f64], length: f64) {
    x.iter_mut().zip(direction).for_each(|(x, d)| *x += length * d);
}

/// `R^-1 v`.
fn solve_upper(qr: &QrFactor, v: &[f64]) -> Vec<f64> {
    let mut x = v.to_vec();
    for i in (0..v.len()).rev() {
        let known: f64 = (i + 1..v.len()).map(|j| qr.get(i, j) * x[j]).sum();
        x[i] = (x[i] - known) / qr.get(i, i);
    }
    x
}

/// `R^-T v`.
fn solve_lower(qr: &QrFactor, v: &[f64]) -> Vec<f64> {
    let mut x = v.to_vec();
    for i in 0..v.len() {
        let known: f64 = (0..i).map(|j| qr.get(j, i) * x[j]).sum();
        x[i] = (x[i] - known) / qr.get(i, i);
    }
    x
}
