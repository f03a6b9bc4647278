//! Control-affine networks: forward integration and backward pass.

use hydroid_core::actuator::{Map, rk4_first_stage};
use hydroid_core::math::Scalar;
use hydroid_core::model::affine::Effector;
use hydroid_core::model::direct::{Batch, Perceptron};
use hydroid_core::model::recurrent::Scaling;

use super::windows::{ScaledRun, Shape, Window};

/// Limits of the logarithm of a time constant in samples.
const LAGS: (f64, f64) = (-4.0, 8.0);

/// Initial time constant \[samples\].
const FIRST_LAG: f64 = 5.0;

/// Stages of RK4: offset in half steps, weight.
const STAGES: [(usize, f64); 4] = [(0, 1.0), (1, 2.0), (1, 2.0), (2, 1.0)];

/// Actuator values in a step: at its start, middle and end.
const SEEN: usize = 3;

/// Structure of a control-affine network. The logarithms of the time constants in samples follow its weights.
#[derive(Clone, Debug)]
pub(super) struct Parts {
    pub(super) network: Perceptron,
    pub(super) maps: Vec<Map>,
    /// Size of each effort.
    pub(super) units: Vec<f64>,
    pub(super) dt: f64,
    /// Samples before the origin over which the observer acts.
    pub(super) settle: usize,
}

/// Remaining share of the observer's initial error at the origin.
const LEFT: f64 = 0.1;

impl Parts {
    pub(super) fn first_lags<T: Scalar>(&self) -> impl Iterator<Item = T> {
        std::iter::repeat_n(T::of(FIRST_LAG.ln()), self.maps.len())
    }

    pub(super) fn effectors<T: Scalar>(&self, lags: &[T]) -> Vec<Effector> {
        let each = self.maps.iter().zip(&self.units).zip(lags);
        each.map(|((&map, &unit), lag)| Effector {
            map,
            time_constant_s: self.dt * lag.wide().clamp(LAGS.0, LAGS.1).exp(),
            unit,
        })
        .collect()
    }
}

/// Windows in parallel lanes. With scaled outputs `z` and actuator states that follow their commands from the start of
/// the wash-out:
///
/// ```text
/// dz/dt = ratio ( f(z) + sum_i g_i(z) e_i ),     e_i = phi_i(a_i) / w_i,     RK4 over each sample
/// z_k  <- z_k + K (measured_k - z_k)     for k = o - settle + 1 .. o,     z_{o-settle} = measured
/// L     = sum over k = 1 .. length, outputs j:  w_j (z_{o+k,j} - measured_{o+k,j})^2
/// ```
///
/// The second line is an observer with `(1 - K)^settle = 1/10`, active if `settle > 0`: starting from one noisy
/// measurement would bias the regression (errors in variables). Sources: L. Ljung, *System Identification*, 2nd ed.,
/// 1999, sections 3.3 and 7.3; T. Soderstrom, *Errors-in-variables methods in system identification*, Automatica, 2007.
///
/// Actuator states depend on commands and their time constant only: their sensitivity is propagated forward, and the
/// backward pass runs through the stages of RK4.
#[derive(Clone, Debug)]
pub(super) struct Affine<T> {
    parts: Parts,
    shape: Shape,
    lanes: usize,
    /// Observer steps before the origin; 0 in validation, as in a session.
    settle: usize,
    /// `K`.
    gain: T,
    /// `correction_scale / output_scale` \[1/s\].
    ratio: Vec<T>,
    /// Stages of all steps, or of one step without a backward pass.
    stages: Vec<Batch<T>>,
    windows: Vec<Window>,
    /// Efforts at the stages of each step, `SEEN x inputs x lanes`, and their derivatives by the logarithm of the lag.
    efforts: Vec<T>,
    slopes: Vec<T>,
    /// `z_o ..`, each `outputs x lanes`.
    states: Vec<T>,
    rate: Vec<T>,
    /// Adjoints of the state, of its stage part, and of a stage's input; gradient of a stage.
    adjoint: Vec<T>,
    parts_adjoint: Vec<T>,
    input_adjoint: Vec<T>,
    gradient: Vec<T>,
}

impl<T: Scalar> Affine<T> {
    pub(super) fn new(parts: &Parts, scaling: &Scaling, shape: Shape, size: usize, back: bool) -> Self {
        let batch = Batch::new(&parts.network, size);
        let lanes = batch.lanes();
        let (row, inputs) = (shape.outputs * lanes, shape.inputs * lanes);
        let ratio = scaling.correction_scale.iter().zip(&scaling.output_scale).map(|(c, s)| T::of(c / s));
        let settle = if back { parts.settle.min(shape.wash_out) } else { 0 };
        let steps = settle + shape.length;
        let seen = SEEN * steps * inputs;
        Self {
            lanes,
            settle,
            gain: T::of(1.0 - LEFT.powf(1.0 / settle.max(1) as f64)),
            ratio: ratio.collect(),
            stages: vec![batch; if back { STAGES.len() * steps } else { 1 }],
            windows: Vec::with_capacity(size),
            efforts: vec![T::zero(); seen],
            slopes: vec![T::zero(); seen],
            states: vec![T::zero(); (steps + 1) * row],
            rate: vec![T::zero(); row],
            adjoint: vec![T::zero(); row],
            parts_adjoint: vec![T::zero(); row],
            input_adjoint: vec![T::zero(); row],
            gradient: vec![T::zero(); parts.network.weights()],
            parts: parts.clone(),
            shape,
        }
    }

    pub(super) fn forward(&mut self, weights: &[T], runs: &[ScaledRun<T>], windows: &[Window]) {
        self.windows.clear();
        self.windows.extend_from_slice(windows);
        let count = self.parts.network.weights();
        self.actuate(&weights[count..], runs);
        self.begin(runs);
        let row = self.shape.outputs * self.lanes;
        for k in 0..self.settle + self.shape.length {
            let (before, after) = self.states.split_at_mut((k + 1) * row);
            let (z, next) = (&before[k * row..], &mut after[..row]);
            next.copy_from_slice(z);
            for (stage, (halves, weight)) in STAGES.into_iter().enumerate() {
                let at = if self.stages.len() > 1 { STAGES.len() * k + stage } else { 0 };
                let batch = &mut self.stages[at];
                let offset = T::of(0.5 * halves as f64 * self.parts.dt);
                for ((x, &z), &rate) in batch.input_mut().iter_mut().zip(z).zip(&self.rate) {
                    *x = if halves == 0 { z } else { z + offset * rate };
                }
                batch.forward(&weights[..count]);
                let efforts = &self.efforts[(SEEN * k + halves) * self.shape.inputs * self.lanes..];
                rates(batch.output(), efforts, &self.ratio, (self.shape.inputs, self.lanes), &mut self.rate);
                let share = T::of(weight * self.parts.dt / 6.0);
                for (next, &rate) in next.iter_mut().zip(&self.rate) {
                    *next += share * rate;
                }
            }
            if k < self.settle {
                let gain = self.gain;
                measured(
                    &self.windows,
                    runs,
                    (self.shape.outputs, self.lanes),
                    self.settle - 1 - k,
                    |at, value| {
                        next[at] += gain * (value - next[at]);
                    },
                );
            }
        }
    }

    fn actuate(&mut self, lags: &[T], runs: &[ScaledRun<T>]) {
        let Shape { inputs: m, wash_out, length, .. } = self.shape;
        let (lanes, steps) = (self.lanes, self.settle + length);
        self.efforts.fill(T::zero());
        self.slopes.fill(T::zero());
        for (i, lag) in lags.iter().enumerate() {
            // Decay exp(-1/T) per sample, with T in samples, and its derivative by ln T.
            let inverse = (-lag.wide().clamp(LAGS.0, LAGS.1)).exp();
            let of = |samples: f64| {
                let decay = (-samples * inverse).exp();
                (decay, decay * samples * inverse)
            };
            let ((whole, whole_slope), (half, half_slope)) = (of(1.0), of(0.5));
            let mean = -(-inverse).exp_m1() / inverse;
            let (first, first_slope) =
                (rk4_first_stage(inverse), 6.0 * (mean - whole) - 4.0 * half_slope - whole_slope);
            let (map, unit) = (self.parts.maps[i], self.parts.units[i]);
            for (lane, window) in self.windows.iter().enumerate() {
                let command = |k: usize| runs[window.run].commands[k * m + i];
                let (rest, begin) = (window.origin - wash_out, window.origin - self.settle);
                let (mut a, mut slope) = (command(rest), 0.0);
                for k in rest..begin {
                    let off = a - command(k);
                    (a, slope) = (command(k) + off * whole, slope * whole + off * whole_slope);
                }
                for k in 0..steps {
                    let c = command(begin + k);
                    let mut see = |halves: usize, a: f64, slope: f64| {
                        let place = ((SEEN * k + halves) * m + i) * lanes + lane;
                        self.efforts[place] = T::of(map.value(a) / unit);
                        self.slopes[place] = T::of(map.slope(a) * slope / unit);
                    };
                    see(0, c + (a - c) * first, slope * first + (a - c) * first_slope);
                    for halves in 1..SEEN {
                        (a, slope) = (c + (a - c) * half, slope * half + (a - c) * half_slope);
                        see(halves, a, slope);
                    }
                }
            }
        }
    }

    /// Initial states: the last measurement of each output, or the next one if there is none.
    fn begin(&mut self, runs: &[ScaledRun<T>]) {
        let (n, lanes, wash_out) = (self.shape.outputs, self.lanes, self.shape.wash_out);
        let z = &mut self.states[..n * lanes];
        z.fill(T::zero());
        for (lane, window) in self.windows.iter().enumerate() {
            let outputs = &runs[window.run].outputs;
            let begin = window.origin - self.settle;
            for j in 0..n {
                let before = (window.origin - wash_out..=begin).rev();
                let seen = before.chain(begin + 1..=window.origin).map(|k| outputs[k * n + j]);
                // Each output is measured at least once in a window.
                z[j * lanes + lane] = seen.into_iter().find(|z| !z.is_nan()).unwrap_or(T::zero());
            }
        }
    }

    pub(super) fn compare(&self, runs: &[ScaledRun<T>], step: usize, mut each: impl FnMut(usize, usize, T)) {
        let (n, lanes) = (self.shape.outputs, self.lanes);
        let predicted = &self.states[(self.settle + step + 1) * n * lanes..][..n * lanes];
        for (lane, window) in self.windows.iter().enumerate() {
            let at = (window.origin + step + 1) * n;
            for (i, &value) in runs[window.run].outputs[at..at + n].iter().enumerate() {
                if !value.is_nan() {
                    each(i, lane, predicted[i * lanes + lane] - value);
                }
            }
        }
    }

    pub(super) fn exceeds(&self, most: f64) -> bool {
        let (most, count) = (T::of(most), self.windows.len());
        let mut rows = self.states.chunks_exact(self.lanes);
        rows.any(|row| row[..count].iter().any(|z| z.is_nan() || z.abs() > most))
    }

    pub(super) fn backward(
        &mut self,
        weights: &[T],
        runs: &[ScaledRun<T>],
        channel_weights: &[f64],
        factor: f64,
        gradient: &mut [T],
    ) {
        let (n, m, lanes, dt) = (self.shape.outputs, self.shape.inputs, self.lanes, self.parts.dt);
        let factors: Vec<T> = channel_weights.iter().map(|w| T::of(2.0 * factor * w)).collect();
        gradient.fill(T::zero());
        let (of_network, of_lags) = gradient.split_at_mut(self.parts.network.weights());
        let weights = &weights[..of_network.len()];
        self.adjoint.fill(T::zero());
        for k in (0..self.settle + self.shape.length).rev() {
            let mut adjoint = std::mem::take(&mut self.adjoint);
            if let Some(step) = k.checked_sub(self.settle) {
                self.compare(runs, step, |j, lane, error| adjoint[j * lanes + lane] += factors[j] * error);
            } else {
                // Of a corrected state, only the share 1 - K of the prediction depends on the weights.
                let rest = T::one() - self.gain;
                measured(&self.windows, runs, (n, lanes), self.settle - 1 - k, |at, _| adjoint[at] *= rest);
            }
            self.adjoint = adjoint;
            self.parts_adjoint.fill(T::zero());
            for (stage, (halves, weight)) in STAGES.into_iter().enumerate().rev() {
                // Adjoint of the rate: its share in the sum and in the input of the next stage.
                let share = T::of(weight * dt / 6.0);
                let next = match STAGES.get(stage + 1) {
                    Some((halves, _)) => T::of(0.5 * *halves as f64 * dt),
                    None => T::zero(),
                };
                for ((rate, &a), &x) in self.rate.iter_mut().zip(&self.adjoint).zip(&self.input_adjoint) {
                    *rate = share * a + if stage + 1 < STAGES.len() { next * x } else { T::zero() };
                }
                let batch = &mut self.stages[STAGES.len() * k + stage];
                let at = (SEEN * k + halves) * m * lanes;
                let (efforts, slopes) = (&self.efforts[at..], &self.slopes[at..]);
                for j in 0..n {
                    let rate = &mut self.rate[j * lanes..(j + 1) * lanes];
                    for rate in rate.iter_mut() {
                        *rate *= self.ratio[j];
                    }
                    for (i, lag) in of_lags.iter_mut().enumerate() {
                        let given = &batch.output()[(n * (1 + i) + j) * lanes..][..lanes];
                        let slopes = &slopes[i * lanes..(i + 1) * lanes];
                        *lag += rate.iter().zip(given).zip(slopes).map(|((&r, &g), &s)| r * g * s).sum::<T>();
                    }
                    let into = batch.output_adjoint_mut();
                    into[j * lanes..(j + 1) * lanes].copy_from_slice(rate);
                    for i in 0..m {
                        let into = &mut into[(n * (1 + i) + j) * lanes..][..lanes];
                        let efforts = &efforts[i * lanes..(i + 1) * lanes];
                        into.iter_mut().zip(&*rate).zip(efforts).for_each(|((d, &r), &e)| *d = r * e);
                    }
                }
                batch.backward_to(weights, &mut self.gradient, &mut self.input_adjoint);
                of_network.iter_mut().zip(&self.gradient).for_each(|(sum, &g)| *sum += g);
                self.parts_adjoint.iter_mut().zip(&self.input_adjoint).for_each(|(sum, &x)| *sum += x);
            }
            self.adjoint.iter_mut().zip(&self.parts_adjoint).for_each(|(a, &x)| *a += x);
        }
    }
}

/// Calls `each(place, value)` for the measurements `before` samples before the origins.
fn measured<T: Scalar>(
    windows: &[Window],
    runs: &[ScaledRun<T>],
    (n, lanes): (usize, usize),
    before: usize,
    mut each: impl FnMut(usize, T),
) {
    for (lane, window) in windows.iter().enumerate() {
        let at = (window.origin - before) * n;
        for (j, &value) in runs[window.run].outputs[at..at + n].iter().enumerate() {
            if !value.is_nan() {
                each(j * lanes + lane, value);
            }
        }
    }
}

/// `rate <- ratio ( f + sum g_i e_i )`, from the output of the network.
fn rates<T: Scalar>(
    given: &[T],
    efforts: &[T],
    ratio: &[T],
    (inputs, lanes): (usize, usize),
    rate: &mut [T],
) {
    let n = ratio.len();
    for (j, rate) in rate.chunks_exact_mut(lanes).enumerate() {
        rate.copy_from_slice(&given[j * lanes..(j + 1) * lanes]);
        for i in 0..inputs {
            let g = &given[(n * (1 + i) + j) * lanes..][..lanes];
            let efforts = &efforts[i * lanes..(i + 1) * lanes];
            rate.iter_mut().zip(g).zip(efforts).for_each(|((rate, &g), &e)| *rate += g * e);
        }
        for rate in rate.iter_mut() {
            *rate *= ratio[j];
        }
    }
}
