//! Many windows side by side, forward and backward.

#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use alloc::vec;
use alloc::vec::Vec;

use pulp::{Arch, Simd, WithSimd};

use super::perceptron::{Layer, Perceptron};
use crate::math::Scalar;
use crate::math::aligned::Aligned;
use crate::math::functions;
use crate::math::kernel::kernels;
use crate::math::product::{self, Matrix, Transposed, product, transpose};
use crate::math::slices::{Write, vectors};
use crate::math::vectors::Pack;
use crate::model::recurrent::LANES;

kernels! {
    ForwardKernel: Forwards;
    BackwardKernel: Backs;
}

/// A batch of inputs through a [`Perceptron`], and the gradient of its weights.
///
/// Matrices are `features x lanes`, row by row, one window in each lane; [`lanes`](Self::lanes) is the number of
/// windows rounded up to a multiple of [`LANES`]. Weights are read in place. With the adjoints `a_l = dL/dh_l` and
/// `d_l = a_l (1 - h_l^2)` (`d_L = a_L`), the backward pass is
///
/// ```text
/// dL/dW_l = d_l h_{l-1}',   dL/db_l = the sum of d_l over lanes,   a_{l-1} = W_l' d_l
/// ```
///
/// ```
/// use hydroid_core::model::direct::{Batch, Perceptron};
///
/// let network = Perceptron { inputs: 2, hidden: vec![8, 8], outputs: 1 };
/// let weights = vec![0.1; network.weights()];
/// let mut batch = Batch::new(&network, 3); // three inputs at a time
/// batch.input_mut().fill(0.5);
/// batch.forward(&weights);
/// let lanes = batch.lanes();
/// batch.output_adjoint_mut()[..lanes].fill(1.0); // L = the sum of all outputs
/// let mut gradient = vec![0.0; network.weights()];
/// batch.backward(&weights, &mut gradient);
/// assert_eq!(*gradient.last().unwrap(), 3.0_f64); // bias of the last layer
/// ```
///
/// Only [`new`](Self::new) allocates. Results do not depend on the processor.
#[derive(Clone, Debug)]
pub struct Batch<T> {
    network: Perceptron,
    layers: Vec<Layer>,
    room: usize,
    windows: usize,
    lanes: usize,
    /// `h_0 = x` and `h_1 .. h_{L-1}`.
    hidden: Vec<Aligned<T>>,
    output: Aligned<T>,
    /// `a_L`, then `d_L`.
    output_adjoint: Aligned<T>,
    adjoints: [Aligned<T>; 2],
    /// `h_{l-1}'`, `lanes x features`.
    transposed: Aligned<T>,
    scratch: Vec<T>,
    arch: Arch,
}

impl<T: Scalar> Batch<T> {
    /// A batch of `windows` inputs, all numbers zero.
    ///
    /// # Panics
    /// If the network is invalid ([`Perceptron::check`]), or there is no window.
    pub fn new(network: &Perceptron, windows: usize) -> Self {
        if let Err(error) = network.check() {
            panic!("{error}");
        }
        assert!(windows > 0, "a batch of no windows: give one at least");
        let lanes = windows.next_multiple_of(LANES);
        let layers = network.layers();
        let widest = network.hidden.iter().copied().max().unwrap_or(0);
        let longest = widest.max(network.inputs).next_multiple_of(T::LINE);
        Self {
            hidden: layers.iter().map(|layer| Aligned::zeros(layer.reads * lanes)).collect(),
            output: Aligned::zeros(network.outputs * lanes),
            output_adjoint: Aligned::zeros(network.outputs * lanes),
            adjoints: [Aligned::zeros(widest * lanes), Aligned::zeros(widest * lanes)],
            transposed: Aligned::zeros(longest * lanes),
            scratch: vec![T::zero(); product::scratch(longest.max(lanes).max(network.outputs))],
            network: network.clone(),
            layers,
            room: windows,
            windows,
            lanes,
            arch: Arch::new(),
        }
    }

    /// The network.
    pub fn network(&self) -> &Perceptron {
        &self.network
    }

    /// Number of windows.
    pub fn windows(&self) -> usize {
        self.windows
    }

    /// Sets the number of windows and discards the present ones.
    ///
    /// # Panics
    /// If there is none, or there are more than at construction.
    pub fn set_windows(&mut self, windows: usize) {
        assert!((1..=self.room).contains(&windows), "number of windows out of range");
        let lanes = windows.next_multiple_of(LANES);
        self.windows = windows;
        if lanes == self.lanes {
            return;
        }
        self.lanes = lanes;
        for (hidden, layer) in self.hidden.iter_mut().zip(&self.layers) {
            hidden.set_len(layer.reads * lanes);
        }
        self.output.set_len(self.network.outputs * lanes);
        self.output_adjoint.set_len(self.network.outputs * lanes);
    }

    /// Number of windows rounded up: the length of a row.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Input of the network, `inputs x lanes`.
    pub fn input_mut(&mut self) -> &mut [T] {
        &mut self.hidden[0]
    }

    /// Input of the network, `inputs x lanes`.
    pub fn input(&self) -> &[T] {
        &self.hidden[0]
    }

    /// Output of the network, `outputs x lanes`.
    pub fn output(&self) -> &[T] {
        &self.output
    }

    /// `dL/dy`, `outputs x lanes`, the input of [`backward`](Self::backward).
    pub fn output_adjoint_mut(&mut self) -> &mut [T] {
        &mut self.output_adjoint
    }

    /// The forward pass with flat weights.
    ///
    /// # Panics
    /// If there are fewer weights than the network has.
    pub fn forward(&mut self, weights: &[T]) {
        // Padding lanes may hold NaN, which must not reach the gradient.
        clear(&mut self.hidden[0], self.lanes, self.windows);
        T::run::<ForwardKernel>(self.arch, Forwards { batch: self, weights });
    }

    /// The backward pass, after [`forward`](Self::forward): overwrites `gradient`, of the flat weights.
    ///
    /// # Panics
    /// If `weights` or `gradient` is shorter than the network's weights.
    pub fn backward(&mut self, weights: &[T], gradient: &mut [T]) {
        self.back(weights, gradient, &mut []);
    }

    /// As [`backward`](Self::backward), with `dL/dx` (`inputs x lanes`) for an input that depends on other weights.
    ///
    /// # Panics
    /// If a slice is too short.
    pub fn backward_to(&mut self, weights: &[T], gradient: &mut [T], input_adjoint: &mut [T]) {
        assert_eq!(input_adjoint.len(), self.network.inputs * self.lanes, "inputs x lanes");
        self.back(weights, gradient, input_adjoint);
    }

    fn back(&mut self, weights: &[T], gradient: &mut [T], input_adjoint: &mut [T]) {
        clear(&mut self.output_adjoint, self.lanes, self.windows);
        T::run::<BackwardKernel>(self.arch, Backs { batch: self, weights, gradient, input_adjoint });
    }
}

fn clear<T: Scalar>(rows: &mut [T], lanes: usize, windows: usize) {
    if windows < lanes {
        for row in rows.chunks_exact_mut(lanes) {
            row[windows..].fill(T::zero());
        }
    }
}

pub(crate) struct Forwards<'a, T> {
    batch: &'a mut Batch<T>,
    weights: &'a [T],
}

impl<T: Scalar> WithSimd for Forwards<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { batch, weights } = self;
        let lanes = batch.lanes;
        for (l, layer) in batch.layers.iter().enumerate() {
            let (below, above) = batch.hidden.split_at_mut(l + 1);
            let (out, last) = match above.first_mut() {
                Some(hidden) => (&mut **hidden, false),
                None => (&mut *batch.output, true),
            };
            let left = Matrix::new(layer.matrix(weights), layer.reads);
            product(
                simd,
                &left,
                (&below[l], lanes),
                Some(layer.bias(weights)),
                (out, lanes),
                &mut batch.scratch,
            );
            if !last {
                let mut h = Write::new(simd, out);
                for k in vectors::<S, T>(layer.gives * lanes) {
                    h.set(k, functions::tanh(simd, h.get(k)));
                }
            }
        }
    }
}

pub(crate) struct Backs<'a, T> {
    batch: &'a mut Batch<T>,
    weights: &'a [T],
    gradient: &'a mut [T],
    input_adjoint: &'a mut [T],
}

impl<T: Scalar> WithSimd for Backs<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { batch, weights, gradient, input_adjoint } = self;
        let Batch { layers, lanes, hidden, output_adjoint, adjoints, transposed, scratch, .. } = batch;
        let lanes = *lanes;
        let [mut d, mut below] = adjoints.each_mut();
        for (l, layer) in layers.iter().enumerate().rev() {
            let at = layer.at + layer.reads * layer.gives;
            let (matrix, bias) = gradient[layer.at..at + layer.gives].split_at_mut(at - layer.at);
            let read_out = l + 1 == layers.len();
            let given: &[T] = if read_out { output_adjoint } else { &d[..layer.gives * lanes] };
            let stride = layer.reads.next_multiple_of(T::LINE);
            let turned = &mut transposed[..lanes * stride];
            transpose(&hidden[l], lanes, turned, stride);
            product(simd, &Matrix::new(given, lanes), (turned, stride), None, (matrix, layer.reads), scratch);
            for (bias, row) in bias.iter_mut().zip(given.chunks_exact(lanes)) {
                *bias = sum(row);
            }
            let left = Transposed(Matrix::new(layer.matrix(weights), layer.reads));
            if l == 0 {
                if !input_adjoint.is_empty() {
                    product(simd, &left, (given, lanes), None, (input_adjoint, lanes), scratch);
                }
                break;
            }
            let a = &mut below[..layer.reads * lanes];
            product(simd, &left, (given, lanes), None, (&mut *a, lanes), scratch);
            let one = Pack::splat(simd, T::one());
            let (mut a, h) = (Write::new(simd, a), T::whole::<S>(&hidden[l]).0);
            for (k, &h) in h.iter().enumerate() {
                let h = Pack::new(simd, h);
                a.set(k, a.get(k) * (-h).mul_add(h, one));
            }
            core::mem::swap(&mut d, &mut below);
        }
    }
}

#[inline(always)]
fn sum<T: Scalar>(row: &[T]) -> T {
    let mut sums = [T::zero(); LANES];
    for part in row.chunks_exact(LANES) {
        for lane in 0..LANES {
            sums[lane] += part[lane];
        }
    }
    sums.iter().fold(T::zero(), |sum, &x| sum + x)
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;

    fn results<T: Scalar>(network: &Perceptron, arch: Arch) -> Vec<T> {
        let number = |k: usize| T::of(0.9 * (0.7 * (k + 1) as f64).sin());
        let weights: Vec<T> = (0..network.weights()).map(number).collect();
        let mut batch = Batch::<T>::new(network, 75);
        batch.arch = arch;
        batch.input_mut().iter_mut().enumerate().for_each(|(j, x)| *x = number(31 * j));
        batch.forward(&weights);
        batch.output_adjoint_mut().iter_mut().enumerate().for_each(|(j, x)| *x = number(17 * j));
        let mut gradient = vec![T::zero(); weights.len()];
        batch.backward(&weights, &mut gradient);
        [&gradient, batch.output()].concat()
    }

    #[test]
    fn every_path_gives_the_same_bits() {
        let mut paths = Vec::new();
        paths.extend(pulp::x86::V3::try_new().map(Arch::V3));
        paths.extend(pulp::x86::V4::try_new().map(Arch::V4));
        for hidden in [vec![], vec![21, 40, 3]] {
            let network = Perceptron { inputs: 37, hidden, outputs: 11 };
            let single: Vec<u32> =
                results::<f32>(&network, Arch::Scalar).into_iter().map(f32::to_bits).collect();
            let double: Vec<u64> =
                results::<f64>(&network, Arch::Scalar).into_iter().map(f64::to_bits).collect();
            for &arch in &paths {
                let bits = results::<f32>(&network, arch).into_iter().map(f32::to_bits);
                assert!(bits.eq(single.iter().copied()), "{network:?}");
                let bits = results::<f64>(&network, arch).into_iter().map(f64::to_bits);
                assert!(bits.eq(double.iter().copied()), "{network:?}");
            }
        }
    }
}
