//! The extended Kalman filter.

use num_traits::Float;

use super::motion::{Noise, Transition};
use super::sensor::{Measurement, Scalar};
use super::state::{Estimate, Prior, STATES, State};

/// Extended Kalman filter over the states, with scalar updates in the order of time.
///
/// The influence of an outlier is bounded: where the squared normalized innovation `d^2 = e^2 / S` exceeds the threshold
/// `c^2`, its weight is `w = c / d`, and `S / w` takes the place of `S`, so that the correction is that of an innovation
/// of `c` standard deviations (Huber's function; Masreliez and Martin, IEEE Trans. AC 22 (1977) 361). No value is without
/// influence, so the filter cannot lose the vessel for ever.
#[derive(Clone, Debug)]
pub struct Filter {
    noise: Noise,
    threshold: f64,
    estimate: Estimate,
    linearized: [f64; STATES],
}

/// Outcome of a scalar: the innovation, its variance, and whether it was used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Measured minus predicted value.
    pub value: f64,
    /// Its variance `S`.
    pub variance: f64,
    /// Weight `w`: 1, or less for an outlier.
    pub weight: f64,
}

impl Innovation {
    /// Squared normalized innovation.
    pub fn nis(&self) -> f64 {
        self.value * self.value / self.variance
    }

    /// Whether the normalized innovation exceeds the threshold.
    pub fn is_outlier(&self) -> bool {
        self.weight < 1.0
    }
}

/// What a smoother needs of a scalar update.
#[derive(Clone, Debug)]
pub struct Update {
    /// The innovation and its variance.
    pub innovation: Innovation,
    /// Derivatives of the predicted value by the states.
    pub gradient: [f64; STATES],
    /// Kalman gain.
    pub gain: [f64; STATES],
}

/// Standard deviations of stationary states, with the power of their rate in them.
pub(super) fn stationary_start(n: &Noise) -> [(State, f64, f64); 13] {
    [
        (State::SurgeRate, n.surge_acceleration, 0.0),
        (State::Sway, n.sway, 0.0),
        (State::SwayRate, n.sway * n.sway_rate, 1.0),
        (State::YawRate, n.yaw, 0.0),
        (State::LaggedYawRate, n.yaw, 0.0),
        (State::YawAcceleration, n.yaw * n.yaw_rate, 1.0),
        (State::CompassError, n.compass, 0.0),
        (State::GnssNorth, n.gnss, 0.0),
        (State::GnssEast, n.gnss, 0.0),
        (State::WaveForwardIntegral, n.wave_forward / n.wave_frequency, -1.0),
        (State::WaveForward, n.wave_forward, 0.0),
        (State::WaveStarboardIntegral, n.wave_starboard / n.wave_frequency, -1.0),
        (State::WaveStarboard, n.wave_starboard, 0.0),
    ]
}

impl Filter {
    /// Squared normalized innovation that a normal one exceeds once in 10,000 cases.
    pub const OUTLIER: f64 = 15.137;

    /// Starts from a prior; the states whose statistics are stationary start with these. `threshold` is `c^2`.
    pub fn new(noise: Noise, prior: &Prior, threshold: f64) -> Self {
        let mut covariance = [[0.0; STATES]; STATES];
        for (i, deviation) in prior.deviation.iter().enumerate() {
            covariance[i][i] = deviation * deviation;
        }
        let estimate = Estimate { mean: prior.mean, covariance };
        let mut filter = Self { noise, threshold, estimate, linearized: prior.linearized };
        filter.start_stationary();
        filter
    }

    /// The states whose statistics are stationary begin with them.
    fn start_stationary(&mut self) {
        for (state, deviation, _) in stationary_start(&self.noise) {
            self.estimate.covariance[state as usize][state as usize] = deviation * deviation;
        }
    }

    /// The present estimate.
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// Starts another run: the sensors and the vessel are the same, place and motion are those of the prior.
    /// `kept` states keep their joint distribution.
    pub fn restart(&mut self, prior: &Prior, kept: &[State]) {
        let before = self.estimate.clone();
        *self = Self::new(self.noise, prior, self.threshold);
        for &i in kept {
            self.estimate.mean[i as usize] = before.mean[i as usize];
            for &j in kept {
                self.estimate.covariance[i as usize][j as usize] = before.covariance[i as usize][j as usize];
            }
        }
    }

    /// Prediction over a time \[s\].
    pub fn predict(&mut self, dt: f64) -> Transition {
        let before = self.estimate.mean;
        let mut mean = self.linearization();
        let shift: [f64; STATES] = core::array::from_fn(|i| before[i] - mean[i]);
        let transition = Transition::new(&self.noise, &mut mean, dt);
        transition.propagate(&mut self.estimate.covariance);
        transition.add_product(&shift, &mut mean);
        self.estimate.mean = mean;
        transition
    }

    /// The mean, with the values of constant states at which they are linearized.
    fn linearization(&self) -> [f64; STATES] {
        core::array::from_fn(|i| {
            let fixed = self.linearized[i];
            if fixed.is_nan() { self.estimate.mean[i] } else { fixed }
        })
    }

    /// Update by a measurement at the present time. `visit` sees each scalar.
    pub fn update(&mut self, measurement: &Measurement, mut visit: impl FnMut(&Update)) {
        // All scalars of a measurement are linearized at the same state; the second sees the first through the shift.
        let before = self.linearization();
        for mut scalar in
            measurement.scalars(&before, self.noise.pivot_rate).into_iter().filter(Scalar::counts)
        {
            for ((h, now), then) in scalar.gradient.iter().zip(&self.estimate.mean).zip(&before) {
                scalar.residual -= h * (now - then);
            }
            visit(&self.apply(&scalar));
        }
    }

    fn apply(&mut self, scalar: &Scalar) -> Update {
        let covariance = &mut self.estimate.covariance;
        let mut product = [0.0; STATES];
        for (line, h) in covariance.iter().zip(&scalar.gradient).filter(|(_, h)| **h != 0.0) {
            for (p, x) in product.iter_mut().zip(line) {
                *p += h * x;
            }
        }
        let spread: f64 = product.iter().zip(&scalar.gradient).map(|(p, h)| p * h).sum();
        let mut innovation =
            Innovation { value: scalar.residual, variance: spread + scalar.variance, weight: 1.0 };
        if innovation.nis() > self.threshold {
            innovation.weight = Float::sqrt(self.threshold / innovation.nis());
        }
        let gain = product.map(|p| p * innovation.weight / innovation.variance);
        for ((line, k), m) in covariance.iter_mut().zip(&gain).zip(&mut self.estimate.mean) {
            *m += k * scalar.residual;
            for (x, p) in line.iter_mut().zip(&product) {
                *x -= k * p;
            }
        }
        for i in 0..STATES {
            covariance[i][i] = covariance[i][i].max(0.0);
        }
        Update { innovation, gradient: scalar.gradient, gain }
    }
}
