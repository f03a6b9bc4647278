//! States and their prior.

/// Number of states.
pub const STATES: usize = 28;

/// Index of a state in the estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(usize)]
pub enum State {
    /// Position north \[m\] of the origin of the body frame.
    #[default]
    North,
    /// Position east \[m\].
    East,
    /// Heading \[rad\], not wrapped.
    Heading,
    /// Surge velocity through the water \[m/s\].
    Surge,
    /// Part of the sway velocity through the water \[m/s\] that the yaw rate does not cause.
    Sway,
    /// Yaw rate \[rad/s\].
    YawRate,
    /// Yaw rate behind a lag of first order \[rad/s\].
    LaggedYawRate,
    /// Derivative of the surge velocity \[m/s²\].
    SurgeRate,
    /// Its derivative \[m/s²\].
    SwayRate,
    /// Derivative of the yaw rate \[rad/s²\].
    YawAcceleration,
    /// Bias of the gyro \[rad/s\].
    GyroBias,
    /// Correlated error of the compass \[rad\].
    CompassError,
    /// Misalignment of the compass \[rad\]: measured minus true heading.
    Misalignment,
    /// Bias of the forward accelerometer \[m/s²\].
    ForwardBias,
    /// Bias of the starboard accelerometer \[m/s²\].
    StarboardBias,
    /// Pivot point at the beginning of a turn, forward of the origin \[m\]: the point without sway velocity.
    Pivot,
    /// Way of the pivot point to its place in a steady turn, forward, at low speed \[m\].
    PivotShift,
    /// Increase of this way with the surge velocity \[s\].
    PivotSlope,
    /// Heel: the part of the lateral acceleration of the origin that gravity adds to the starboard accelerometer.
    Heel,
    /// Correlated error of the GNSS position north \[m\].
    GnssNorth,
    /// Correlated error of the GNSS position east \[m\].
    GnssEast,
    /// Current to the north \[m/s\].
    CurrentNorth,
    /// Current to the east \[m/s\].
    CurrentEast,
    /// Integral of the forward specific force by waves \[m/s\].
    WaveForwardIntegral,
    /// Forward specific force by waves \[m/s²\].
    WaveForward,
    /// Integral of the starboard specific force by waves \[m/s\].
    WaveStarboardIntegral,
    /// Starboard specific force by waves \[m/s²\].
    WaveStarboard,
    /// Age of a GNSS fix at its stamp \[s\].
    Delay,
}

/// Mean and covariance of the states.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Mean.
    pub mean: [f64; STATES],
    /// Covariance, symmetric.
    pub covariance: [[f64; STATES]; STATES],
}

impl Estimate {
    /// Mean of a state.
    pub fn get(&self, state: State) -> f64 {
        self.mean[state as usize]
    }

    /// Variance of a state.
    pub fn variance(&self, state: State) -> f64 {
        self.covariance[state as usize][state as usize]
    }
}

/// Independent states before the first measurement. A standard deviation of zero fixes a state.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// Means.
    pub mean: [f64; STATES],
    /// Standard deviations.
    pub deviation: [f64; STATES],
    /// Values of constant states at which motion and measurements are linearized; NaN for the estimate. A filter with wide
    /// priors of constants that multiply other states is linearized far from them at first, and can converge to wrong
    /// values.
    pub linearized: [f64; STATES],
}

impl Default for Prior {
    /// At rest in the origin, with the errors of usual sensors and no current.
    fn default() -> Self {
        let mut deviation = [0.0; STATES];
        for (state, value) in [
            (State::North, 10.0),
            (State::East, 10.0),
            (State::Heading, 0.2),
            (State::Surge, 5.0),
            (State::GyroBias, 0.02),
            (State::Misalignment, 0.05),
            (State::ForwardBias, 0.5),
            (State::StarboardBias, 0.5),
            (State::Pivot, 100.0),
            (State::PivotShift, 100.0),
            (State::PivotSlope, 30.0),
            (State::Heel, 2.0),
            (State::Delay, 0.3),
        ] {
            deviation[state as usize] = value;
        }
        let mut mean = [0.0; STATES];
        mean[State::Delay as usize] = 0.2;
        Self { mean, deviation, linearized: [f64::NAN; STATES] }
    }
}

impl Prior {
    /// Another mean and standard deviation of a state.
    pub fn with(mut self, state: State, mean: f64, deviation: f64) -> Self {
        self.mean[state as usize] = mean;
        self.deviation[state as usize] = deviation;
        self
    }

    /// Linearizes at a value of a constant state, which is its mean, too.
    pub fn linearized_at(mut self, state: State, value: f64) -> Self {
        self.mean[state as usize] = value;
        self.linearized[state as usize] = value;
        self
    }
}
