//! Windows side by side: the unit of work of a thread, for networks of every kind.

use hydroid_core::math::Scalar;
use hydroid_core::model::affine::ControlAffine;
use hydroid_core::model::direct::{Direct, Perceptron};
use hydroid_core::model::recurrent::{Base, Network, Recurrent, Scaling};
use rand_chacha::ChaCha8Rng;

use super::affine::{self, Affine};
use super::ahead::Ahead;
use super::loss::Sums;
use super::unroll::Unrolled;
use super::windows::{ScaledRun, Shape, Window};
use super::{Learned, init};

/// What is trained.
#[derive(Clone, Debug)]
pub(super) enum Net {
    /// A recurrent network, what it corrects, and whether it sees its outputs.
    Recurrent { network: Network, base: Base, feedback: bool },
    /// A direct predictor of a horizon, and what it adds to.
    Direct { network: Perceptron, horizon: usize, base: Base },
    /// A control-affine network; the logarithms of its time constants follow its weights.
    Affine(affine::Parts),
}

impl Net {
    /// Number of weights.
    pub(super) fn weights(&self) -> usize {
        match self {
            Self::Recurrent { network, .. } => network.weights(),
            Self::Direct { network, .. } => network.weights(),
            Self::Affine(parts) => parts.network.weights() + parts.maps.len(),
        }
    }

    /// First weights.
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

    /// Windows of a chunk: of recurrent networks enough to fill the widest vectors, few enough that a small batch keeps two
    /// threads busy; of direct predictors so many that adding up their gradients costs little, and the matrices stay in the
    /// second cache.
    pub(super) fn chunk_windows(&self) -> usize {
        match self {
            Self::Recurrent { .. } | Self::Affine(_) => 16,
            Self::Direct { .. } => 128,
        }
    }

    /// Whether windows of an epoch begin at every sample; else what is compared tiles the runs. One window of a recurrent
    /// network is a walk over hundreds of samples, one of a direct predictor a single look.
    pub(super) fn everywhere(&self) -> bool {
        matches!(self, Self::Direct { .. })
    }

    /// A chunk of at most `size` windows; `back` says whether anybody will go [`backward`](Chunk::backward).
    pub(super) fn chunk<T: Scalar>(
        &self,
        scaling: &Scaling,
        shape: Shape,
        size: usize,
        back: bool,
    ) -> Chunk<T> {
        match self {
            Self::Recurrent { network, base, feedback } => {
                let chunk = Unrolled::new(network, base, scaling, *feedback, shape, size, back);
                Chunk::Unrolled(Box::new(chunk))
            }
            Self::Direct { network, horizon, base } => {
                Chunk::Ahead(Box::new(Ahead::new(network, *horizon, base, scaling, shape, size)))
            }
            Self::Affine(parts) => Chunk::Affine(Box::new(Affine::new(parts, scaling, shape, size, back))),
        }
    }

    /// The model with such weights.
    pub(super) fn model<T: Scalar>(&self, weights: &[T], scaling: &Scaling, shape: Shape) -> Learned {
        let wide = |weights: &[T]| weights.iter().map(|w| w.wide()).collect::<Vec<f64>>();
        let scaling = scaling.clone();
        match self {
            Self::Recurrent { network, base, feedback } => Learned::Recurrent(Recurrent {
                network: *network,
                weights: wide(weights),
                scaling,
                base: base.clone(),
                feedback: *feedback,
                wash_out: shape.wash_out,
                state_filter: None,
            }),
            Self::Direct { network, horizon, base } => Learned::Direct(Direct {
                network: network.clone(),
                weights: wide(weights),
                scaling,
                history: shape.wash_out + 1,
                horizon: *horizon,
                base: base.clone(),
            }),
            Self::Affine(parts) => {
                let (weights, lags) = weights.split_at(parts.network.weights());
                Learned::Affine(ControlAffine {
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

/// Windows side by side. Their number is fixed, and gradients of chunks are added in their order, so that sums do not depend
/// on the number of threads.
#[derive(Clone, Debug)]
pub(super) enum Chunk<T> {
    /// A network unrolled over the steps of its windows.
    Unrolled(Box<Unrolled<T>>),
    /// One that gives all steps of a horizon at once.
    Ahead(Box<Ahead<T>>),
    /// One whose rates are integrated.
    Affine(Box<Affine<T>>),
}

impl<T: Scalar> Chunk<T> {
    /// Walks over windows with weights.
    pub(super) fn walk(&mut self, weights: &[T], runs: &[ScaledRun<T>], windows: &[Window]) {
        match self {
            Self::Unrolled(chunk) => chunk.walk(weights, runs, windows),
            Self::Ahead(chunk) => chunk.walk(weights, runs, windows),
            Self::Affine(chunk) => chunk.walk(weights, runs, windows),
        }
    }

    /// Squared errors of the last [`walk`](Self::walk), and their number, of each output.
    pub(super) fn squares(&self, runs: &[ScaledRun<T>], length: usize, sums: &mut [Sums]) {
        sums.fill([0.0; 2]);
        for step in 0..length {
            self.compare(runs, step, |i, _, error| {
                sums[i] = [sums[i][0] + error.wide().powi(2), sums[i][1] + 1.0];
            });
        }
    }

    /// Calls `each(output, lane, predicted - measured)` for what is compared `step + 1` samples after the origin.
    pub(super) fn compare(&self, runs: &[ScaledRun<T>], step: usize, each: impl FnMut(usize, usize, T)) {
        match self {
            Self::Unrolled(chunk) => chunk.compare(runs, step, each),
            Self::Ahead(chunk) => chunk.compare(runs, step, each),
            Self::Affine(chunk) => chunk.compare(runs, step, each),
        }
    }

    /// Whether a prediction after the origin is farther from zero than `most`, or no number.
    pub(super) fn leaves(&self, most: f64) -> bool {
        match self {
            Self::Unrolled(chunk) => chunk.leaves(most),
            Self::Ahead(chunk) => chunk.leaves(most),
            Self::Affine(chunk) => chunk.leaves(most),
        }
    }

    /// Goes back over the windows of the last [`walk`](Self::walk), which had the same weights: the gradient of `factor`
    /// times its sum of squares takes the place of what stands in `gradient`.
    pub(super) fn backward(
        &mut self,
        weights: &[T],
        runs: &[ScaledRun<T>],
        channel_weights: &[f64],
        factor: f64,
        gradient: &mut [T],
    ) {
        match self {
            Self::Unrolled(chunk) => chunk.backward(runs, channel_weights, factor, gradient),
            Self::Ahead(chunk) => chunk.backward(weights, runs, channel_weights, factor, gradient),
            Self::Affine(chunk) => chunk.backward(weights, runs, channel_weights, factor, gradient),
        }
    }
}
