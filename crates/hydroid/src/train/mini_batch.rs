//! Mini-batches of windows: the unit of work of a thread, for all kinds of networks.

use hydroid_core::math::Scalar;
use hydroid_core::model::affine::ControlAffine;
use hydroid_core::model::direct::{Direct, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, Network, Recurrent, Scaling};
use rand_chacha::ChaCha8Rng;

use super::affine::{self, Affine};
use super::bptt::Bptt;
use super::direct::DirectBatch;
use super::loss::Sums;
use super::windows::{ScaledRun, Shape, Window};
use super::{TrainedNetwork, init};

#[derive(Clone, Debug)]
pub(super) enum Architecture {
    /// Recurrent network, its base, and whether outputs are fed back.
    Recurrent { network: Network, base: BaseModel, feedback: bool },
    /// Direct predictor, its horizon and its base.
    Direct { network: Perceptron, horizon: usize, base: BaseModel },
    /// Control-affine network; the logarithms of its time constants follow its weights.
    Affine(affine::Parts),
}

impl Architecture {
    pub(super) fn weights(&self) -> usize {
        match self {
            Self::Recurrent { network, .. } => network.weights(),
            Self::Direct { network, .. } => network.weights(),
            Self::Affine(parts) => parts.network.weights() + parts.maps.len(),
        }
    }

    pub(super) fn first<T: Scalar>(&self, rng: &mut ChaCha8Rng) -> Vec<T> {
        match self {
            Self::Recurrent { network, .. } => init::weights(network, rng),
            Self::Direct { network, .. } => init::perceptron(network, rng),
            Self::Affine(parts) => {
                let mut weights = init::perceptron(&parts.network, rng);
                weights.extend(parts.first_lags::<T>());
                weights
            }
        }
    }

    /// Windows of a mini-batch. For recurrent networks they fill the SIMD lanes while a small batch still occupies two
    /// threads; for direct predictors the matrices fit the L2 cache and the reduction of gradients is cheap.
    pub(super) fn chunk_windows(&self) -> usize {
        match self {
            Self::Recurrent { .. } | Self::Affine(_) => 16,
            Self::Direct { .. } => 128,
        }
    }

    /// Whether windows start at every sample (direct predictors) instead of tiling the runs with their compared parts.
    pub(super) fn has_overlapping_windows(&self) -> bool {
        matches!(self, Self::Direct { .. })
    }

    /// Buffers for at most `size` windows; `back` reserves memory for [`backward`](MiniBatch::backward).
    pub(super) fn chunk<T: Scalar>(
        &self,
        scaling: &Scaling,
        shape: Shape,
        size: usize,
        back: bool,
    ) -> MiniBatch<T> {
        match self {
            Self::Recurrent { network, base, feedback } => {
                let chunk = Bptt::new(network, base, scaling, *feedback, shape, size, back);
                MiniBatch::Bptt(Box::new(chunk))
            }
            Self::Direct { network, horizon, base } => MiniBatch::DirectBatch(Box::new(DirectBatch::new(
                network, *horizon, base, scaling, shape, size,
            ))),
            Self::Affine(parts) => {
                MiniBatch::Affine(Box::new(Affine::new(parts, scaling, shape, size, back)))
            }
        }
    }

    pub(super) fn model<T: Scalar>(&self, weights: &[T], scaling: &Scaling, shape: Shape) -> TrainedNetwork {
        let wide = |weights: &[T]| weights.iter().map(|w| w.wide()).collect::<Vec<f64>>();
        let scaling = scaling.clone();
        match self {
            Self::Recurrent { network, base, feedback } => TrainedNetwork::Recurrent(Recurrent {
                network: *network,
                weights: wide(weights),
                scaling,
                base: base.clone(),
                feedback: *feedback,
                wash_out: shape.wash_out,
            }),
            Self::Direct { network, horizon, base } => TrainedNetwork::Direct(Direct {
                network: network.clone(),
                weights: wide(weights),
                scaling,
                history: shape.wash_out + 1,
                horizon: *horizon,
                base: base.clone(),
            }),
            Self::Affine(parts) => {
                let (weights, lags) = weights.split_at(parts.network.weights());
                TrainedNetwork::Affine(ControlAffine {
                    network: parts.network.clone(),
                    weights: wide(weights),
                    scaling,
                    effectors: parts.effectors(lags),
                    dt: parts.dt,
                    wash_out: shape.wash_out,
                })
            }
        }
    }
}

/// Windows in parallel lanes. Their number and the order of sums do not depend on the number of threads.
#[derive(Clone, Debug)]
pub(super) enum MiniBatch<T> {
    Bptt(Box<Bptt<T>>),
    DirectBatch(Box<DirectBatch<T>>),
    Affine(Box<Affine<T>>),
}

impl<T: Scalar> MiniBatch<T> {
    pub(super) fn forward(&mut self, weights: &[T], runs: &[ScaledRun<T>], windows: &[Window]) {
        match self {
            Self::Bptt(chunk) => chunk.forward(weights, runs, windows),
            Self::DirectBatch(chunk) => chunk.forward(weights, runs, windows),
            Self::Affine(chunk) => chunk.forward(weights, runs, windows),
        }
    }

    /// Sums of squared errors of the last [`forward`](Self::forward) and their number, for each output.
    pub(super) fn squares(&self, runs: &[ScaledRun<T>], length: usize, sums: &mut [Sums]) {
        sums.fill([0.0; 2]);
        for step in 0..length {
            self.compare(runs, step, |i, _, error| {
                sums[i] = [sums[i][0] + error.wide().powi(2), sums[i][1] + 1.0];
            });
        }
    }

    /// Calls `each(output, lane, predicted - measured)` for the values compared `step + 1` samples after the origin.
    pub(super) fn compare(&self, runs: &[ScaledRun<T>], step: usize, each: impl FnMut(usize, usize, T)) {
        match self {
            Self::Bptt(chunk) => chunk.compare(runs, step, each),
            Self::DirectBatch(chunk) => chunk.compare(runs, step, each),
            Self::Affine(chunk) => chunk.compare(runs, step, each),
        }
    }

    /// Whether a prediction after the origin exceeds `most` in magnitude or is NaN.
    pub(super) fn exceeds(&self, most: f64) -> bool {
        match self {
            Self::Bptt(chunk) => chunk.exceeds(most),
            Self::DirectBatch(chunk) => chunk.exceeds(most),
            Self::Affine(chunk) => chunk.exceeds(most),
        }
    }

    /// Backward pass of the last [`forward`](Self::forward): `gradient` is that of `factor` times the loss.
    pub(super) fn backward(
        &mut self,
        weights: &[T],
        runs: &[ScaledRun<T>],
        channel_weights: &[f64],
        factor: f64,
        gradient: &mut [T],
    ) {
        match self {
            Self::Bptt(chunk) => chunk.backward(runs, channel_weights, factor, gradient),
            Self::DirectBatch(chunk) => chunk.backward(weights, runs, channel_weights, factor, gradient),
            Self::Affine(chunk) => chunk.backward(weights, runs, channel_weights, factor, gradient),
        }
    }
}
