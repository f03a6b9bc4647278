//! The windows whose targets are still to come.

use alloc::vec;
use alloc::vec::Vec;

use crate::adapt::memory::{Reader, Writer};
use crate::model::direct::{Direct, Window, push};
use crate::model::recurrent::BaseModel;

/// Outputs, commands and measurements since the beginning of the oldest window: all of them share one row of samples.
///
/// At the sample `m` the oldest window is that which ended at `k = m - H`; it read the outputs from `k - p + 1` on, and the last of its targets
/// is `y_m`.
#[derive(Clone, Debug)]
pub(super) struct Windows {
    window: Window,
    /// Outputs as the network read them, measured or predicted: `k-p+1 .. m`.
    outputs: Vec<f64>,
    /// Commands: `k-p+1 .. m-1`.
    commands: Vec<f64>,
    /// Outputs as they were measured, NaN where they were not: `k+1 .. m`.
    measured: Vec<f64>,
    /// What the noise of each of these rows counts for.
    inflation: Vec<f64>,
    /// What the model's equations remembered at each sample `k .. m`; empty without equations.
    memory: Vec<f64>,
    /// Whether the present sample was not taken yet.
    open: bool,
}

impl Windows {
    pub(super) fn new(model: &Direct) -> Self {
        let window = Window::of(model);
        let Window { n, m, p, h } = window;
        Self {
            window,
            outputs: vec![f64::NAN; (p + h) * n],
            commands: vec![f64::NAN; (p + h - 1) * m],
            measured: vec![f64::NAN; h * n],
            inflation: vec![1.0; h],
            memory: vec![f64::NAN; (h + 1) * model.below().saturating_sub(n)],
            open: true,
        }
    }

    /// Nothing is known of the past but what a session remembers of it.
    pub(super) fn restart(&mut self, (outputs, commands): (&[f64], &[f64]), memory: &[f64]) {
        self.outputs.fill(f64::NAN);
        self.commands.fill(f64::NAN);
        self.measured.fill(f64::NAN);
        self.inflation.fill(1.0);
        self.memory.fill(f64::NAN);
        push(&mut self.outputs, outputs);
        push(&mut self.commands, commands);
        push(&mut self.memory, memory);
        self.open = true;
    }

    /// Takes a measurement, and the outputs that the session remembers with it (a value that is measured for the first time stands
    /// for those before it). Gives whether it is the first of this sample.
    pub(super) fn measure(&mut self, y: &[f64], outputs: &[f64], inflation: f64) -> bool {
        let at = self.outputs.len() - outputs.len();
        self.outputs[at..].copy_from_slice(outputs);
        let at = self.measured.len() - y.len();
        for (into, &y) in self.measured[at..].iter_mut().zip(y).filter(|(_, y)| y.is_finite()) {
            *into = y;
        }
        if let Some(last) = self.inflation.last_mut() {
            *last = inflation;
        }
        core::mem::take(&mut self.open)
    }

    /// Moves on under a command to a sample of which this is predicted, and at which equations remember this.
    pub(super) fn pass(&mut self, c: &[f64], predicted: &[f64], memory: &[f64]) {
        push(&mut self.outputs, predicted);
        push(&mut self.commands, c);
        push(&mut self.memory, memory);
        let kept = self.measured.len() - predicted.len();
        self.measured.copy_within(predicted.len().., 0);
        self.measured[kept..].fill(f64::NAN);
        push(&mut self.inflation, &[1.0]);
        self.open = true;
    }

    /// Outputs, commands that had passed and commands that came of the oldest window; none while something of it is not known.
    pub(super) fn oldest(&self) -> Option<[&[f64]; 3]> {
        let outputs = &self.outputs[..self.window.outputs()];
        let (passed, ahead) = self.commands.split_at((self.window.p - 1) * self.window.m);
        let known = |numbers: &[f64]| numbers.iter().all(|x| x.is_finite());
        (known(outputs) && known(&self.commands)).then_some([outputs, passed, ahead])
    }

    /// Of the oldest window: the outputs at its end, what equations remembered there, and the commands that came.
    pub(super) fn oldest_below(&self) -> [&[f64]; 3] {
        let Window { n, m, p, h } = self.window;
        let memory = &self.memory[..self.memory.len() / (h + 1)];
        [&self.outputs[(p - 1) * n..p * n], memory, &self.commands[(p - 1) * m..]]
    }

    /// `x <- t - x` of the oldest window's targets, scaled; NaN where nothing was measured. `of_equations` is what equations say of
    /// them, where the model adds to these.
    pub(super) fn subtract_from_targets(&self, model: &Direct, of_equations: &[f64], x: &mut [f64]) {
        let Window { n, p, .. } = self.window;
        let s = &model.scaling;
        for (i, (x, y)) in x.iter_mut().zip(&self.measured).enumerate() {
            let c = i % n;
            let base = match model.base {
                BaseModel::Nothing => s.output_mean[c],
                BaseModel::Hold => self.outputs[(p - 1) * n + c],
                BaseModel::Equations(_) => of_equations[i],
            };
            *x = (y - base) / s.correction_scale[c] - *x;
        }
    }

    /// What the noise of a target counts for.
    pub(super) fn inflation(&self, target: usize) -> f64 {
        self.inflation[target / self.window.n]
    }

    pub(super) fn memory_len(&self) -> usize {
        let parts = [&self.outputs, &self.commands, &self.measured, &self.inflation, &self.memory];
        parts.into_iter().map(Vec::len).sum::<usize>() + 1
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        for numbers in [&self.outputs, &self.commands, &self.measured, &self.inflation, &self.memory] {
            into.numbers(numbers);
        }
        into.flag(self.open);
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        let Self { outputs, commands, measured, inflation, memory, .. } = self;
        for numbers in [outputs, commands, measured, inflation, memory] {
            from.numbers(numbers);
        }
        self.open = from.flag();
    }
}
