//! Disturbances: measurement noise, current, wind with gusts, mass error, command delay.

use rand_distr::{Distribution as _, StandardNormal};
use serde::Serialize;

use super::error::{ClosedLoopError, at_least, positive};
use super::random::{Purpose, stream};

/// Wind as a force on the hull in north and east, without a yaw moment: a steady part and gusts.
///
/// Gusts are a first-order Gauss-Markov process in each direction, with time constant `gust_s` and standard deviation
/// `gust` (Fossen 2021, section 10.1). Vessel files have no wind coefficients, so the wind is given as a force.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wind {
    /// Steady force, north and east \[N\].
    pub force: [f64; 2],
    /// Standard deviation of the gusts in each direction \[N\].
    pub gust: f64,
    /// Time constant of the gusts \[s\].
    pub gust_s: f64,
}

impl Wind {
    /// No wind.
    pub const CALM: Self = Self { force: [0.0; 2], gust: 0.0, gust_s: 5.0 };
}

/// Conditions of a run. The controller does not know them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Conditions {
    /// Seed of noise and gusts.
    pub seed: u64,
    /// Scale of the measurement noise of the plant; 0 for none.
    pub noise: f64,
    /// Scale of the process noise of a model ([`record`](crate::plant::record())); 0 for none. A vessel with given parameters
    /// has none.
    pub process_noise: f64,
    /// Velocity of the water, north and east \[m/s\]: steady and uniform.
    pub current: [f64; 2],
    /// Wind.
    pub wind: Wind,
    /// Factor on mass and yaw inertia of the vessel.
    pub mass: f64,
    /// Delay of the commands \[s\]; a whole number of samples.
    pub delay_s: f64,
    /// Time from which current, wind and mass factor apply \[s\]. The velocity over ground does not jump.
    pub onset_s: f64,
}

impl Conditions {
    /// The measurement noise of the plant without other disturbances.
    pub const fn calm(seed: u64) -> Self {
        Self {
            seed,
            noise: 1.0,
            process_noise: 0.0,
            current: [0.0; 2],
            wind: Wind::CALM,
            mass: 1.0,
            delay_s: 0.0,
            onset_s: 0.0,
        }
    }

    pub(super) fn check(&self) -> Result<(), ClosedLoopError> {
        at_least("the scale of the noise", self.noise, 0.0)?;
        at_least("the scale of the process noise", self.process_noise, 0.0)?;
        for (what, value) in [("the current", self.current), ("the force of the wind", self.wind.force)] {
            for value in value {
                at_least(what, value.abs(), 0.0)?;
            }
        }
        at_least("the standard deviation of the gusts", self.wind.gust, 0.0)?;
        positive("the time constant of the gusts", self.wind.gust_s)?;
        positive("the factor on the mass", self.mass)?;
        at_least("the delay", self.delay_s, 0.0)?;
        at_least("the onset", self.onset_s, 0.0)
    }
}

pub(super) struct Gusts {
    wind: Wind,
    decay: f64,
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
        Self { wind, decay: (-dt_s / wind.gust_s).exp(), now, random }
    }

    /// Force of this sample, north and east \[N\]; advances the gusts.
    pub(super) fn next(&mut self) -> [f64; 2] {
        let force = std::array::from_fn(|i| self.wind.force[i] + self.now[i]);
        let innovation = self.wind.gust * (1.0 - self.decay * self.decay).sqrt();
        for gust in &mut self.now {
            let white: f64 = StandardNormal.sample(&mut self.random);
            *gust = self.decay * *gust + innovation * white;
        }
        force
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gusts_have_the_given_standard_deviation_and_time_constant() {
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
