//! Multi-step error on validation runs.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::Scaling;

use super::mini_batch::MiniBatch;
use super::scaling::HALF_RANGE;
use super::windows::{ScaledRun, Shape, Window};

/// Ratio to the design range beyond which a rollout has diverged, as in [`evaluate`](crate::evaluate).
const DIVERGED: f64 = 10.0 * HALF_RANGE;

/// Share of an output's mean square that is attributed to rounding, as in [`evaluate`](crate::evaluate).
const NOISE: f64 = 1e-12;

/// Rollouts from origins in validation runs as in [`evaluate`](fn@crate::evaluate::evaluate), with two differences for
/// speed: origins have a stride, and the hidden state at an origin is that after a wash-out instead of the whole run.
///
/// The score is [`Evaluation::score`](crate::evaluate::Evaluation::score).
#[derive(Clone, Debug)]
pub(super) struct Validation {
    pub(super) shape: Shape,
    pub(super) windows: Vec<Window>,
    /// `1 / (count variance)` for each horizon and output; `None` for a constant output.
    weights: Vec<Option<f64>>,
}

impl Validation {
    /// Validation at about `most` origins.
    pub(super) fn new<T: Scalar>(
        shape: Shape,
        runs: &[ScaledRun<T>],
        scaling: &Scaling,
        most: usize,
    ) -> Self {
        let possible: usize = runs.iter().map(|run| (run.samples + 1).saturating_sub(shape.samples())).sum();
        let windows = shape.every(runs, possible.div_ceil(most.max(1)).max(1));
        if windows.is_empty() {
            return Self { shape, windows, weights: Vec::new() };
        }
        let n = shape.outputs;
        let weights = (0..shape.length * n)
            .map(|cell| {
                let (step, i) = (cell / n, cell % n);
                let values = || {
                    let value = |w: &Window| runs[w.run].outputs[(w.origin + step + 1) * n + i].wide();
                    windows.iter().map(value).filter(|y| !y.is_nan())
                };
                let count = values().count() as f64;
                let mean = values().sum::<f64>() / count;
                let squares: f64 = values().map(|y| (y - mean).powi(2)).sum();
                // The threshold of `evaluate`, in the output's own units.
                let own = |z: f64| scaling.output_mean[i] + scaling.output_scale[i] * z;
                let noise = NOISE * values().map(|z| own(z).powi(2)).sum::<f64>();
                (scaling.output_scale[i].powi(2) * squares > noise).then(|| 1.0 / squares)
            })
            .collect();
        Self { shape, windows, weights }
    }

    /// Whether an output varies over the origins, so that the NRMSE is defined.
    pub(super) fn can_judge(&self) -> bool {
        self.weights.iter().any(Option::is_some)
    }

    /// Sums of squared errors of a chunk of windows, for each horizon and output; all infinite if one diverged.
    pub(super) fn squares<T: Scalar>(
        &self,
        chunk: &mut MiniBatch<T>,
        weights: &[T],
        runs: &[ScaledRun<T>],
        windows: &[Window],
        into: &mut [f64],
    ) {
        let n = self.shape.outputs;
        chunk.forward(weights, runs, windows);
        if chunk.exceeds(DIVERGED) {
            into.fill(f64::INFINITY);
            return;
        }
        into.fill(0.0);
        for step in 0..self.shape.length {
            chunk.compare(runs, step, |i, _, error| into[step * n + i] += error.wide().powi(2));
        }
    }

    pub(super) fn score(&self, squares: &[f64]) -> f64 {
        let parts = squares.iter().zip(&self.weights).filter_map(|(s, w)| w.map(|w| (s * w).sqrt()));
        let (sum, count) = parts.fold((0.0, 0usize), |(sum, count), part| (sum + part, count + 1));
        let score = sum / count as f64;
        if score.is_finite() { score } else { f64::INFINITY }
    }
}
