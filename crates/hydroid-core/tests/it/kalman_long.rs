//! Long runs of the Kalman filter: the hydrofoil under random commands in both modes.
//!
//! The test of ten million samples takes most of an hour:
//!
//! ```text
//! cargo test --release -p hydroid-core --test it ten_million -- --ignored --nocapture
//! ```

use std::sync::Arc;

use hydroid_core::adapt::kalman::{FilterOptions, KalmanNetwork};
use hydroid_core::adapt::{Learning, Outcome};
use hydroid_core::craft::Craft;
use hydroid_core::predict::Predictor;
use hydroid_core::vessel::{Command, State};

use crate::plant::Plant;

use crate::networks::pretrained;

/// Uniform numbers from the high bits of a linear congruential generator (Knuth).
struct Draws(u64);

impl Draws {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// Of variance 1, from twelve uniform ones.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.between(0.0, 1.0)).sum::<f64>() - 6.0
    }
}

/// A hydrofoil with a new random command every 2 to 12 s, and its noisy sensors.
struct Voyage {
    plant: Plant,
    state: State,
    command: Command,
    /// Remaining samples of the command.
    left: f64,
    draws: Draws,
}

impl Voyage {
    fn begin() -> Self {
        let plant = Plant::new(&Craft::hydrofoil());
        Self { plant, state: State::REST, command: Command { pp: 0.0, rd: 0.0 }, left: 0.0, draws: Draws(7) }
    }

    fn measured(&mut self) -> [f64; 3] {
        let State { u, v, r, .. } = self.state;
        let std = [0.01, 0.01, 1.0_f64.to_radians()];
        std::array::from_fn(|i| [u, v, r][i] + std[i] * self.draws.normal())
    }

    fn sail(&mut self) -> [f64; 2] {
        if self.left < 1.0 {
            self.left = self.draws.between(20.0, 120.0);
            self.command =
                Command { pp: self.draws.between(-60.0, 350.0), rd: self.draws.between(-0.5, 0.5) };
        }
        self.left -= 1.0;
        for _ in 0..10 {
            self.state = self.plant.advance(&self.state, &self.command, 0.01);
        }
        [self.command.pp, self.command.rd]
    }
}

/// The LSTM of the thesis, trained at low speed only, with the reference's options.
fn learner() -> (KalmanNetwork, Vec<f64>) {
    let (model, noise) = pretrained("lstm");
    let noise: Vec<f64> = noise.iter().map(|variance| 5.0 * variance).collect();
    let options = FilterOptions {
        leak: 3e-5,
        ..FilterOptions::uniform(model.weights.len(), 4e-3, 1e-7, (1.0, 1e-5), &noise)
    };
    (KalmanNetwork::new(Arc::new(model), options).unwrap(), noise)
}

/// Smallest eigenvalue of a symmetric 3 x 3 matrix (row by row), by the trigonometric solution of its cubic.
fn smallest_eigenvalue(m: &[f64]) -> f64 {
    let mean = (m[0] + m[4] + m[8]) / 3.0;
    let off = m[1] * m[1] + m[2] * m[2] + m[5] * m[5];
    let square = (m[0] - mean).powi(2) + (m[4] - mean).powi(2) + (m[8] - mean).powi(2) + 2.0 * off;
    let p = (square / 6.0).sqrt();
    if p == 0.0 {
        return mean;
    }
    let b = |i: usize| (m[i] - if i.is_multiple_of(4) { mean } else { 0.0 }) / p;
    let det = b(0) * (b(4) * b(8) - b(5) * b(7)) - b(1) * (b(3) * b(8) - b(5) * b(6))
        + b(2) * (b(3) * b(7) - b(4) * b(6));
    let angle = (0.5 * det).clamp(-1.0, 1.0).acos() / 3.0;
    mean + 2.0 * p * (angle + 2.0 * std::f64::consts::PI / 3.0).cos()
}

fn voyage(samples: usize) {
    let (mut session, noise) = learner();
    let mut voyage = Voyage::begin();
    let mut errors = Vec::new();
    let (mut square, mut least) = (0.0, f64::INFINITY);
    let every = samples / 20;
    for k in 1..=samples {
        let c = voyage.sail();
        session.advance(&c);
        session.observe(&voyage.measured());
        assert_eq!(session.outcome(), Outcome::Accepted, "sample {k}");
        square += session.innovations()[0].value.powi(2);
        if k % 100 == 0 {
            // S - R has no negative eigenvalue, except for rounding.
            let spread: Vec<f64> = session.filter().prior_output_covariance().to_vec();
            let smallest = smallest_eigenvalue(&spread);
            least = least.min(smallest / noise[0]);
            assert!(smallest > -1e-3 * noise[0], "sample {k}: S is below R by {smallest}");
        }
        if k % every == 0 {
            let (hh, tt) = session.filter().variances();
            assert!(hh.iter().chain(&tt).all(|p| *p > 0.0 && p.is_finite()), "sample {k}");
            errors.push((square / every as f64).sqrt());
            square = 0.0;
        }
    }
    println!("innovation of u [m/s], twentieth by twentieth: {errors:.4?}; least eigenvalue {least:.1e} R");
    let later = errors[1..].iter().copied().fold(0.0, f64::max);
    assert!(later < 2.0 * errors[0], "{errors:?}");
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn a_hundred_thousand_samples() {
    voyage(100_000);
}

#[test]
#[ignore = "an hour; not part of .ci/run"]
fn ten_million_samples() {
    voyage(10_000_000);
}
