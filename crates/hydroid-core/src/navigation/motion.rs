//! Transition of the states over a time, and its noise.

use num_traits::Float;

use super::state::{STATES, State};

/// Statistics of motion, waves and sensor errors. All are standard deviations, rates or times that a likelihood can
/// estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Noise {
    /// Rate of the surge acceleration \[1/s\].
    pub surge_rate: f64,
    /// Standard deviation of the surge acceleration \[m/s²\].
    pub surge_acceleration: f64,
    /// Rate of the sway velocity \[1/s\].
    pub sway_rate: f64,
    /// Standard deviation of the sway velocity that the yaw rate does not cause \[m/s\].
    pub sway: f64,
    /// Rate at which the pivot point approaches its place in a steady turn \[1/s\].
    pub pivot_rate: f64,
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

impl Noise {
    /// All statistics, in the order of the fields.
    pub fn numbers(&self) -> [f64; 18] {
        [
            self.surge_rate,
            self.surge_acceleration,
            self.sway_rate,
            self.sway,
            self.pivot_rate,
            self.yaw_rate,
            self.yaw,
            self.wave_frequency,
            self.wave_damping,
            self.wave_forward,
            self.wave_starboard,
            self.gnss_rate,
            self.gnss,
            self.compass_rate,
            self.compass,
            self.gyro_walk,
            self.accelerometer_walk,
            self.current_walk,
        ]
    }

    /// The rate of the process of a state.
    pub(super) fn rate(&mut self, state: State) -> Option<&mut f64> {
        match state {
            State::Surge | State::SurgeRate => Some(&mut self.surge_rate),
            State::Sway | State::SwayRate => Some(&mut self.sway_rate),
            State::YawRate | State::YawAcceleration => Some(&mut self.yaw_rate),
            State::North | State::East | State::LaggedYawRate => Some(&mut self.pivot_rate),
            State::CompassError => Some(&mut self.compass_rate),
            State::GnssNorth | State::GnssEast => Some(&mut self.gnss_rate),
            _ => self.damping(state).is_some().then_some(&mut self.wave_frequency),
        }
    }

    /// The damping of the process of a state.
    pub(super) fn damping(&mut self, state: State) -> Option<&mut f64> {
        let wave = matches!(
            state,
            State::WaveForwardIntegral
                | State::WaveForward
                | State::WaveStarboardIntegral
                | State::WaveStarboard
        );
        wave.then_some(&mut self.wave_damping)
    }

    /// The standard deviation of the process of a state.
    pub(super) fn amplitude(&mut self, state: State) -> Option<&mut f64> {
        Some(match state {
            State::Surge | State::SurgeRate => &mut self.surge_acceleration,
            State::Sway | State::SwayRate => &mut self.sway,
            State::YawRate | State::YawAcceleration | State::LaggedYawRate => &mut self.yaw,
            State::WaveForwardIntegral | State::WaveForward => &mut self.wave_forward,
            State::WaveStarboardIntegral | State::WaveStarboard => &mut self.wave_starboard,
            State::CompassError => &mut self.compass,
            State::GnssNorth | State::GnssEast => &mut self.gnss,
            State::GyroBias => &mut self.gyro_walk,
            State::ForwardBias | State::StarboardBias => &mut self.accelerometer_walk,
            State::CurrentNorth | State::CurrentEast => &mut self.current_walk,
            _ => return None,
        })
    }

    /// All rates times a factor.
    pub(super) fn with_rates(&self, factor: f64) -> Self {
        Self {
            surge_rate: factor * self.surge_rate,
            sway_rate: factor * self.sway_rate,
            pivot_rate: factor * self.pivot_rate,
            yaw_rate: factor * self.yaw_rate,
            wave_frequency: factor * self.wave_frequency,
            gnss_rate: factor * self.gnss_rate,
            compass_rate: factor * self.compass_rate,
            ..*self
        }
    }

    /// The damping times a factor.
    pub(super) fn with_damping(&self, factor: f64) -> Self {
        Self { wave_damping: factor * self.wave_damping, ..*self }
    }
}

/// Linearized transition `x <- F x` over a time: the entries of `F` that differ from those of the identity, and the
/// covariance of the noise.
#[derive(Clone, Debug)]
pub struct Transition {
    /// Of [`ROWS`].
    entries: [f64; ENTRIES],
    /// Of [`BLOCKS`].
    noise: [[f64; 3]; BLOCKS.len()],
}

/// The rows of `F` that differ from those of the identity, with the columns of their entries.
const ROWS: [(State, &[State]); 17] = {
    use State as S;
    const PLACE: [State; 13] = [
        S::North,
        S::Heading,
        S::YawRate,
        S::YawAcceleration,
        S::LaggedYawRate,
        S::Pivot,
        S::PivotShift,
        S::PivotSlope,
        S::Surge,
        S::SurgeRate,
        S::Sway,
        S::SwayRate,
        S::CurrentNorth,
    ];
    const NORTH: [State; 13] = PLACE;
    const EAST: [State; 13] = {
        let mut east = PLACE;
        east[0] = S::East;
        east[12] = S::CurrentEast;
        east
    };
    [
        (S::North, &NORTH),
        (S::East, &EAST),
        (S::Heading, &[S::Heading, S::YawRate, S::YawAcceleration]),
        (S::Surge, &[S::Surge, S::SurgeRate]),
        (S::SurgeRate, &[S::SurgeRate]),
        (S::Sway, &[S::Sway, S::SwayRate]),
        (S::SwayRate, &[S::Sway, S::SwayRate]),
        (S::YawRate, &[S::YawRate, S::YawAcceleration]),
        (S::YawAcceleration, &[S::YawRate, S::YawAcceleration]),
        (S::LaggedYawRate, &[S::LaggedYawRate, S::YawRate, S::YawAcceleration]),
        (S::CompassError, &[S::CompassError]),
        (S::GnssNorth, &[S::GnssNorth]),
        (S::GnssEast, &[S::GnssEast]),
        (S::WaveForwardIntegral, &[S::WaveForwardIntegral, S::WaveForward]),
        (S::WaveForward, &[S::WaveForwardIntegral, S::WaveForward]),
        (S::WaveStarboardIntegral, &[S::WaveStarboardIntegral, S::WaveStarboard]),
        (S::WaveStarboard, &[S::WaveStarboardIntegral, S::WaveStarboard]),
    ]
};
/// The first rows of [`ROWS`], whose entries change with the state.
pub(super) const CURVED: usize = 2;
/// Number of rows.
pub(super) const CHANGED: usize = ROWS.len();
const ENTRIES: usize = {
    let (mut sum, mut row) = (0, 0);
    while row < ROWS.len() {
        sum += ROWS[row].1.len();
        row += 1;
    }
    sum
};

/// States of the blocks of the covariance of the noise; a block of one state names it twice.
pub(super) const BLOCKS: [(State, State); 13] = {
    use State as S;
    [
        (S::Surge, S::SurgeRate),
        (S::Sway, S::SwayRate),
        (S::YawRate, S::YawAcceleration),
        (S::WaveForwardIntegral, S::WaveForward),
        (S::WaveStarboardIntegral, S::WaveStarboard),
        (S::GyroBias, S::GyroBias),
        (S::ForwardBias, S::ForwardBias),
        (S::StarboardBias, S::StarboardBias),
        (S::CompassError, S::CompassError),
        (S::GnssNorth, S::GnssNorth),
        (S::GnssEast, S::GnssEast),
        (S::CurrentNorth, S::CurrentNorth),
        (S::CurrentEast, S::CurrentEast),
    ]
};

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
    /// Of the lag of the yaw rate.
    lag: f64,
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
            lag: Float::exp(-noise.pivot_rate * dt),
        }
    }

    /// Covariance of the noise, for the states of [`BLOCKS`].
    fn noise(&self, of: &Noise, dt: f64) -> [[f64; 3]; BLOCKS.len()] {
        let Self { decay, sway: sway_step, yaw: yaw_step, wave, gnss, compass, .. } = *self;
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
        let single = |variance: f64| [variance, 0.0, 0.0];
        let wave_noise = |amplitude: f64| {
            stationary(wave, square(amplitude / of.wave_frequency), square(of.wave_frequency))
        };
        let gnss_noise = single(square(of.gnss) * (1.0 - gnss * gnss));
        let accelerometer = single(square(of.accelerometer_walk) * dt);
        let current = single(square(of.current_walk) * dt);
        [
            surge_noise,
            stationary(sway_step, square(of.sway), square(of.sway_rate)),
            stationary(yaw_step, square(of.yaw), square(of.yaw_rate)),
            wave_noise(of.wave_forward),
            wave_noise(of.wave_starboard),
            single(square(of.gyro_walk) * dt),
            accelerometer,
            accelerometer,
            single(square(of.compass) * (1.0 - compass * compass)),
            gnss_noise,
            gnss_noise,
            current,
            current,
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
        let (pivot, slope) = (at(S::Pivot), at(S::PivotSlope));
        let shift = at(S::PivotShift) + slope * surge;

        let steps = Steps::new(noise, dt);
        let Steps { decay, sway: sway_step, yaw: yaw_step, wave, gnss, compass, lag } = steps;
        let reach = (1.0 - decay) / noise.surge_rate;
        // The lag follows a yaw rate that changes linearly.
        let ramp = dt - (1.0 - lag) / noise.pivot_rate;
        let midway = Float::sqrt(lag);
        let lagged = midway * at(S::LaggedYawRate) + (1.0 - midway) * at(S::YawRate);

        let sway = at(S::Sway) + 0.5 * dt * at(S::SwayRate) - pivot * turn - shift * lagged;
        let (along, across) = (cosine * surge - sine * sway, sine * surge + cosine * sway);
        let half = 0.5 * dt * dt;

        let place = |by_heading: f64, by_surge: f64, by_sway: f64| {
            let by_surge = by_surge - by_sway * slope * lagged;
            [
                1.0,
                dt * by_heading,
                half * by_heading - dt * by_sway * (pivot + shift * (1.0 - midway)),
                -half * by_sway * pivot,
                -dt * by_sway * shift * midway,
                -dt * by_sway * turn,
                -dt * by_sway * lagged,
                -dt * by_sway * surge * lagged,
                dt * by_surge,
                half * by_surge,
                dt * by_sway,
                half * by_sway,
                dt,
            ]
        };
        let mut entries = [0.0; ENTRIES];
        let mut filled = 0;
        for row in [
            &place(-across, cosine, -sine)[..],
            &place(along, sine, cosine),
            &[1.0, dt, half],
            &[1.0, reach],
            &[decay],
            &sway_step,
            &yaw_step,
            &[lag, 1.0 - lag, ramp],
            &[compass, gnss, gnss],
            &wave,
            &wave,
        ] {
            entries[filled..filled + row.len()].copy_from_slice(row);
            filled += row.len();
        }
        let out = Self { entries, noise: steps.noise(noise, dt) };

        let before = *mean;
        for (state, columns, values) in out.rows().skip(CURVED) {
            mean[state as usize] =
                columns.iter().zip(values).map(|(column, value)| value * before[*column as usize]).sum();
        }
        // The position is not linear in the heading.
        mean[S::North as usize] = before[0] + dt * (along + before[S::CurrentNorth as usize]);
        mean[S::East as usize] = before[1] + dt * (across + before[S::CurrentEast as usize]);
        out
    }

    /// State, columns and entries of the rows that differ from those of the identity.
    pub(super) fn rows(&self) -> impl Iterator<Item = (State, &'static [State], &[f64])> {
        let mut rest = &self.entries[..];
        ROWS.iter().map(move |(state, columns)| {
            let (values, after) = rest.split_at(columns.len());
            rest = after;
            (*state, *columns, values)
        })
    }

    /// Covariance of the noise, for the states of [`BLOCKS`].
    pub(super) fn noise(&self) -> &[[f64; 3]; BLOCKS.len()] {
        &self.noise
    }

    /// `F P`.
    pub(super) fn times(&self, covariance: &[[f64; STATES]; STATES], out: &mut [[f64; STATES]; STATES]) {
        *out = *covariance;
        for (state, columns, values) in self.rows() {
            let line = &mut out[state as usize];
            *line = [0.0; STATES];
            for (column, value) in columns.iter().zip(values) {
                for (x, p) in line.iter_mut().zip(&covariance[*column as usize]) {
                    *x += value * p;
                }
            }
        }
    }

    /// Adds `F x`.
    pub(super) fn add_product(&self, vector: &[f64; STATES], out: &mut [f64; STATES]) {
        for (state, columns, values) in self.rows() {
            let product: f64 =
                columns.iter().zip(values).map(|(column, value)| value * vector[*column as usize]).sum();
            // The row of the identity is added below.
            out[state as usize] += product - vector[state as usize];
        }
        for (x, y) in out.iter_mut().zip(vector) {
            *x += y;
        }
    }

    /// `F P F' + Q` in place.
    pub fn propagate(&self, covariance: &mut [[f64; STATES]; STATES]) {
        let mut product = [[0.0; STATES]; STATES];
        self.times(covariance, &mut product);
        *covariance = product;
        for (line, before) in covariance.iter_mut().zip(&product) {
            for (state, columns, values) in self.rows() {
                line[state as usize] =
                    columns.iter().zip(values).map(|(column, value)| value * before[*column as usize]).sum();
            }
        }
        for ((first, second), block) in BLOCKS.iter().zip(&self.noise) {
            let (i, j) = (*first as usize, *second as usize);
            covariance[i][i] += block[0];
            if i != j {
                covariance[i][j] += block[1];
                covariance[j][i] += block[1];
                covariance[j][j] += block[2];
            }
        }
    }

    /// `F' l` in place.
    pub fn transpose(&self, adjoint: &mut [f64; STATES]) {
        let before = *adjoint;
        for (state, ..) in &ROWS {
            adjoint[*state as usize] = 0.0;
        }
        for (state, columns, values) in self.rows() {
            for (column, value) in columns.iter().zip(values) {
                adjoint[*column as usize] += value * before[state as usize];
            }
        }
    }

    /// `F' L F` in place.
    pub fn transpose_both(&self, information: &mut [[f64; STATES]; STATES]) {
        for line in information.iter_mut() {
            self.transpose(line);
        }
        let before = *information;
        for (state, ..) in &ROWS {
            information[*state as usize] = [0.0; STATES];
        }
        for (state, columns, values) in self.rows() {
            for (column, value) in columns.iter().zip(values) {
                for (x, p) in information[*column as usize].iter_mut().zip(&before[state as usize]) {
                    *x += value * p;
                }
            }
        }
    }
}
