//! The functions `f` and `g`, and the step over a sample.

use num_traits::Float;

use super::model::ControlAffine;
use crate::actuator::{lag_step, rk4_first_stage};
use crate::model::direct::ForwardPass;

#[derive(Clone, Debug)]
pub(crate) struct Field {
    forward: ForwardPass,
    outputs: usize,
    inputs: usize,
    /// Decay of the difference to the command over half a sample, for each actuator.
    halves: alloc::vec::Vec<f64>,
    /// Weight of this difference in the first stage ([`rk4_first_stage`]).
    firsts: alloc::vec::Vec<f64>,
}

impl Field {
    pub(crate) fn new(model: &ControlAffine) -> Self {
        let half = |t: f64| Float::exp(-0.5 * model.dt / t);
        let lags = || model.effectors.iter().map(|effector| effector.time_constant_s);
        Self {
            forward: ForwardPass::new(&model.network),
            outputs: model.outputs(),
            inputs: model.inputs(),
            halves: lags().map(half).collect(),
            firsts: lags().map(|t| rk4_first_stage(model.dt / t)).collect(),
        }
    }

    pub(crate) fn scratch(&self) -> usize {
        let (n, m) = (self.outputs, self.inputs);
        n + self.forward.hidden() + n * (1 + m) + 3 * n + m
    }

    /// `N(z)` at outputs `y`: `n (1 + m)` numbers in the scratch.
    pub(crate) fn evaluate<'a>(&self, model: &ControlAffine, y: &[f64], scratch: &'a mut [f64]) -> &'a [f64] {
        let (z, rest) = scratch.split_at_mut(self.outputs);
        let (hidden, g) = rest.split_at_mut(self.forward.hidden());
        for (i, z) in z.iter_mut().enumerate() {
            *z = (y[i] - model.scaling.output_mean[i]) / model.scaling.output_scale[i];
        }
        let g = &mut g[..self.outputs * (1 + self.inputs)];
        let last_layer = self.forward.last_layer(&model.weights);
        self.forward.evaluate([&model.weights, last_layer], z, hidden, g);
        g
    }

    /// `rate <- dy/dt` with efforts in units of `w`.
    fn rate(&self, model: &ControlAffine, y: &[f64], efforts: &[f64], scratch: &mut [f64], rate: &mut [f64]) {
        let n = self.outputs;
        let g = self.evaluate(model, y, scratch);
        for (j, rate) in rate.iter_mut().enumerate() {
            let pushed = efforts.iter().enumerate().map(|(i, effort)| g[n * (1 + i) + j] * effort);
            *rate = model.scaling.correction_scale[j] * (g[j] + pushed.sum::<f64>());
        }
    }

    fn half(&self, a: &mut [f64], c: &[f64]) {
        for ((a, &c), half) in a.iter_mut().zip(c).zip(&self.halves) {
            *a = lag_step(*a, c, *half);
        }
    }

    /// Advances the actuators alone by a sample.
    pub(crate) fn wait(&self, state: &mut [f64], c: &[f64]) {
        let a = &mut state[self.outputs..];
        self.half(a, c);
        self.half(a, c);
    }

    pub(crate) fn step(&self, model: &ControlAffine, state: &mut [f64], c: &[f64], scratch: &mut [f64]) {
        let (n, h) = (self.outputs, model.dt);
        let (y, a) = state.split_at_mut(n);
        let own = scratch.len() - (3 * n + self.inputs);
        let (scratch, rest) = scratch.split_at_mut(own);
        let (k, rest) = rest.split_at_mut(n);
        let (sum, rest) = rest.split_at_mut(n);
        let (moved, efforts) = rest.split_at_mut(n);
        for (a, &c) in a.iter_mut().zip(c) {
            if a.is_nan() {
                *a = c;
            }
        }
        sum.fill(0.0);
        for (stage, (offset, weight)) in
            [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)].into_iter().enumerate()
        {
            if stage % 2 == 1 {
                self.half(a, c);
            }
            for (i, (effort, effector)) in efforts.iter_mut().zip(&model.effectors).enumerate() {
                let seen = if stage == 0 { c[i] + (a[i] - c[i]) * self.firsts[i] } else { a[i] };
                *effort = effector.map.value(seen) / effector.unit;
            }
            for j in 0..n {
                moved[j] = y[j] + if stage == 0 { 0.0 } else { offset * h * k[j] };
            }
            self.rate(model, moved, efforts, scratch, k);
            sum.iter_mut().zip(&*k).for_each(|(sum, k)| *sum += weight * k);
        }
        y.iter_mut().zip(&*sum).for_each(|(y, sum)| *y += h / 6.0 * sum);
    }
}
