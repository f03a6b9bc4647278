//! Multiple shooting: multi-step errors of a model on windows of runs and their derivatives, as QR factors.

use hydroid_core::predict::Workspace;
use rayon::prelude::*;

use crate::evaluate::DesignRange;
use crate::log::Trajectory;
use crate::sindy::qr::{BLOCK_ROWS, QrFactor};

const TASK_SAMPLES: usize = 1_500;

const MAX_TASKS: usize = 96;

/// Gauss-Newton steps for the initial outputs of a window; the problem is almost linear in them.
const START_STEPS: usize = 2;

/// Start of the process before its first window, in warm-ups.
const SETTLING: usize = 3;

#[derive(Clone, Debug)]
pub(crate) struct Windows<'a> {
    pub(crate) runs: &'a [&'a Trajectory],
    pub(crate) horizon: usize,
    pub(crate) stride: usize,
    /// Weight of an error of each output: the inverse of its standard deviation.
    pub(crate) weights: Vec<f64>,
    /// Weight of the measurement error at the start of a window.
    pub(crate) start: Vec<f64>,
    pub(crate) ranges: &'a [DesignRange],
    pub(crate) huber: Option<f64>,
}

#[derive(Clone, Debug)]
pub(crate) struct Linearization {
    /// Sum of the loss over all errors.
    pub(crate) cost: f64,
    pub(crate) errors: u64,
    /// Sum of squares of the unweighted errors of each output, and their number.
    pub(crate) squares: Vec<(f64, u64)>,
    /// Factors of `[J r]` of consecutive windows, with the initial outputs eliminated.
    pub(super) parts: Vec<QrFactor>,
}

impl Linearization {
    pub(crate) fn merged(&self) -> Option<QrFactor> {
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

/// A model with fixed parameters, of which windows of runs are rolled out.
pub(crate) trait ShootingModel: Sync {
    /// Hidden state along a run.
    type Past;

    fn outputs(&self) -> usize;

    fn inputs(&self) -> usize;

    /// Number of parameters.
    fn parameters(&self) -> usize;

    fn warm_up(&self) -> usize;

    /// The unknown state before a run.
    fn past(&self) -> Self::Past;

    /// Takes the measurements of a sample; NaN where they are missing.
    fn observe(&self, past: &mut Self::Past, y: &[f64]);

    /// Whether all on which a rollout depends is known.
    fn is_known(&self, past: &Self::Past) -> bool;

    /// Goes to the next sample with a command.
    fn wait(&self, past: &mut Self::Past, c: &[f64]);

    /// Rolls out from the outputs `start`: rows of outputs `y`, the start included, and their derivatives by the start.
    fn roll_start(
        &self,
        past: &Self::Past,
        start: &[f64],
        commands: &[f64],
        work: &mut Workspace,
        y: &mut [f64],
        by_start: &mut [f64],
    );

    /// As [`roll_start`](Self::roll_start), with the derivatives by the start, then by the parameters: rows of
    /// `outputs + parameters` numbers.
    fn roll(
        &self,
        past: &Self::Past,
        start: &[f64],
        commands: &[f64],
        work: &mut Workspace,
        y: &mut [f64],
        jacobian: &mut [f64],
    );
}

/// A family of models.
pub(crate) trait Parametric: Sync {
    type Model: ShootingModel;

    /// The model with these values of the parameters; none if they are invalid.
    fn model(&self, values: &[f64]) -> Option<Self::Model>;
}

impl Windows<'_> {
    /// Errors and their derivatives; `None` if a rollout diverges. Independent of the number of threads.
    pub(crate) fn linearise<P: Parametric>(&self, parameters: &P, values: &[f64]) -> Option<Linearization> {
        let model = parameters.model(values)?;
        let width = model.parameters() + 1;
        let linearizer = Linearizer { windows: self, model: &model, width };
        let tasks = self.tasks(model.warm_up());
        let parts: Vec<Option<TaskResult>> = tasks.par_iter().map(|task| linearizer.process(task)).collect();
        let n = model.outputs();
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

struct TaskResult {
    cost: f64,
    errors: u64,
    squares: Vec<(f64, u64)>,
    qr: QrFactor,
}

struct Linearizer<'a, M> {
    windows: &'a Windows<'a>,
    model: &'a M,
    width: usize,
}

struct Buffers {
    y: Vec<f64>,
    jacobian: Vec<f64>,
    start_jacobian: Vec<f64>,
    matrix: Vec<f64>,
    block: Vec<f64>,
    filled: usize,
    work: Workspace,
}

impl<M: ShootingModel> Linearizer<'_, M> {
    fn process(&self, task: &Task<'_>) -> Option<TaskResult> {
        let (n, h) = (self.model.outputs(), self.windows.horizon);
        let run = task.run;
        let columns = n + self.width;
        let mut past = self.model.past();
        let mut buffers = Buffers {
            y: vec![0.0; (h + 1) * n],
            jacobian: vec![0.0; (h + 1) * n * (columns - 1)],
            start_jacobian: vec![0.0; (h + 1) * n * n],
            matrix: vec![0.0; columns * (h + 1) * n],
            block: vec![0.0; self.width * BLOCK_ROWS],
            filled: 0,
            work: Workspace::new(),
        };
        let mut part =
            TaskResult { cost: 0.0, errors: 0, squares: vec![(0.0, 0); n], qr: QrFactor::new(self.width) };
        let from = task.first.saturating_sub(SETTLING * self.model.warm_up());
        for k in from..task.end {
            self.model.observe(&mut past, run.outputs.row(k));
            let starts = k >= task.first && (k - task.first).is_multiple_of(self.windows.stride);
            // Windows with a gap at the start or in the past are skipped.
            if starts && self.model.is_known(&past) {
                self.window(run, k, &past, &mut buffers, &mut part)?;
            }
            self.model.wait(&mut past, run.inputs.row(k));
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
        past: &M::Past,
        buffers: &mut Buffers,
        part: &mut TaskResult,
    ) -> Option<()> {
        let (n, h) = (self.model.outputs(), self.windows.horizon);
        let m = self.model.inputs();
        let commands: Vec<f64> = (k..k + h).flat_map(|j| run.inputs.row(j)[..m].iter().copied()).collect();
        if commands.iter().any(|c| !c.is_finite()) {
            return Some(());
        }
        let measured = |j: usize, i: usize| run.outputs.row(k + j)[i];
        let mut start = run.outputs.row(k)[..n].to_vec();
        let Buffers { y, jacobian, start_jacobian, work, .. } = &mut *buffers;
        for _ in 0..START_STEPS {
            self.model.roll_start(past, &start, &commands, work, y, start_jacobian);
            self.check(y)?;
            let step = self.start_step(y, start_jacobian, &start, measured);
            start.iter_mut().zip(step).for_each(|(x, d)| *x += d);
        }
        self.model.roll(past, &start, &commands, work, y, jacobian);
        self.check(y)?;
        let rows = (h + 1) * n;
        let columns = n + self.width;
        buffers.matrix.fill(0.0);
        // Columns: start, parameters, error.
        let p = columns - 1;
        let mut losses = 0.0;
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
                buffers.matrix[(columns - 1) * rows + row] = e * factor;
                for q in 0..p {
                    buffers.matrix[q * rows + row] = weight * factor * buffers.jacobian[row * p + q];
                }
                if j > 0 {
                    part.squares[i].0 += error * error;
                    part.squares[i].1 += 1;
                    part.errors += 1;
                }
            }
        }
        part.cost += losses;
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
        let n = self.model.outputs();
        let bad = |row: &[f64]| row.iter().zip(self.windows.ranges).any(|(y, range)| range.diverged(*y));
        (!y.chunks_exact(n).any(bad)).then_some(())
    }

    fn start_step(
        &self,
        y: &[f64],
        start_jacobian: &[f64],
        start: &[f64],
        measured: impl Fn(usize, usize) -> f64,
    ) -> Vec<f64> {
        let n = self.model.outputs();
        let mut matrix = vec![0.0; n * (n + 1)];
        for j in 0..=self.windows.horizon {
            for i in 0..n {
                let (weight, error) = if j == 0 {
                    (self.windows.start[i], measured(0, i) - start[i])
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
