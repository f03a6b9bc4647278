//! Adam optimizer.
#![expect(
    clippy::inline_always,
    reason = "it must become a part of the function that was compiled for the processor"
)]

use hydroid_core::math::Scalar;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Decay rates of the first and second moment.
const BETA: [f64; 2] = [0.9, 0.999];
/// Regularizes the division.
const EPSILON: f64 = 1e-8;

/// Number of weights that one thread updates at a time. Sums are taken over these parts in order.
pub(super) const PART: usize = 1 << 14;

/// Adam (Kingma and Ba 2015, algorithm 1) with decoupled weight decay (`AdamW`, Loshchilov and Hutter 2019):
///
/// ```text
/// m <- b1 m + (1 - b1) g              v <- b2 v + (1 - b2) g^2
/// w <- w - a d w - a (m / (1 - b1^t)) / (sqrt(v / (1 - b2^t)) + e)
/// ```
///
/// with the step size `a`, the weight decay `d`, `b1 = 0.9`, `b2 = 0.999`, `e = 1e-8`, and `t` counting from 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam<T> {
    /// First moment.
    pub(super) mean: Vec<T>,
    /// Second moment.
    pub(super) square: Vec<T>,
    pub(super) steps: u64,
}

impl<T: Scalar> Adam<T> {
    pub fn new(weights: usize) -> Self {
        Self { mean: vec![T::zero(); weights], square: vec![T::zero(); weights], steps: 0 }
    }

    pub fn step(&mut self, weights: &mut [T], gradient: &[T], rate: f64, decay: f64) {
        self.steps += 1;
        let t = self.steps as f64;
        let [b1, b2] = BETA;
        // Factors of the whole step, so that a weight costs one root and one division.
        let size = T::of(rate / (1.0 - b1.powf(t)));
        let unbias = T::of((1.0 / (1.0 - b2.powf(t))).sqrt());
        // Added to the step: 1 - a d rounds to 1 in single precision where a d is less than 3e-8.
        let (shrink, epsilon) = (T::of(rate * decay), T::of(EPSILON));
        let (b1, b2, one) = (T::of(b1), T::of(b2), T::one());
        let arch = Arch::new();
        let parts = weights.par_chunks_mut(PART).zip(gradient.par_chunks(PART));
        let moments = self.mean.par_chunks_mut(PART).zip(self.square.par_chunks_mut(PART));
        parts.zip(moments).for_each(|((weights, gradient), (mean, square))| {
            arch.dispatch(Step {
                weights,
                gradient,
                mean,
                square,
                factors: [b1, one - b1, b2, one - b2, shrink, size, unbias, epsilon],
            });
        });
    }
}

struct Step<'a, T> {
    weights: &'a mut [T],
    gradient: &'a [T],
    mean: &'a mut [T],
    square: &'a mut [T],
    /// `b1`, `1 - b1`, `b2`, `1 - b2`, `a d`, `a / (1 - b1^t)`, `1 / sqrt(1 - b2^t)`, `e`.
    factors: [T; 8],
}

impl<T: Scalar> WithSimd for Step<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { weights, gradient, mean, square, factors } = self;
        let [b1, a1, b2, a2, shrink, size, unbias, epsilon] = factors;
        let count = weights.len();
        let (gradient, mean, square) = (&gradient[..count], &mut mean[..count], &mut square[..count]);
        for i in 0..count {
            let g = gradient[i];
            mean[i] = b1 * mean[i] + a1 * g;
            square[i] = b2 * square[i] + a2 * g * g;
            let step = size * mean[i] / (square[i].sqrt() * unbias + epsilon);
            weights[i] = weights[i] - (shrink * weights[i] + step);
        }
    }
}

/// Clips the norm of a gradient and returns the norm before (Pascanu, Mikolov and Bengio 2013).
pub fn clip<T: Scalar>(gradient: &mut [T], most: f64) -> f64 {
    // Several partial sums, so that an addition does not wait for the previous one.
    let square = |part: &[T]| {
        let mut sums = [0.0; 8];
        for eight in part.chunks(8) {
            for (sum, g) in sums.iter_mut().zip(eight) {
                *sum += g.wide() * g.wide();
            }
        }
        sums.iter().sum::<f64>()
    };
    let squares: Vec<f64> = gradient.par_chunks(PART).map(square).collect();
    let norm = squares.iter().sum::<f64>().sqrt();
    if norm > most {
        let factor = T::of(most / norm);
        for g in gradient {
            *g *= factor;
        }
    }
    norm
}
