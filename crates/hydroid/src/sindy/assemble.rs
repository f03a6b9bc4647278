//! Streams runs through a library and a regression into a [`QrFactor`].

use hydroid_core::model::sparse::{Program, Signal};
use rayon::prelude::*;

use super::qr::{BLOCK_ROWS, QrFactor};
use super::regression_form::{Nodes, RegressionForm, Rows};
use super::robust::{HuberWeights, ResidualHistogram};
use crate::log::Trajectory;

/// Rows per task. The split depends only on the data, so the result does not depend on the number of threads.
const TASK_ROWS: usize = 4096;

/// Largest number of concurrent pieces; it bounds the memory for logs of any length.
const BATCH: usize = 32;

const POINTS: usize = 256;

/// Regression of all runs. Columns: terms, then derivatives of the outputs.
#[derive(Clone, Debug)]
pub struct Assembled {
    /// Factor of `[theta | dy/dt]`.
    pub qr: QrFactor,
    /// Factors of contiguous groups of rows for the block bootstrap; empty for fewer than two groups.
    pub groups: Vec<QrFactor>,
    /// Number of rows omitted because of a missing sample.
    pub skipped: u64,
    /// Histogram of the residuals of each output, if [`AssemblyOptions::robust`] is set.
    pub residuals: Vec<ResidualHistogram>,
}

/// Options of the assembly of rows.
#[derive(Clone, Debug, Default)]
pub struct AssemblyOptions<'a> {
    /// Additional variables of the program after outputs and inputs.
    pub signals: &'a [Signal],
    /// Number of groups of rows with a factor of their own.
    pub groups: usize,
    /// Weight of each sample of each run; empty for unit weights. A row has the smallest weight of its samples.
    pub weights: &'a [Vec<f64>],
    /// Weight of each row of each run, in place of the weights of samples; empty for none.
    pub row_weights: &'a [Vec<f64>],
    /// Equations for a robust loss: rows with large residuals get smaller weights.
    pub robust: Option<HuberWeights>,
}

/// QR factor of all runs. Rows with a missing sample are omitted.
pub fn assemble(program: &Program, runs: &[&Trajectory], regression: RegressionForm) -> Assembled {
    assemble_with(program, runs, regression, &AssemblyOptions::default())
}

/// As [`assemble`], with options. Rows with a sample in the warm-up of a signal are omitted as well.
///
/// # Panics
/// If the shape of the sample weights does not match the runs.
pub fn assemble_with(
    program: &Program,
    runs: &[&Trajectory],
    regression: RegressionForm,
    options: &AssemblyOptions<'_>,
) -> Assembled {
    let outputs = runs.first().map_or(0, |run| run.outputs.width());
    let width = program.len() + outputs;
    let count = options.groups.max(1);
    let tasks = tasks(runs, regression, count);
    let sources: Vec<RunData<'_>> = runs.iter().map(|run| RunData::new(run, options.signals)).collect();
    let mut groups = vec![QrFactor::new(width); count];
    let mut skipped = 0;
    let mut residuals =
        vec![ResidualHistogram::default(); if options.robust.is_some() { outputs } else { 0 }];
    for batch in tasks.chunks(BATCH) {
        let parts: Vec<TaskResult> = batch
            .par_iter()
            .map_init(
                || TaskScratch::new(program, regression.nodes(), outputs, options),
                |scratch, (index, rows, _)| scratch.process(*index, &sources[*index], rows),
            )
            .collect();
        for (part, (_, _, group)) in parts.into_iter().zip(batch) {
            groups[*group].merge(&part.qr);
            skipped += part.skipped;
            for (all, more) in residuals.iter_mut().zip(&part.residuals) {
                all.merge(more);
            }
        }
    }
    if count == 1 {
        return Assembled { qr: groups.swap_remove(0), groups, skipped, residuals };
    }
    let mut qr = QrFactor::new(width);
    for group in &groups {
        qr.merge(group);
    }
    Assembled { qr, groups, skipped, residuals }
}

/// Index of the run, rows and group of each piece, in order. A piece belongs to one group.
fn tasks(runs: &[&Trajectory], regression: RegressionForm, groups: usize) -> Vec<(usize, Rows, usize)> {
    let all: Vec<(usize, Rows)> = runs
        .iter()
        .enumerate()
        .flat_map(|(index, run)| {
            regression.rows(run.len(), run.dt).into_iter().map(move |rows| (index, rows))
        })
        .collect();
    let total: usize = all.iter().map(|(_, rows)| rows.count).sum();
    let mut tasks = Vec::new();
    let (mut group, mut done) = (0, 0);
    for (index, rows) in all {
        let mut start = 0;
        while start < rows.count {
            while total * (group + 1) / groups <= done {
                group += 1;
            }
            let room = total * (group + 1) / groups - done;
            let count = TASK_ROWS.min(rows.count - start).min(room);
            let first = rows.first + start * rows.stride;
            tasks.push((index, Rows { first, count, ..rows.clone() }, group));
            start += count;
            done += count;
        }
    }
    tasks
}

struct RunData<'a> {
    run: &'a Trajectory,
    /// Values at the samples, and whether they are constant over an interval.
    signals: Vec<(Vec<f64>, bool)>,
}

impl<'a> RunData<'a> {
    fn new(run: &'a Trajectory, signals: &[Signal]) -> Self {
        let outputs = run.outputs.width();
        let series = |signal: &Signal| {
            let variable = usize::from(signal.source());
            let source: Vec<f64> = if variable < outputs {
                run.outputs.column(variable).collect()
            } else {
                run.inputs.column(variable - outputs).collect()
            };
            (signal.series(&source, run.dt), signal.is_held(outputs))
        };
        Self { run, signals: signals.iter().map(series).collect() }
    }
}

struct TaskResult {
    qr: QrFactor,
    skipped: u64,
    residuals: Vec<ResidualHistogram>,
}

struct TaskScratch<'a> {
    program: &'a Program,
    nodes: Nodes,
    outputs: usize,
    /// Library slots of `POINTS` points.
    slots: Vec<f64>,
    /// Library terms of all points of a group of rows, one term after another.
    library: Vec<f64>,
    /// Buffered rows, column-major.
    block: Vec<f64>,
    options: &'a AssemblyOptions<'a>,
}

impl<'a> TaskScratch<'a> {
    fn new(program: &'a Program, nodes: Nodes, outputs: usize, options: &'a AssemblyOptions<'a>) -> Self {
        Self {
            program,
            nodes,
            outputs,
            slots: vec![0.0; program.slots() * POINTS],
            library: Vec::new(),
            block: vec![0.0; (program.len() + outputs) * BLOCK_ROWS],
            options,
        }
    }

    fn process(&mut self, index: usize, source: &RunData<'_>, rows: &Rows) -> TaskResult {
        let mut part = TaskResult {
            qr: QrFactor::new(self.program.len() + self.outputs),
            skipped: 0,
            residuals: vec![ResidualHistogram::default(); self.outputs],
        };
        for start in (0..rows.count).step_by(BLOCK_ROWS) {
            let count = BLOCK_ROWS.min(rows.count - start);
            let first = rows.first + start * rows.stride;
            self.evaluate(source, first, (count - 1) * rows.stride + rows.kernel.library.len());
            let mut good = self.fill_block(source.run, rows, first, count);
            part.skipped += (count - good) as u64;
            if let Some(huber) = &self.options.robust {
                huber.apply(&mut self.block, self.program.len(), &mut part.residuals);
            }
            if let Some(weights) = self.options.row_weights.get(index) {
                good -= self.weigh(rows, first, count, |at| weights[at / rows.stride]);
            } else if let Some(weights) = self.options.weights.get(index) {
                let samples = rows.kernel.outputs.len();
                let least =
                    |at: usize| weights[at..at + samples].iter().copied().fold(f64::INFINITY, f64::min);
                good -= self.weigh(rows, first, count, least);
            }
            part.qr.append_rows(&mut self.block, good);
        }
        part
    }

    /// Multiplies the rows by the square roots of their weights. Returns the number of rows that become zero.
    fn weigh(&mut self, rows: &Rows, first: usize, count: usize, weight: impl Fn(usize) -> f64) -> usize {
        let mut lost = 0;
        for i in 0..count {
            let weight = weight(first + i * rows.stride);
            let mut zero = true;
            for column in self.block.chunks_exact_mut(BLOCK_ROWS) {
                zero &= column[i] == 0.0;
                column[i] *= weight.sqrt();
            }
            lost += usize::from(weight == 0.0 && !zero);
        }
        lost
    }

    /// Evaluates the library at `points` points from `first` on into `self.library`, one term after another.
    fn evaluate(&mut self, source: &RunData<'_>, first: usize, points: usize) {
        let run = source.run;
        let terms = self.program.len();
        if self.library.len() < terms * points {
            self.library.resize(terms * points, 0.0);
        }
        let (n, m) = (run.outputs.width(), run.inputs.width());
        for start in (0..points).step_by(POINTS) {
            let count = POINTS.min(points - start);
            let at = first + start;
            let y = run.outputs.rows(at, at + count);
            match self.nodes {
                Nodes::Samples => {
                    for channel in 0..n {
                        let column = &mut self.slots[(1 + channel) * count..][..count];
                        for (value, row) in column.iter_mut().zip(y.chunks_exact(n)) {
                            *value = row[channel];
                        }
                    }
                }
                Nodes::Midpoints => {
                    let next = run.outputs.rows(at + 1, at + 1 + count);
                    for channel in 0..n {
                        let column = &mut self.slots[(1 + channel) * count..][..count];
                        let pairs = y.chunks_exact(n).zip(next.chunks_exact(n));
                        for (value, (a, b)) in column.iter_mut().zip(pairs) {
                            *value = 0.5 * (a[channel] + b[channel]);
                        }
                    }
                }
            }
            if m > 0 {
                let c = run.inputs.rows(at, at + count);
                for channel in 0..m {
                    let column = &mut self.slots[(1 + n + channel) * count..][..count];
                    for (value, row) in column.iter_mut().zip(c.chunks_exact(m)) {
                        *value = row[channel];
                    }
                }
            }
            for (index, (values, held)) in source.signals.iter().enumerate() {
                let column = &mut self.slots[(1 + n + m + index) * count..][..count];
                if *held || self.nodes == Nodes::Samples {
                    column.copy_from_slice(&values[at..at + count]);
                } else {
                    for (value, pair) in column.iter_mut().zip(values[at..=at + count].windows(2)) {
                        *value = 0.5 * (pair[0] + pair[1]);
                    }
                }
            }
            self.program.evaluate_block(&mut self.slots, count);
            for term in 0..terms {
                let slot = self.program.slot(term);
                self.library[term * points + start..][..count]
                    .copy_from_slice(&self.slots[slot * count..(slot + 1) * count]);
            }
        }
    }

    /// Writes `count` rows into the block, zero if a sample is missing. Returns the number of complete rows.
    fn fill_block(&mut self, run: &Trajectory, rows: &Rows, first: usize, count: usize) -> usize {
        let terms = self.program.len();
        let (library, outputs) = self.block.split_at_mut(terms * BLOCK_ROWS);
        let weights = &rows.kernel.library;
        let points = (count - 1) * rows.stride + weights.len();
        let everywhere = weights.iter().all(|w| *w != 0.0);
        for (term, column) in library.chunks_exact_mut(BLOCK_ROWS).enumerate() {
            let values = &self.library[term * points..(term + 1) * points];
            if *weights == [1.0] && rows.stride == 1 {
                column[..count].copy_from_slice(values);
            } else {
                for (i, value) in column[..count].iter_mut().enumerate() {
                    let window = &values[i * rows.stride..][..weights.len()];
                    *value = if everywhere {
                        dot(weights, window)
                    } else {
                        weighted(weights, window.iter().copied())
                    };
                }
            }
        }
        for (channel, column) in outputs.chunks_exact_mut(BLOCK_ROWS).enumerate() {
            for (i, value) in column[..count].iter_mut().enumerate() {
                let at = first + i * rows.stride;
                let window = (0..).map(|j| run.outputs.row(at + j)[channel]);
                *value = weighted(&rows.kernel.outputs, window);
            }
        }
        // NaN and infinity give NaN here.
        let mut trace = [0.0; BLOCK_ROWS];
        for column in self.block.chunks_exact_mut(BLOCK_ROWS) {
            column[count..].fill(0.0);
            for (trace, value) in trace.iter_mut().zip(&*column) {
                *trace += 0.0 * value;
            }
        }
        let mut good = count;
        for (i, _) in trace.iter().enumerate().filter(|(_, trace)| trace.is_nan()) {
            good -= 1;
            for column in self.block.chunks_exact_mut(BLOCK_ROWS) {
                column[i] = 0.0;
            }
        }
        good
    }
}

/// Sum of products in eight lanes, which the compiler vectorizes (`cargo bench -p hydroid --bench sindy -- weak`).
fn dot(weights: &[f64], values: &[f64]) -> f64 {
    let (weights, values) = (weights.chunks_exact(8), values.chunks_exact(8));
    let rest = weights.remainder().iter().zip(values.remainder()).map(|(w, v)| w * v).sum::<f64>();
    let mut lanes = [0.0; 8];
    for (w, v) in weights.zip(values) {
        for lane in 0..8 {
            lanes[lane] += w[lane] * v[lane];
        }
    }
    lanes.iter().sum::<f64>() + rest
}

/// Weighted sum over the non-zero weights; values with weight zero may be missing.
fn weighted(weights: &[f64], values: impl Iterator<Item = f64>) -> f64 {
    weights.iter().zip(values).filter(|(w, _)| **w != 0.0).map(|(w, value)| w * value).sum()
}
