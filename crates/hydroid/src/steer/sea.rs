//! What a vessel meets, and what it is not told.

use rand_distr::{Distribution as _, StandardNormal};
use serde::Serialize;

use super::error::{SteerError, at_least, positive};
use super::random::{Purpose, stream};

/// Wind as a force on the hull, north and east, without a moment: a steady part, and gusts.
///
/// A gust is a first-order Gauss-Markov process in each direction, white noise through a lag of `gust_s` seconds whose
/// standard deviation is `gust` (Fossen 2021, section 10.1, has the same for slowly varying disturbances). A vessel's file
/// has no windage, so the wind is told as what it does: newtons.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wind {
    /// Steady force, north and east \[N\].
    pub force: [f64; 2],
    /// Standard deviation of the gusts in each direction \[N\].
    pub gust: f64,
    /// Their time constant \[s\].
    pub gust_s: f64,
}

impl Wind {
    /// None at all.
    pub const CALM: Self = Self { force: [0.0; 2], gust: 0.0, gust_s: 5.0 };
}

/// The conditions of a voyage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Conditions {
    /// Seed of noise and gusts.
    pub seed: u64,
    /// Scale of the vessel's measurement noise; 0 for none.
    pub noise: f64,
    /// Current, where the water goes, north and east \[m/s\]: steady and the same everywhere.
    pub current: [f64; 2],
    /// Wind.
    pub wind: Wind,
    /// Factor on mass and yaw inertia of the vessel.
    pub mass: f64,
    /// Time between a command and the moment at which it acts \[s\]; a whole number of samples.
    pub delay_s: f64,
}

impl Conditions {
    /// The vessel's own noise and nothing else.
    pub const fn calm(seed: u64) -> Self {
        Self { seed, noise: 1.0, current: [0.0; 2], wind: Wind::CALM, mass: 1.0, delay_s: 0.0 }
    }

    pub(super) fn check(&self) -> Result<(), SteerError> {
        at_least("the scale of the noise", self.noise, 0.0)?;
        for (what, value) in [("the current", self.current), ("the force of the wind", self.wind.force)] {
            for value in value {
                at_least(what, value.abs(), 0.0)?;
            }
        }
        at_least("the standard deviation of the gusts", self.wind.gust, 0.0)?;
        positive("the time constant of the gusts", self.wind.gust_s)?;
        positive("the factor on the mass", self.mass)?;
        at_least("the delay", self.delay_s, 0.0)
    }
}

/// Wind from sample to sample.
pub(super) struct Gusts {
    wind: Wind,
    keeps: f64,
    now: [f64; 2],
    random: rand_chacha::ChaCha8Rng,
}

impl Gusts {
    pub(super) fn new(wind: Wind, seed: u64, dt_s: f64) -> Self {
        let mut random = stream(seed, Purpose::Gusts);
        let now = std::array::from_fn(|_| {
            let white: f64 = StandardNormal.sample(&mut random);
            wind.gust * white
        });
        Self { wind, keeps: (-dt_s / wind.gust_s).exp(), now, random }
    }

    /// Force of this sample, north and east \[N\]; then the gusts move on.
    pub(super) fn next(&mut self) -> [f64; 2] {
        let force = std::array::from_fn(|i| self.wind.force[i] + self.now[i]);
        let fresh = self.wind.gust * (1.0 - self.keeps * self.keeps).sqrt();
        for gust in &mut self.now {
            let white: f64 = StandardNormal.sample(&mut self.random);
            *gust = self.keeps * *gust + fresh * white;
        }
        force
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gusts_have_the_deviation_and_the_time_constant_that_they_are_told() {
        let wind = Wind { force: [10.0, -4.0], gust: 3.0, gust_s: 2.0 };
        let mut gusts = Gusts::new(wind, 7, 0.1);
        let all: Vec<[f64; 2]> = (0..200_000).map(|_| gusts.next()).collect();
        let n = all.len() as f64;
        let mean = all.iter().map(|f| f[0]).sum::<f64>() / n;
        let off: Vec<f64> = all.iter().map(|f| f[0] - mean).collect();
        let variance = off.iter().map(|x| x * x).sum::<f64>() / n;
        let after: f64 = off.windows(21).map(|w| w[0] * w[20]).sum::<f64>() / n / variance;
        assert!((mean - 10.0).abs() < 0.2 && (variance.sqrt() - 3.0).abs() < 0.1);
        assert!((after - (-1.0f64).exp()).abs() < 0.03, "two seconds later {after}");
    }
}
