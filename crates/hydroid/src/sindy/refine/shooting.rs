//! Multiple shooting: multi-step errors of equations on windows of runs and their derivatives, as QR factors.

use hydroid_core::model::sparse::{Equations, Sensitivity};
use hydroid_core::predict::Workspace;
use rayon::prelude::*;

use super::parameters::Parameters;
use crate::evaluate::DesignRange;
use crate::log::Trajectory;
use crate::sindy::qr::{BLOCK_ROWS, QrFactor};

const TASK_SAMPLES: usize = 1_500;

const MAX_TASKS: usize = 96;

/// Gauss-Newton steps for the initial outputs of a window; the problem is almost linear in them.
const START_STEPS: usize = 2;

/// Relative step of central finite differences; the derivatives have about eight digits.
const DIFFERENCE: f64 = 1e-4;

/// Start of the process before its first window, in warm-ups.
const SETTLING: usize = 3;

#[derive(Clone, Debug)]
pub(super) struct Windows<'a> {
    pub(super) runs: &'a [&'a Trajectory],
    pub(super) horizon: usize,
    pub(super) stride: usize,
    /// Weight of an error of each output: the inverse of its standard deviation.
    pub(super) weights: Vec<f64>,
    /// Weight of the measurement error at the start of a window.
    pub(super) start: Vec<f64>,
    pub(super) ranges: &'a [DesignRange],
    pub(super) huber: Option<f64>,
}

#[derive(Clone, Debug)]
pub(super) struct Linearization {
    /// Sum of the loss over all errors.
    pub(super) cost: f64,
    pub(super) errors: u64,
    /// Sum of squares of the unweighted errors of each output, and their number.
    pub(super) squares: Vec<(f64, u64)>,
    /// Factors of `[J r]` of consecutive windows, with the initial outputs eliminated.
    pub(super) parts: Vec<QrFactor>,
}

impl Linearization {
    pub(super) fn merged(&self) -> Option<QrFactor> {
        let mut parts = self.parts.iter();
        let mut merged = parts.next()?.clone();
        parts.for_each(|part| merged.merge(part));
        Some(merged)
    }
}

struct Task<'a> {
    run: &'a Trajectory,
    first: usize,
    /// One past the last start.
    end: usize,
}

impl Windows<'_> {
    /// Errors and their derivatives; `None` if a rollout diverges. Independent of the number of threads.
    pub(super) fn linearise(&self, parameters: &Parameters, values: &[f64]) -> Option<Linearization> {
        let equations = parameters.equations(values).ok()?;
        let perturbations = perturbations(parameters, values)?;
        let linearizer = Linearizer {
            windows: self,
            short: Sensitivity::new(&equations, &[]).ok()?,
            full: Sensitivity::new(&equations, parameters.places()).ok()?,
            equations: &equations,
            perturbations: &perturbations,
            width: parameters.len() + 1,
        };
        let tasks = self.tasks(equations.warm_up());
        let parts: Vec<Option<TaskResult>> = tasks.par_iter().map(|task| linearizer.process(task)).collect();
        let n = equations.outputs();
        let mut linear = Linearization {
            cost: 0.0,
            errors: 0,
            squares: vec![(0.0, 0); n],
            parts: Vec::with_capacity(parts.len()),
        };
        for part in parts {
            let part = part?;
            linear.cost += part.cost;
            linear.errors += part.errors;
            for ((sum, count), (own, own_count)) in linear.squares.iter_mut().zip(part.squares) {
                *sum += own;
                *count += own_count;
            }
            linear.parts.push(part.qr);
        }
        (linear.errors > 0 && linear.cost.is_finite()).then_some(linear)
    }

    fn tasks(&self, warm_up: usize) -> Vec<Task<'_>> {
        let total: usize = self.runs.iter().map(|run| run.len()).sum();
        let samples = TASK_SAMPLES.max(total.div_ceil(MAX_TASKS));
        let starts = (samples / self.stride).max(1) * self.stride;
        let mut tasks = Vec::new();
        for run in self.runs {
            // The command of the last sample acts after the run.
            let last = run.len().saturating_sub(self.horizon);
            let mut first = warm_up;
            while first < last {
                tasks.push(Task { run, first, end: last.min(first + starts) });
                first += starts;
            }
        }
        tasks
    }
}

/// Equations with each parameter except coefficients decreased and increased, and the inverse of the difference.
fn perturbations(parameters: &Parameters, values: &[f64]) -> Option<Vec<(Equations, Equations, f64)>> {
    let first = parameters.places().len();
    let perturbed = |at: usize, by: f64| {
        let mut moved = values.to_vec();
        moved[at] += by;
        parameters.equations(&moved).ok()
    };
    let one = |(i, size): (usize, f64)| {
        let by = DIFFERENCE * size;
        Some((perturbed(first + i, -by)?, perturbed(first + i, by)?, 0.5 / by))
    };
    parameters.sizes().into_iter().enumerate().map(one).collect()
}

struct TaskResult {
    cost: f64,
    errors: u64,
    squares: Vec<(f64, u64)>,
    qr: QrFactor,
}

struct Linearizer<'a> {
    windows: &'a Windows<'a>,
    equations: &'a Equations,
    short: Sensitivity,
    full: Sensitivity,
    perturbations: &'a [(Equations, Equations, f64)],
    width: usize,
}

struct Buffers {
    y: Vec<f64>,
    s: Vec<f64>,
    start_jacobian: Vec<f64>,
    matrix: Vec<f64>,
    block: Vec<f64>,
    filled: usize,
    work: Workspace,
}

impl Linearizer<'_> {
    fn process(&self, task: &Task<'_>) -> Option<TaskResult> {
        let (n, h) = (self.equations.outputs(), self.windows.horizon);
        let run = task.run;
        // The states of the perturbed equations differ for the same past.
        let all: Vec<&Equations> = std::iter::once(self.equations)
            .chain(self.perturbations.iter().flat_map(|(low, high, _)| [low, high]))
            .collect();
        let mut states: Vec<Vec<f64>> = all.iter().map(|e| vec![f64::NAN; e.state_len()]).collect();
        let mut scratch = vec![0.0; n];
        let columns = n + self.width;
        let mut buffers = Buffers {
            y: vec![0.0; (h + 1) * n],
            s: vec![0.0; (h + 1) * n * self.full.parameters()],
            start_jacobian: vec![0.0; (h + 1) * n * n],
            matrix: vec![0.0; columns * (h + 1) * n],
            block: vec![0.0; self.width * BLOCK_ROWS],
            filled: 0,
            work: Workspace::new(),
        };
        let mut part =
            TaskResult { cost: 0.0, errors: 0, squares: vec![(0.0, 0); n], qr: QrFactor::new(self.width) };
        let from = task.first.saturating_sub(SETTLING * self.equations.warm_up());
        for k in from..task.end {
            for state in &mut states {
                state[..n].copy_from_slice(run.outputs.row(k));
            }
            let starts = k >= task.first && (k - task.first).is_multiple_of(self.windows.stride);
            // Windows with a gap at the start or in the past are skipped.
            if starts && states.iter().flatten().all(|x| x.is_finite()) {
                self.window(run, k, &states, &mut buffers, &mut part)?;
            }
            for (equations, state) in all.iter().zip(&mut states) {
                equations.wait(state, run.inputs.row(k), &mut scratch);
            }
        }
        if buffers.filled > 0 {
            part.qr.append_rows(&mut buffers.block, buffers.filled);
        }
        Some(part)
    }

    fn window(
        &self,
        run: &Trajectory,
        k: usize,
        states: &[Vec<f64>],
        buffers: &mut Buffers,
        part: &mut TaskResult,
    ) -> Option<()> {
        let (n, h) = (self.equations.outputs(), self.windows.horizon);
        let m = self.equations.inputs();
        let commands: Vec<f64> = (k..k + h).flat_map(|j| run.inputs.row(j)[..m].iter().copied()).collect();
        if commands.iter().any(|c| !c.is_finite()) {
            return Some(());
        }
        let measured = |j: usize, i: usize| run.outputs.row(k + j)[i];
        let mut state = states[0].clone();
        for _ in 0..START_STEPS {
            let scratch = buffers.work.take(self.short.scratch());
            self.short.rollout(&state, &commands, scratch, &mut buffers.y, &mut buffers.start_jacobian);
            self.check(&buffers.y)?;
            let step = self.start_step(&buffers.y, &buffers.start_jacobian, &state, measured);
            state.iter_mut().zip(step).for_each(|(x, d)| *x += d);
        }
        let p = self.full.parameters();
        let scratch = buffers.work.take(self.full.scratch());
        self.full.rollout(&state, &commands, scratch, &mut buffers.y, &mut buffers.s);
        self.check(&buffers.y)?;
        let rows = (h + 1) * n;
        let columns = n + self.width;
        buffers.matrix.fill(0.0);
        // Columns: start, coefficients, other parameters, error.
        let other = p;
        let mut losses = 0.0;
        let mut row_weights = vec![0.0; rows];
        for j in 0..=h {
            for i in 0..n {
                let error = measured(j, i) - buffers.y[j * n + i];
                if error.is_nan() {
                    continue;
                }
                let weight = if j == 0 { self.windows.start[i] } else { self.windows.weights[i] };
                let e = weight * error;
                let (loss, factor) = match self.windows.huber.filter(|bound| j > 0 && e.abs() > *bound) {
                    Some(bound) => (bound * (2.0 * e.abs() - bound), (bound / e.abs()).sqrt()),
                    None => (e * e, 1.0),
                };
                losses += loss;
                let row = j * n + i;
                row_weights[row] = weight * factor;
                buffers.matrix[(columns - 1) * rows + row] = e * factor;
                for q in 0..p {
                    buffers.matrix[q * rows + row] = weight * factor * buffers.s[row * p + q];
                }
                if j > 0 {
                    part.squares[i].0 += error * error;
                    part.squares[i].1 += 1;
                    part.errors += 1;
                }
            }
        }
        part.cost += losses;
        for (v, (low, high, inverse)) in self.perturbations.iter().enumerate() {
            for (equations, sign, own) in
                [(low, -*inverse, &states[1 + 2 * v]), (high, *inverse, &states[2 + 2 * v])]
            {
                let mut own = own.clone();
                own[..n].copy_from_slice(&state[..n]);
                let scratch = buffers.work.take(equations.scratch());
                for j in 1..=h {
                    equations.step(&mut own, &commands[(j - 1) * m..j * m], scratch);
                    for i in 0..n {
                        let row = j * n + i;
                        buffers.matrix[(other + v) * rows + row] += row_weights[row] * sign * own[i];
                    }
                }
            }
        }
        householder(&mut buffers.matrix, rows, n, columns);
        // The rows after elimination of the initial outputs.
        let mut row = n;
        while row < rows {
            let take = (rows - row).min(BLOCK_ROWS - buffers.filled);
            for column in 0..self.width {
                let from = &buffers.matrix[(n + column) * rows + row..][..take];
                buffers.block[column * BLOCK_ROWS + buffers.filled..][..take].copy_from_slice(from);
            }
            buffers.filled += take;
            row += take;
            if buffers.filled == BLOCK_ROWS {
                part.qr.append_rows(&mut buffers.block, BLOCK_ROWS);
                buffers.block.fill(0.0);
                buffers.filled = 0;
            }
        }
        Some(())
    }

    fn check(&self, y: &[f64]) -> Option<()> {
        let n = self.equations.outputs();
        let bad = |row: &[f64]| row.iter().zip(self.windows.ranges).any(|(y, range)| range.diverged(*y));
        (!y.chunks_exact(n).any(bad)).then_some(())
    }

    fn start_step(
        &self,
        y: &[f64],
        start_jacobian: &[f64],
        state: &[f64],
        measured: impl Fn(usize, usize) -> f64,
    ) -> Vec<f64> {
        let n = self.equations.outputs();
        let mut matrix = vec![0.0; n * (n + 1)];
        for j in 0..=self.windows.horizon {
            for i in 0..n {
                let (weight, error) = if j == 0 {
                    (self.windows.start[i], measured(0, i) - state[i])
                } else {
                    (self.windows.weights[i], measured(j, i) - y[j * n + i])
                };
                if error.is_nan() {
                    continue;
                }
                let mut square = weight * weight;
                if let Some(bound) = self.windows.huber.filter(|b| j > 0 && weight * error.abs() > *b) {
                    square *= bound / (weight * error.abs());
                }
                let s = &start_jacobian[(j * n + i) * n..][..n];
                for a in 0..n {
                    for b in 0..n {
                        matrix[a * (n + 1) + b] += square * s[a] * s[b];
                    }
                    matrix[a * (n + 1) + n] += square * s[a] * error;
                }
            }
        }
        solve_spd(&mut matrix, n)
    }
}

/// Householder reflections that make the first `first` columns (column-major) upper triangular.
fn householder(matrix: &mut [f64], rows: usize, first: usize, columns: usize) {
    for j in 0..first {
        let (head, tail) = matrix.split_at_mut((j + 1) * rows);
        let v = &mut head[j * rows + j..];
        let norm = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        if norm == 0.0 {
            continue;
        }
        let alpha = -norm.copysign(v[0]);
        v[0] -= alpha;
        let beta = -1.0 / (alpha * v[0]);
        for k in 0..columns - j - 1 {
            let other = &mut tail[k * rows + j..(k + 1) * rows];
            let dot: f64 = v.iter().zip(other.iter()).map(|(a, b)| a * b).sum();
            let w = beta * dot;
            other.iter_mut().zip(v.iter()).for_each(|(o, v)| *o -= w * v);
        }
    }
}

/// Solves `A x = b` for a symmetric positive definite `A`, given as rows of `[A b]`; zero if `A` is singular.
fn solve_spd(matrix: &mut [f64], n: usize) -> Vec<f64> {
    let w = n + 1;
    for j in 0..n {
        let pivot = matrix[j * w + j];
        if pivot <= 0.0 || !pivot.is_finite() {
            return vec![0.0; n];
        }
        for i in j + 1..n {
            let f = matrix[i * w + j] / pivot;
            for k in j..w {
                matrix[i * w + k] -= f * matrix[j * w + k];
            }
        }
    }
    let mut x = vec![0.0; n];
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| matrix[i * w + k] * x[k]).sum();
        x[i] = (matrix[i * w + n] - known) / matrix[i * w + i];
    }
    x
}
