//! Transition of the states over a time, and its noise.

use num_traits::Float;

use super::state::{STATES, State};

/// Statistics of motion, waves and sensor errors. All are standard deviations, rates or times that a likelihood can
/// estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Rate of the surge acceleration \[1/s\].
    pub surge_rate: f64,
    /// Standard deviation of the surge acceleration \[m/s²\].
    pub surge_acceleration: f64,
    /// Rate of the sway velocity \[1/s\].
    pub sway_rate: f64,
    /// Standard deviation of the sway velocity \[m/s\].
    pub sway: f64,
    /// Rate of the yaw rate \[1/s\].
    pub yaw_rate: f64,
    /// Standard deviation of the yaw rate \[rad/s\].
    pub yaw: f64,
    /// Frequency of the waves \[rad/s\].
    pub wave_frequency: f64,
    /// Relative damping of the waves.
    pub wave_damping: f64,
    /// Standard deviation of the forward specific force by waves \[m/s²\].
    pub wave_forward: f64,
    /// Standard deviation of the starboard specific force by waves \[m/s²\].
    pub wave_starboard: f64,
    /// Rate of the correlated error of the GNSS position \[1/s\].
    pub gnss_rate: f64,
    /// Standard deviation of the correlated error of the GNSS position \[m\].
    pub gnss: f64,
    /// Rate of the correlated error of the compass \[1/s\].
    pub compass_rate: f64,
    /// Standard deviation of the correlated error of the compass \[rad\].
    pub compass: f64,
    /// Random walk of the gyro's bias \[rad/s per square root of s\].
    pub gyro_walk: f64,
    /// Random walk of the biases of the accelerometers \[m/s² per square root of s\].
    pub accelerometer_walk: f64,
    /// Random walk of the current \[m/s per square root of s\].
    pub current_walk: f64,
}

/// Linearized transition `x <- F x` over a time: the rows of `F` that differ from those of the identity, and the
/// covariance of the noise, whose blocks have at most two states.
#[derive(Clone, Debug)]
pub struct Transition {
    rows: [Row; CHANGED],
    noise: [(usize, usize, [f64; 3]); NOISY],
}

const CHANGED: usize = 16;
const NOISY: usize = 13;
const WIDEST: usize = 10;

/// A row of `F`: its index and its non-zero entries.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    index: usize,
    entries: [(usize, f64); WIDEST],
    length: usize,
}

impl Row {
    fn new(state: State, entries: &[(State, f64)]) -> Self {
        let mut row = Self { index: state as usize, length: entries.len(), ..Self::default() };
        for (slot, (column, value)) in row.entries.iter_mut().zip(entries) {
            *slot = (*column as usize, *value);
        }
        row
    }

    fn entries(&self) -> &[(usize, f64)] {
        &self.entries[..self.length]
    }
}

/// Transition of a Matérn process of smoothness 3/2 and its derivative.
fn matern(rate: f64, dt: f64) -> [f64; 4] {
    let decay = Float::exp(-rate * dt);
    [decay * (1.0 + rate * dt), decay * dt, -decay * rate * rate * dt, decay * (1.0 - rate * dt)]
}

/// Transition of a damped oscillator and its derivative.
fn oscillator(frequency: f64, damping: f64, dt: f64) -> [f64; 4] {
    let damping = damping.min(0.99);
    let damped = frequency * Float::sqrt(1.0 - damping * damping);
    let decay = Float::exp(-damping * frequency * dt);
    let (sine, cosine) = Float::sin_cos(damped * dt);
    let sine = sine / damped;
    [
        decay * (cosine + damping * frequency * sine),
        decay * sine,
        -decay * frequency * frequency * sine,
        decay * (cosine - damping * frequency * sine),
    ]
}

/// Noise of a stationary pair with the variances `(s, q s)`: `P - A P A'`.
fn stationary(a: [f64; 4], variance: f64, ratio: f64) -> [f64; 3] {
    let (p, q) = (variance, ratio * variance);
    [
        p - (a[0] * a[0] * p + a[1] * a[1] * q),
        -(a[0] * a[2] * p + a[1] * a[3] * q),
        q - (a[2] * a[2] * p + a[3] * a[3] * q),
    ]
}

/// Transitions of the processes over a time.
#[derive(Clone, Copy, Debug)]
struct Steps {
    /// Of the surge acceleration.
    decay: f64,
    sway: [f64; 4],
    yaw: [f64; 4],
    wave: [f64; 4],
    gnss: f64,
    compass: f64,
}

impl Steps {
    fn new(noise: &Noise, dt: f64) -> Self {
        Self {
            decay: Float::exp(-noise.surge_rate * dt),
            sway: matern(noise.sway_rate, dt),
            yaw: matern(noise.yaw_rate, dt),
            wave: oscillator(noise.wave_frequency, noise.wave_damping, dt),
            gnss: Float::exp(-noise.gnss_rate * dt),
            compass: Float::exp(-noise.compass_rate * dt),
        }
    }

    /// Blocks of the covariance of the noise.
    fn noise(&self, of: &Noise, dt: f64) -> [(usize, usize, [f64; 3]); NOISY] {
        use State as S;
        let Self { decay, sway: sway_step, yaw: yaw_step, wave, gnss, compass } = *self;
        let half = 0.5 * dt * dt;
        // Ornstein-Uhlenbeck process and its integral (Singer 1970, eq. 9).
        let (l, s2) = (of.surge_rate, of.surge_acceleration * of.surge_acceleration);
        let surge_noise = if l * dt < 1e-2 {
            let q = 2.0 * l * s2;
            [q * dt * dt * dt / 3.0, q * half, s2 * (1.0 - decay * decay)]
        } else {
            [
                s2 / (l * l) * (2.0 * l * dt - 3.0 + 4.0 * decay - decay * decay),
                s2 / l * (1.0 - decay) * (1.0 - decay),
                s2 * (1.0 - decay * decay),
            ]
        };
        let square = |x: f64| x * x;
        let ratio = |rate: f64| rate * rate;
        let single = |state: State, variance: f64| (state as usize, state as usize, [variance, 0.0, 0.0]);
        let double = |first: State, second: State, block: [f64; 3]| (first as usize, second as usize, block);
        let gnss_noise = square(of.gnss) * (1.0 - gnss * gnss);
        [
            double(S::Surge, S::SurgeRate, surge_noise),
            double(S::Sway, S::SwayRate, stationary(sway_step, square(of.sway), ratio(of.sway_rate))),
            double(S::YawRate, S::YawAcceleration, stationary(yaw_step, square(of.yaw), ratio(of.yaw_rate))),
            double(
                S::WaveForwardIntegral,
                S::WaveForward,
                stationary(wave, square(of.wave_forward / of.wave_frequency), ratio(of.wave_frequency)),
            ),
            double(
                S::WaveStarboardIntegral,
                S::WaveStarboard,
                stationary(wave, square(of.wave_starboard / of.wave_frequency), ratio(of.wave_frequency)),
            ),
            single(S::GyroBias, square(of.gyro_walk) * dt),
            single(S::ForwardBias, square(of.accelerometer_walk) * dt),
            single(S::StarboardBias, square(of.accelerometer_walk) * dt),
            single(S::CompassError, square(of.compass) * (1.0 - compass * compass)),
            single(S::GnssNorth, gnss_noise),
            single(S::GnssEast, gnss_noise),
            single(S::CurrentNorth, square(of.current_walk) * dt),
            single(S::CurrentEast, square(of.current_walk) * dt),
        ]
    }
}

impl Transition {
    /// The state after a time, and the linearized transition.
    pub fn new(noise: &Noise, mean: &mut [f64; STATES], dt: f64) -> Self {
        use State as S;
        let at = |state: State| mean[state as usize];
        let (sine, cosine) = Float::sin_cos(at(S::Heading) + 0.5 * dt * at(S::YawRate));
        let surge = at(S::Surge) + 0.5 * dt * at(S::SurgeRate);
        let turn = at(S::YawRate) + 0.5 * dt * at(S::YawAcceleration);
        let pivot = at(S::Pivot);
        let sway = at(S::Sway) + 0.5 * dt * at(S::SwayRate) - pivot * turn;
        let (along, across) = (cosine * surge - sine * sway, sine * surge + cosine * sway);
        let half = 0.5 * dt * dt;

        let steps = Steps::new(noise, dt);
        let Steps { decay, sway: sway_step, yaw: yaw_step, wave, gnss, compass } = steps;
        let reach = (1.0 - decay) / noise.surge_rate;

        let pair = |first: State, second: State, a: [f64; 4]| {
            [
                Row::new(first, &[(first, a[0]), (second, a[1])]),
                Row::new(second, &[(first, a[2]), (second, a[3])]),
            ]
        };
        let [sway_row, sway_rate_row] = pair(S::Sway, S::SwayRate, sway_step);
        let [yaw_row, yaw_rate_row] = pair(S::YawRate, S::YawAcceleration, yaw_step);
        let [forward_integral_row, forward_row] = pair(S::WaveForwardIntegral, S::WaveForward, wave);
        let [starboard_integral_row, starboard_row] = pair(S::WaveStarboardIntegral, S::WaveStarboard, wave);
        let position = |state, current, by_heading: f64, by_surge: f64, by_sway: f64| {
            Row::new(
                state,
                &[
                    (state, 1.0),
                    (S::Heading, dt * by_heading),
                    (S::YawRate, half * by_heading - dt * by_sway * pivot),
                    (S::YawAcceleration, -half * by_sway * pivot),
                    (S::Pivot, -dt * by_sway * turn),
                    (S::Surge, dt * by_surge),
                    (S::SurgeRate, half * by_surge),
                    (S::Sway, dt * by_sway),
                    (S::SwayRate, half * by_sway),
                    (current, dt),
                ],
            )
        };
        let rows = [
            position(S::North, S::CurrentNorth, -across, cosine, -sine),
            position(S::East, S::CurrentEast, along, sine, cosine),
            Row::new(S::Heading, &[(S::Heading, 1.0), (S::YawRate, dt), (S::YawAcceleration, half)]),
            Row::new(S::Surge, &[(S::Surge, 1.0), (S::SurgeRate, reach)]),
            Row::new(S::SurgeRate, &[(S::SurgeRate, decay)]),
            sway_row,
            sway_rate_row,
            yaw_row,
            yaw_rate_row,
            Row::new(S::CompassError, &[(S::CompassError, compass)]),
            Row::new(S::GnssNorth, &[(S::GnssNorth, gnss)]),
            Row::new(S::GnssEast, &[(S::GnssEast, gnss)]),
            forward_integral_row,
            forward_row,
            starboard_integral_row,
            starboard_row,
        ];

        let noise = steps.noise(noise, dt);

        let before = *mean;
        for row in &rows {
            mean[row.index] = row.entries().iter().map(|(column, value)| value * before[*column]).sum();
        }
        // The position is not linear in the heading.
        mean[S::North as usize] = before[0] + dt * (along + before[S::CurrentNorth as usize]);
        mean[S::East as usize] = before[1] + dt * (across + before[S::CurrentEast as usize]);
        Self { rows, noise }
    }

    /// `F P F' + Q` in place.
    pub fn propagate(&self, covariance: &mut [[f64; STATES]; STATES]) {
        let mut product = [[0.0; STATES]; CHANGED];
        for (out, row) in product.iter_mut().zip(&self.rows) {
            for (column, value) in row.entries() {
                for (x, p) in out.iter_mut().zip(&covariance[*column]) {
                    *x += value * p;
                }
            }
        }
        for (from, row) in product.iter().zip(&self.rows) {
            covariance[row.index] = *from;
        }
        for line in covariance.iter_mut() {
            let before = *line;
            for row in &self.rows {
                line[row.index] = row.entries().iter().map(|(column, value)| value * before[*column]).sum();
            }
        }
        for (first, second, block) in &self.noise {
            covariance[*first][*first] += block[0];
            if first != second {
                covariance[*first][*second] += block[1];
                covariance[*second][*first] += block[1];
                covariance[*second][*second] += block[2];
            }
        }
    }

    /// `F' l` in place.
    pub fn transpose(&self, adjoint: &mut [f64; STATES]) {
        let mut out = *adjoint;
        for row in &self.rows {
            out[row.index] = 0.0;
        }
        for row in &self.rows {
            for (column, value) in row.entries() {
                out[*column] += value * adjoint[row.index];
            }
        }
        *adjoint = out;
    }

    /// `F' L F` in place.
    pub fn transpose_both(&self, information: &mut [[f64; STATES]; STATES]) {
        for line in information.iter_mut() {
            self.transpose(line);
        }
        let before = *information;
        for row in &self.rows {
            information[row.index] = [0.0; STATES];
        }
        for row in &self.rows {
            for (column, value) in row.entries() {
                for (x, p) in information[*column].iter_mut().zip(&before[row.index]) {
                    *x += value * p;
                }
            }
        }
    }
}
