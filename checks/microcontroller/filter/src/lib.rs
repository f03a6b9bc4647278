//! A gated recurrent unit with the extended Kalman filter over its state and weights, for a processor without an operating
//! system.
#![no_std]


extern crate alloc;

#[cfg(target_os = "none")]
mod board;

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use hydroid_core::adapt::Learning as _;
use hydroid_core::adapt::kalman::{CovarianceForm, FilterOptions, KalmanNetwork};
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, Scaling};
use hydroid_core::predict::Predictor as _;

const INPUTS: usize = 2;
const OUTPUTS: usize = 3;

/// A run of a network that learns.
pub struct Learner {
    session: KalmanNetwork,
    sample: u32,
}

/// Numbers of moderate size that are equal on every processor: a linear congruential generator (Knuth).
fn number(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
}

impl Learner {
    /// A network of `cells` cells with output feedback. `group` is that of [`CovarianceForm::Blocks`]; 0 for the full
    /// covariance.
    pub fn new(cells: usize, group: usize) -> Option<Self> {
        let network = Network {
            cell: Cell::Gru { hidden: cells },
            inputs: INPUTS + OUTPUTS,
            outputs: OUTPUTS,
            read_out: true,
        };
        let mut state = 1;
        let weights: Vec<f64> = (0..network.weights()).map(|_| number(&mut state)).collect();
        let scaling = Scaling {
            output_mean: vec![0.0; OUTPUTS],
            output_scale: vec![1.0; OUTPUTS],
            input_mean: vec![0.0; INPUTS],
            input_scale: vec![1.0; INPUTS],
            correction_scale: vec![0.1; OUTPUTS],
        };
        let mut options = FilterOptions::uniform(weights.len(), 1e-2, 1e-7, (0.1, 1e-5), &[1e-2; OUTPUTS]);
        if group > 0 {
            options.covariance = CovarianceForm::Blocks { group };
        }
        let model =
            Recurrent { network, weights, scaling, base: BaseModel::Hold, feedback: true, wash_out: 10 };
        Some(Self { session: KalmanNetwork::new(Arc::new(model), options).ok()?, sample: 0 })
    }

    /// Number of weights.
    pub fn weights(&self) -> usize {
        self.session.weights().len()
    }

    /// The next sample: a command, and a measurement of a first-order lag.
    pub fn step(&mut self) {
        let side = if (self.sample / 20).is_multiple_of(2) { 1.0 } else { -1.0 };
        let ahead = 1.0 + 0.5 * side;
        let along = f64::from(self.sample % 20) / 20.0;
        self.session.advance(&[ahead, 0.3 * side]);
        self.session.observe(&[ahead * along, 0.1 * side * along, 0.2 * side * along * along]);
        self.sample += 1;
    }

    /// Mean of the squares of the weights, for comparison.
    pub fn check(&self) -> f64 {
        self.session.weights().iter().map(|w| w * w).sum::<f64>() / self.weights() as f64
    }
}
