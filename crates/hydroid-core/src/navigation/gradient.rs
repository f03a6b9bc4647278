//! Gradient of the log-likelihood by one pass back through the filter.

use num_traits::Float;

use super::filter::{Filter, stationary_start};
use super::motion::{BLOCKS, CHANGED, CURVED, Noise, Transition};
use super::sensor::{Measurement, Scalar};
use super::state::{Estimate, STATES, State};

/// Gradient of the log-likelihood of a filter without bounded influence that is linearized at its estimate, by the
/// statistics of the motion, by the standard deviations of the measurements, and by the mean of the prior:
///
/// ```text
/// L = - 1/2 sum of (huber(e^2 / S) + ln S)
/// ```
///
/// with the innovations `e`, their variances `S`, and Huber's function, which is linear in `|e|` beyond `e^2 / S = c^2`
/// (Ann. Math. Stat. 35 (1964) 73). The steps of the filter are passed in reverse order. One pass gives all derivatives
/// (Koopman and Shephard, Biometrika 79 (1992) 823, for the linear filter); the linearization of motion and measurements at
/// the estimate is differentiated, too, so that the gradient is that of the extended filter.
#[derive(Clone, Debug)]
pub struct Gradient {
    noise: Noise,
    threshold: f64,
    /// Derivatives by the logarithms of the statistics.
    by_noise: Noise,
    /// By the mean of the states.
    mean: [f64; STATES],
    /// By the covariance of the states, symmetric.
    covariance: [[f64; STATES]; STATES],
}

/// Step of differences, of a logarithm or of the largest component of a direction. The differences are those of equations
/// in closed form: their error is of the order of its square.
const STEP: f64 = 1e-5;

fn dot(a: &[f64; STATES], b: &[f64; STATES]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// `M' x`, where many entries of `x` may be zero.
fn times_transposed(vector: &[f64; STATES], matrix: &[[f64; STATES]; STATES]) -> [f64; STATES] {
    let mut out = [0.0; STATES];
    for (line, x) in matrix.iter().zip(vector).filter(|(_, x)| **x != 0.0) {
        for (out, entry) in out.iter_mut().zip(line) {
            *out += x * entry;
        }
    }
    out
}

/// Product of a symmetric matrix with a vector.
fn times(matrix: &[[f64; STATES]; STATES], vector: &[f64; STATES]) -> [f64; STATES] {
    times_transposed(vector, matrix)
}

/// A factor that makes the largest component of a direction a small step; zero for no direction.
fn scale(direction: &[f64; STATES]) -> f64 {
    let largest = direction.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    if largest > 0.0 && largest.is_finite() { STEP / largest } else { 0.0 }
}

fn moved(mean: &[f64; STATES], direction: &[f64; STATES], by: f64) -> [f64; STATES] {
    core::array::from_fn(|i| mean[i] + by * direction[i])
}

impl Gradient {
    /// Starts behind the last step.
    pub fn new(noise: Noise) -> Self {
        Self {
            noise,
            threshold: Filter::OUTLIER,
            by_noise: Noise::default(),
            mean: [0.0; STATES],
            covariance: [[0.0; STATES]; STATES],
        }
    }

    /// Huber's function of a squared normalized innovation.
    pub fn loss(nis: f64) -> f64 {
        let (d, c) = (Float::sqrt(nis), Float::sqrt(Filter::OUTLIER));
        if d > c { c * (2.0 * d - c) } else { nis }
    }

    /// Passes an update that began with the estimate `before`. The derivatives by the logarithms of the standard deviations
    /// of its values.
    pub fn update(&mut self, before: &Estimate, measurement: &Measurement) -> [f64; 2] {
        let rate = self.noise.pivot_rate;
        let scalars = measurement.scalars(&before.mean, rate);
        let mut shift = [0.0; STATES];
        let mut steps: [Option<Step>; 2] = [None, None];
        for k in 0..2 {
            let scalar = &scalars[k];
            if !scalar.counts() {
                continue;
            }
            let product = Step::spread(&before.covariance, &steps[..k], &scalar.gradient);
            let variance = dot(&product, &scalar.gradient) + scalar.variance;
            let residual = scalar.residual - dot(&scalar.gradient, &shift);
            steps[k] = Some(Step { shift, product, variance, residual });
            for (x, p) in shift.iter_mut().zip(&product) {
                *x += p * residual / variance;
            }
        }
        let mut by_deviation = [0.0; 2];
        // By the residuals and the derivatives of the measurement equations.
        let mut by_scalars: [Option<(f64, [f64; STATES])>; 2] = [None, None];
        for k in (0..2).rev() {
            let (scalar, Some(step)) = (&scalars[k], &steps[k]) else { continue };
            let spread = |vector: &[f64; STATES]| Step::spread(&before.covariance, &steps[..k], vector);
            let (by_residual, by_gradient, by_variance) = self.scalar(scalar, step, spread);
            by_deviation[k] = 2.0 * scalar.variance * by_variance;
            by_scalars[k] = Some((by_residual, by_gradient));
        }
        // The derivatives of a measurement equation change with the state.
        for (k, by) in by_scalars.iter().enumerate() {
            let Some((_, direction)) = by else { continue };
            let step = scale(direction);
            if step == 0.0 {
                continue;
            }
            let [up, down] =
                [step, -step].map(|step| measurement.scalars(&moved(&before.mean, direction, step), rate)[k]);
            for i in 0..STATES {
                self.mean[i] += (up.gradient[i] - down.gradient[i]) / (2.0 * step);
            }
        }
        let [up, down] = [STEP, -STEP].map(|step| measurement.scalars(&before.mean, rate * Float::exp(step)));
        for (k, by) in by_scalars.iter().enumerate() {
            let Some((by_residual, by_gradient)) = by else { continue };
            let change = dot(by_gradient, &up[k].gradient) - dot(by_gradient, &down[k].gradient)
                + by_residual * (up[k].residual - down[k].residual);
            self.by_noise.pivot_rate += change / (2.0 * STEP);
        }
        by_deviation
    }

    /// Passes a scalar: derivatives by its residual, its derivatives and its variance. `spread` is the product of the
    /// covariance before it with a vector.
    fn scalar(
        &mut self,
        scalar: &Scalar,
        step: &Step,
        spread: impl Fn(&[f64; STATES]) -> [f64; STATES],
    ) -> (f64, [f64; STATES], f64) {
        let Step { shift, product: p, variance: s, residual: e } = step;
        let (h, s, e) = (&scalar.gradient, *s, *e);
        let d = Float::sqrt(e * e / s);
        let c = Float::sqrt(self.threshold);
        let weight = if d > c { c / d } else { 1.0 };
        let seen = times(&self.covariance, p);
        let along = dot(&self.mean, p);
        let by_residual = along / s - weight * e / s;
        let by_variance = (-along * e + dot(p, &seen)) / (s * s) - 0.5 / s + 0.5 * weight * e * e / (s * s);
        let by_product: [f64; STATES] =
            core::array::from_fn(|i| (self.mean[i] * e - 2.0 * seen[i]) / s + by_variance * h[i]);
        let spread = spread(&by_product);
        let by_gradient = core::array::from_fn(|i| by_variance * p[i] + spread[i] - by_residual * shift[i]);
        for i in 0..STATES {
            self.mean[i] -= h[i] * by_residual;
            for j in 0..STATES {
                self.covariance[i][j] += 0.5 * (by_product[i] * h[j] + h[i] * by_product[j]);
            }
        }
        (by_residual, by_gradient, by_variance)
    }

    /// Passes a prediction over a time \[s\] that began with the estimate `before`.
    pub fn predict(&mut self, before: &Estimate, dt: f64) {
        let transition = Transition::new(&self.noise, &mut before.mean.clone(), dt);
        // Derivatives by the entries of F: 2 A F P, where A is the derivative by the covariance behind the step.
        let mut spread = [[0.0; STATES]; STATES];
        transition.times(&before.covariance, &mut spread);
        let mut by_rows = [[0.0; STATES]; CHANGED];
        for (by, (state, columns, _)) in by_rows.iter_mut().zip(transition.rows()) {
            let product = times_transposed(&self.covariance[state as usize], &spread);
            for column in columns {
                by[*column as usize] = 2.0 * product[*column as usize];
            }
        }
        self.statistics(&transition, before, &by_rows, dt);
        let mut curved = [0.0; STATES];
        for (k, direction) in by_rows[..CURVED].iter().enumerate() {
            let step = scale(direction);
            if step == 0.0 {
                continue;
            }
            let shifted =
                |step: f64| Transition::new(&self.noise, &mut moved(&before.mean, direction, step), dt);
            let (up, down) = (shifted(step), shifted(-step));
            for ((_, columns, up), (.., down)) in up.rows().zip(down.rows()).skip(k).take(1) {
                for ((column, up), down) in columns.iter().zip(up).zip(down) {
                    curved[*column as usize] += (up - down) / (2.0 * step);
                }
            }
        }
        transition.transpose(&mut self.mean);
        transition.transpose_both(&mut self.covariance);
        for (mean, curved) in self.mean.iter_mut().zip(curved) {
            *mean += curved;
        }
    }

    /// Derivatives of a prediction by the statistics. Each row of `F` and each block of the noise has one rate, the waves
    /// have a damping, too.
    fn statistics(
        &mut self,
        transition: &Transition,
        before: &Estimate,
        by_rows: &[[f64; STATES]; CHANGED],
        dt: f64,
    ) {
        let a = &self.covariance;
        let of_block = |(first, second): (State, State), block: &[f64; 3]| {
            let (i, j) = (first as usize, second as usize);
            if i == j {
                a[i][i] * block[0]
            } else {
                a[i][i] * block[0] + 2.0 * a[i][j] * block[1] + a[j][j] * block[2]
            }
        };
        for (states, block) in BLOCKS.iter().zip(transition.noise()) {
            if let Some(amplitude) = self.by_noise.amplitude(states.0) {
                *amplitude += 2.0 * of_block(*states, block);
            }
        }
        let shifts: [fn(&Noise, f64) -> Noise; 2] = [Noise::with_rates, Noise::with_damping];
        for (pass, shifted) in shifts.into_iter().enumerate() {
            let at = |step: f64| {
                let mut mean = before.mean;
                (Transition::new(&shifted(&self.noise, Float::exp(step)), &mut mean, dt), mean)
            };
            let (up, down) = (at(STEP), at(-STEP));
            let mut add = |state: State, change: f64| {
                let slot = if pass == 0 { self.by_noise.rate(state) } else { self.by_noise.damping(state) };
                if let Some(slot) = slot {
                    *slot += change / (2.0 * STEP);
                }
            };
            for (((state, columns, above), (.., below)), by) in up.0.rows().zip(down.0.rows()).zip(by_rows) {
                let i = state as usize;
                let entries = columns.iter().zip(above).zip(below);
                let by_entries: f64 =
                    entries.map(|((column, up), down)| by[*column as usize] * (up - down)).sum();
                add(state, by_entries + self.mean[i] * (up.1[i] - down.1[i]));
            }
            for ((states, above), below) in BLOCKS.iter().zip(up.0.noise()).zip(down.0.noise()) {
                let change = core::array::from_fn(|k| above[k] - below[k]);
                add(states.0, of_block(*states, &change));
            }
        }
    }

    /// Derivatives by the logarithms of the statistics and by the mean of the prior, behind the first step.
    pub fn finish(mut self) -> (Noise, [f64; STATES]) {
        for (state, deviation, power) in stationary_start(&self.noise) {
            let variance = deviation * deviation;
            let by = 2.0 * self.covariance[state as usize][state as usize] * variance;
            if let Some(amplitude) = self.by_noise.amplitude(state) {
                *amplitude += by;
            }
            if power != 0.0
                && let Some(rate) = self.by_noise.rate(state)
            {
                *rate += power * by;
            }
        }
        (self.by_noise, self.mean)
    }
}

/// A scalar update.
struct Step {
    /// Mean minus the state of the linearization.
    shift: [f64; STATES],
    /// `P H'`.
    product: [f64; STATES],
    variance: f64,
    residual: f64,
}

impl Step {
    /// Product of the covariance behind steps with a vector.
    fn spread(
        covariance: &[[f64; STATES]; STATES],
        steps: &[Option<Self>],
        vector: &[f64; STATES],
    ) -> [f64; STATES] {
        let mut out = times(covariance, vector);
        for step in steps.iter().flatten() {
            let along = dot(&step.product, vector) / step.variance;
            for (x, p) in out.iter_mut().zip(&step.product) {
                *x -= along * p;
            }
        }
        out
    }
}
