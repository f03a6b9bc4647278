//! The boat in the water, its pilot, and the errors of its sensors.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use hydroid_core::craft::Dynamics;
use rand::{Rng, RngExt as _};

/// Latitude and longitude of the start [deg].
pub(super) const ORIGIN_DEG: [f64; 2] = [63.44, 10.36];

/// Metres for a degree of latitude.
const DEGREE_M: f64 = 111_318.845;

/// Steps of the integration in a tick.
const STEPS: usize = 2;

/// The angle between -pi and pi.
pub(super) fn wrap(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// A normal number, nearly.
pub(super) fn normal(rng: &mut impl Rng) -> f64 {
    (0..12).map(|_| rng.random_range(-0.5..0.5)).sum()
}

/// Latitude and longitude in 1e-7 degrees of a place north and east of the start [m].
#[expect(clippy::cast_possible_truncation, reason = "whole numbers of the message")]
pub(super) fn geographic([north, east]: [f64; 2]) -> [i32; 2] {
    let [latitude, longitude] = ORIGIN_DEG;
    let east_m = DEGREE_M * latitude.to_radians().cos();
    [latitude + north / DEGREE_M, longitude + east / east_m].map(|degrees| (1e7 * degrees).round() as i32)
}

/// The catamaran of `vessels/otter.toml` in a current.
pub(super) struct Water {
    dynamics: Dynamics,
    servos: Vec<f64>,
    /// Velocities through the water.
    pub(super) nu: [f64; 3],
    pub(super) pose: [f64; 3],
    pub(super) current: [f64; 2],
    /// Slow error of the positions \[m\].
    pub(super) drift_m: [f64; 2],
    /// Way over ground \[m\].
    pub(super) way_m: f64,
}

impl Water {
    pub(super) fn new(rng: &mut impl Rng) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vessels/otter.toml");
        let file = hydroid::craft::parse(&std::fs::read_to_string(&path).unwrap(), &path).unwrap();
        let dynamics = Dynamics::new(&file.craft);
        let (speed, to) = (rng.random_range(0.0..0.25), rng.random_range(-PI..PI));
        Self {
            servos: vec![0.0; dynamics.servos()],
            dynamics,
            nu: [0.0; 3],
            pose: [0.0, 0.0, rng.random_range(-PI..PI)],
            current: [speed * to.cos(), speed * to.sin()],
            drift_m: [0.0; 2],
            way_m: 0.0,
        }
    }

    /// Velocity over ground, north and east.
    pub(super) fn velocity(&self) -> [f64; 2] {
        let ([u, v, _], (sine, cosine)) = (self.nu, self.pose[2].sin_cos());
        [u * cosine - v * sine + self.current[0], u * sine + v * cosine + self.current[1]]
    }

    /// Velocity over ground ahead.
    pub(super) fn speed(&self) -> f64 {
        let ([north, east], (sine, cosine)) = (self.velocity(), self.pose[2].sin_cos());
        north * cosine + east * sine
    }

    /// Advances with pulses of the left and the right thruster \[us\].
    pub(super) fn advance(&mut self, pulses: [f64; 2], dt: f64, rng: &mut impl Rng) {
        self.dynamics.advance(&mut self.nu, &mut self.servos, &pulses, dt / STEPS as f64, STEPS);
        let [north, east] = self.velocity();
        self.pose[0] += dt * north;
        self.pose[1] += dt * east;
        self.pose[2] = wrap(self.pose[2] + dt * self.nu[2]);
        self.way_m += dt * north.hypot(east);
        // A Gauss-Markov process of 0.5 m and 60 s.
        let step = (dt / 60.0).sqrt();
        for drift in &mut self.drift_m {
            *drift += -dt / 60.0 * *drift + 0.7 * step * rng.random_range(-1.7..1.7);
        }
    }

    /// Sticks of a pilot who takes the boat to the middle, steering and throttle from -1 to 1.
    pub(super) fn homeward(&self) -> [f64; 2] {
        let [north, east, psi] = self.pose;
        let error = wrap((-east).atan2(-north) - psi);
        [(error - 0.5 * self.nu[2]).clamp(-0.6, 0.6), if error.abs() < 0.8 { 0.7 } else { 0.25 }]
    }

    /// Distance from the middle \[m\].
    pub(super) fn distance(&self) -> f64 {
        self.pose[0].hypot(self.pose[1])
    }
}
