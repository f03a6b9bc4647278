//! Rows of the regression: increments over a window of samples.

use alloc::vec;
use alloc::vec::Vec;

use crate::memory::Memory;

/// Collects samples into rows
///
/// ```text
/// z   = (y_k - y_{k-m}) / (m dt)                                    [unit/s]
/// phi = 1/m sum_{i=k-m}^{k-1} theta((y_i + y_{i+1})/2, c_i)
/// ```
///
/// over `m` samples, with the library at the mid-state of each interval under its held command. The standard deviation
/// of the noise of `z` falls as `1/m`. A row is completed every `stride` samples.
///
/// The window is a ring of blocks of `stride` intervals, each summed from zero: rounding errors and spikes leave the
/// window with their block.
#[derive(Clone, Debug)]
pub(super) struct Increments {
    outputs: usize,
    terms: usize,
    blocks: usize,
    stride: usize,
    dt: f64,
    starts: Vec<f64>,
    sums: Vec<f64>,
    /// Index of the incomplete block, the number of its intervals, and the number of complete blocks.
    current: usize,
    filled: usize,
    full: usize,
}

impl Increments {
    /// For windows of `samples` intervals, rounded down to a multiple of the stride (a quarter of the window).
    pub(super) fn new(samples: usize, outputs: usize, terms: usize, dt: f64) -> Self {
        let stride = (samples / 4).max(1);
        let blocks = (samples / stride).max(1);
        Self {
            outputs,
            terms,
            blocks,
            stride,
            dt,
            starts: vec![0.0; blocks * outputs],
            sums: vec![0.0; blocks * terms],
            current: 0,
            filled: 0,
            full: 0,
        }
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.numbers(&mut self.starts);
        memory.numbers(&mut self.sums);
        memory.count(&mut self.current, self.blocks - 1);
        memory.count(&mut self.filled, self.stride - 1);
        memory.count(&mut self.full, self.blocks);
    }

    pub(super) fn samples(&self) -> usize {
        self.blocks * self.stride
    }

    pub(super) fn stride(&self) -> usize {
        self.stride
    }

    /// Maximum number of rows that contain one sample.
    pub(super) fn overlap(&self) -> usize {
        self.blocks + 1
    }

    pub(super) fn restart(&mut self, y: &[f64]) {
        self.full = 0;
        self.begin(y);
    }

    fn begin(&mut self, y: &[f64]) {
        self.filled = 0;
        self.starts[self.current * self.outputs..][..self.outputs].copy_from_slice(y);
        self.sums[self.current * self.terms..][..self.terms].fill(0.0);
    }

    /// Adds an interval: the library `theta(j)` of term `j` and the outputs `y` at its end. Returns whether a row was
    /// completed and written to `phi` and `z`.
    pub(super) fn push(
        &mut self,
        theta: impl Fn(usize) -> f64,
        y: &[f64],
        phi: &mut [f64],
        z: &mut [f64],
    ) -> bool {
        for (j, sum) in self.sums[self.current * self.terms..][..self.terms].iter_mut().enumerate() {
            *sum += theta(j);
        }
        self.filled += 1;
        if self.filled < self.stride {
            return false;
        }
        self.full = (self.full + 1).min(self.blocks);
        let ready = self.full == self.blocks;
        self.current = (self.current + 1) % self.blocks;
        if ready {
            let m = self.samples() as f64;
            let start = &self.starts[self.current * self.outputs..][..self.outputs];
            for ((z, y), start) in z.iter_mut().zip(y).zip(start) {
                *z = (y - start) / (m * self.dt);
            }
            phi.fill(0.0);
            for block in self.sums.chunks_exact(self.terms) {
                for (phi, sum) in phi.iter_mut().zip(block) {
                    *phi += sum / m;
                }
            }
        }
        self.begin(y);
        ready
    }
}
