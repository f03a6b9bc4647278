//! Windows whose targets are not yet complete.

use alloc::vec;
use alloc::vec::Vec;

use crate::memory::Memory;
use crate::model::direct::{Direct, Window, push};
use crate::model::recurrent::BaseModel;

/// Outputs, commands and measurements since the start of the oldest window. All open windows share these samples.
///
/// At the sample `m` the oldest window ended at `k = m - H`. It used the outputs from `k - p + 1`, and its last target
/// is `y_m`.
#[derive(Clone, Debug)]
pub(super) struct Windows {
    window: Window,
    /// Measured or predicted outputs, `k-p+1 .. m`.
    outputs: Vec<f64>,
    /// Commands: `k-p+1 .. m-1`.
    commands: Vec<f64>,
    /// Measured outputs, NaN where missing: `k+1 .. m`.
    measured: Vec<f64>,
    inflation: Vec<f64>,
    /// Memory of the base equations at the samples `k .. m`; empty without equations.
    memory: Vec<f64>,
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

    /// Restarts the windows with the past of a session.
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

    /// Stores a measurement and the past outputs of the session; the first measurement of an output also replaces its
    /// earlier values. Returns whether this is the first measurement of the sample.
    pub(super) fn observe(&mut self, y: &[f64], outputs: &[f64], inflation: f64) -> bool {
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

    /// Advances by one sample with its command, the predicted outputs, and the memory of the base equations.
    pub(super) fn advance(&mut self, c: &[f64], predicted: &[f64], memory: &[f64]) {
        push(&mut self.outputs, predicted);
        push(&mut self.commands, c);
        push(&mut self.memory, memory);
        let kept = self.measured.len() - predicted.len();
        self.measured.copy_within(predicted.len().., 0);
        self.measured[kept..].fill(f64::NAN);
        push(&mut self.inflation, &[1.0]);
        self.open = true;
    }

    /// Outputs, past commands and commands over the horizon of the oldest window; `None` if a value is unknown.
    pub(super) fn oldest(&self) -> Option<[&[f64]; 3]> {
        let outputs = &self.outputs[..self.window.outputs()];
        let (passed, ahead) = self.commands.split_at((self.window.p - 1) * self.window.m);
        let known = |numbers: &[f64]| numbers.iter().all(|x| x.is_finite());
        (known(outputs) && known(&self.commands)).then_some([outputs, passed, ahead])
    }

    pub(super) fn oldest_base(&self) -> [&[f64]; 3] {
        let Window { n, m, p, h } = self.window;
        let memory = &self.memory[..self.memory.len() / (h + 1)];
        [&self.outputs[(p - 1) * n..p * n], memory, &self.commands[(p - 1) * m..]]
    }

    /// `x <- t - x` with the scaled targets `t` of the oldest window; NaN if missing. `of_equations` is the prediction
    /// of the base equations.
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

    pub(super) fn inflation(&self, target: usize) -> f64 {
        self.inflation[target / self.window.n]
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        let Self { outputs, commands, measured, inflation, memory: of_base, .. } = self;
        for numbers in [outputs, commands, measured, inflation, of_base] {
            memory.numbers(numbers);
        }
        memory.flag(&mut self.open);
    }
}
