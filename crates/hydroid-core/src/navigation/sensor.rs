//! Measurement equations and their derivatives.

use core::f64::consts::PI;

use num_traits::Float;

use super::state::{STATES, State};

/// Position of a sensor in the body frame \[m\]: forward and to starboard of the origin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mounting {
    /// Forward of the origin.
    pub forward: f64,
    /// To starboard of the origin.
    pub starboard: f64,
}

/// A measurement with the standard deviations of its white noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measurement {
    /// Position of the GNSS antenna \[m\], late by the delay.
    Position {
        /// North and east.
        value: [f64; 2],
        /// Standard deviation of each \[m\].
        deviation: f64,
        /// Antenna.
        mounting: Mounting,
    },
    /// Velocity of the GNSS antenna over ground \[m/s\], late by the delay.
    Velocity {
        /// North and east.
        value: [f64; 2],
        /// Standard deviation of each \[m/s\].
        deviation: f64,
        /// Antenna.
        mounting: Mounting,
    },
    /// Heading of a compass \[rad\], wrapped or not.
    Heading {
        /// Clockwise from north.
        value: f64,
        /// Standard deviation \[rad\].
        deviation: f64,
    },
    /// Yaw rate of a gyro \[rad/s\].
    YawRate {
        /// Positive to starboard.
        value: f64,
        /// Standard deviation \[rad/s\].
        deviation: f64,
    },
    /// Specific force of accelerometers along the horizontal body axes \[m/s²\].
    SpecificForce {
        /// Forward and starboard.
        value: [f64; 2],
        /// Standard deviations.
        deviation: [f64; 2],
        /// Inertial unit.
        mounting: Mounting,
    },
    /// Body velocities over ground at a place \[m/s\]; NaN where only one of them is measured.
    OverGround {
        /// Forward and starboard.
        value: [f64; 2],
        /// Standard deviation of each.
        deviation: f64,
        /// Sensor.
        mounting: Mounting,
    },
    /// Body velocities through the water at a place \[m/s\]; NaN where only one of them is measured.
    ThroughWater {
        /// Forward and starboard.
        value: [f64; 2],
        /// Standard deviation of each.
        deviation: f64,
        /// Sensor.
        mounting: Mounting,
    },
}

/// A scalar measurement, linearized: residual, derivatives by the states, variance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scalar {
    pub(super) residual: f64,
    pub(super) gradient: [f64; STATES],
    pub(super) variance: f64,
}

impl Scalar {
    fn new(residual: f64, deviation: f64) -> Self {
        Self { residual, gradient: [0.0; STATES], variance: deviation * deviation }
    }

    /// No measurement.
    fn none() -> Self {
        Self::new(f64::NAN, f64::NAN)
    }

    /// Whether there is a measurement: its value is finite.
    pub(super) fn counts(&self) -> bool {
        self.residual.is_finite()
    }

    /// Adds a derivative of the predicted value by a state.
    fn by(mut self, state: State, value: f64) -> Self {
        self.gradient[state as usize] += value;
        self
    }

    /// Adds the derivatives by the states of [`MOTION`].
    fn by_motion(self, value: impl Fn(usize) -> f64) -> Self {
        MOTION.iter().enumerate().fold(self, |scalar, (i, state)| scalar.by(*state, value(i)))
    }
}

/// An angle in (-pi, pi].
pub(super) fn wrapped(angle: f64) -> f64 {
    angle - 2.0 * PI * Float::round(angle / (2.0 * PI))
}

/// Velocity and inertial acceleration of a point of the body in body axes, through the water.
struct Point {
    velocity: [f64; 2],
    acceleration: [f64; 2],
    /// Their derivatives by the states of [`MOTION`].
    by: [[[f64; MOTION.len()]; 2]; 2],
}

/// States on which the motion of a point of the body depends.
const MOTION: [State; 10] = [
    State::Surge,
    State::Sway,
    State::YawRate,
    State::LaggedYawRate,
    State::SurgeRate,
    State::SwayRate,
    State::YawAcceleration,
    State::Pivot,
    State::PivotShift,
    State::PivotSlope,
];

impl Point {
    /// `rate` is that of the lag of the yaw rate \[1/s\].
    fn new(mean: &[f64; STATES], place: Mounting, rate: f64) -> Self {
        let [u, s, r, q, u_rate, s_rate, turn, pivot, shift, slope] =
            MOTION.map(|state| mean[state as usize]);
        // The pivot point is where the turn itself causes no sway velocity.
        let (x, y) = (place.forward - pivot, place.starboard);
        let way = shift + slope * u;
        let drift = s - way * q;
        let lag = rate * (r - q);
        Self {
            velocity: [u - r * y, drift + r * x],
            acceleration: [
                u_rate - r * drift - turn * y - r * r * x,
                s_rate - way * lag - slope * u_rate * q + r * u + turn * x - r * r * y,
            ],
            by: [
                [
                    [1.0, 0.0, -y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                    [-slope * q, 1.0, x, -way, 0.0, 0.0, 0.0, -r, -q, -u * q],
                ],
                [
                    [r * slope * q, -r, -drift - 2.0 * r * x, r * way, 1.0, 0.0, -y, r * r, r * q, r * u * q],
                    [
                        r - slope * lag,
                        0.0,
                        u - 2.0 * r * y - rate * way,
                        rate * way - slope * u_rate,
                        -slope * q,
                        1.0,
                        x,
                        -turn,
                        -lag,
                        -u * lag - u_rate * q,
                    ],
                ],
            ],
        }
    }

    fn velocity_by(&self, i: usize) -> [f64; 2] {
        [self.by[0][0][i], self.by[0][1][i]]
    }

    fn acceleration_by(&self, i: usize) -> [f64; 2] {
        [self.by[1][0][i], self.by[1][1][i]]
    }
}

impl Measurement {
    /// The scalars of the measurement in this state. `rate` is that of the lag of the yaw rate.
    pub(super) fn scalars(&self, mean: &[f64; STATES], rate: f64) -> [Scalar; 2] {
        match *self {
            Self::Position { value, deviation, mounting } => position(mean, value, deviation, mounting, rate),
            Self::Velocity { value, deviation, mounting } => velocity(mean, value, deviation, mounting, rate),
            Self::Heading { value, deviation } => {
                let states = [State::Heading, State::Misalignment, State::CompassError];
                let predicted: f64 = states.iter().map(|state| mean[*state as usize]).sum();
                let scalar = Scalar::new(wrapped(value - predicted), deviation);
                [states.iter().fold(scalar, |scalar, state| scalar.by(*state, 1.0)), Scalar::none()]
            }
            Self::YawRate { value, deviation } => {
                let predicted = mean[State::YawRate as usize] + mean[State::GyroBias as usize];
                let scalar = Scalar::new(value - predicted, deviation);
                [scalar.by(State::YawRate, 1.0).by(State::GyroBias, 1.0), Scalar::none()]
            }
            Self::SpecificForce { value, deviation, mounting } => {
                specific_force(mean, value, deviation, mounting, rate)
            }
            Self::OverGround { value, deviation, mounting } => body(mean, value, deviation, mounting, true),
            Self::ThroughWater { value, deviation, mounting } => {
                body(mean, value, deviation, mounting, false)
            }
        }
    }
}

/// Component of a vector of the body frame along an axis.
fn project(axis: [f64; 2], vector: [f64; 2]) -> f64 {
    axis[0] * vector[0] + axis[1] * vector[1]
}

fn position(
    mean: &[f64; STATES],
    value: [f64; 2],
    deviation: f64,
    place: Mounting,
    rate: f64,
) -> [Scalar; 2] {
    let at = |state: State| mean[state as usize];
    let (sine, cosine) = Float::sin_cos(at(State::Heading));
    let point = Point::new(mean, place, rate);
    let delay = at(State::Delay);
    let half = 0.5 * delay * delay;
    let lever = [place.forward, place.starboard];
    // `axis` projects body axes on north or east, `turned` is its derivative by the heading.
    let scalar =
        |axis: [f64; 2], turned: [f64; 2], origin: State, error: State, current: State, value: f64| {
            let ground = project(axis, point.velocity) + at(current);
            let acceleration = project(axis, point.acceleration);
            let predicted =
                at(origin) + project(axis, lever) - delay * ground + half * acceleration + at(error);
            Scalar::new(value - predicted, deviation)
                .by(origin, 1.0)
                .by(error, 1.0)
                .by(current, -delay)
                .by(State::Delay, -ground + delay * acceleration)
                .by(
                    State::Heading,
                    project(turned, lever) - delay * project(turned, point.velocity)
                        + half * project(turned, point.acceleration),
                )
                .by_motion(|i| {
                    -delay * project(axis, point.velocity_by(i))
                        + half * project(axis, point.acceleration_by(i))
                })
        };
    [
        scalar(
            [cosine, -sine],
            [-sine, -cosine],
            State::North,
            State::GnssNorth,
            State::CurrentNorth,
            value[0],
        ),
        scalar([sine, cosine], [cosine, -sine], State::East, State::GnssEast, State::CurrentEast, value[1]),
    ]
}

fn velocity(
    mean: &[f64; STATES],
    value: [f64; 2],
    deviation: f64,
    place: Mounting,
    rate: f64,
) -> [Scalar; 2] {
    let at = |state: State| mean[state as usize];
    let (sine, cosine) = Float::sin_cos(at(State::Heading));
    let point = Point::new(mean, place, rate);
    let delay = at(State::Delay);
    let scalar = |axis: [f64; 2], turned: [f64; 2], current: State, value: f64| {
        let acceleration = project(axis, point.acceleration);
        let predicted = project(axis, point.velocity) + at(current) - delay * acceleration;
        Scalar::new(value - predicted, deviation)
            .by(current, 1.0)
            .by(State::Delay, -acceleration)
            .by(State::Heading, project(turned, point.velocity) - delay * project(turned, point.acceleration))
            .by_motion(|i| {
                project(axis, point.velocity_by(i)) - delay * project(axis, point.acceleration_by(i))
            })
    };
    [
        scalar([cosine, -sine], [-sine, -cosine], State::CurrentNorth, value[0]),
        scalar([sine, cosine], [cosine, -sine], State::CurrentEast, value[1]),
    ]
}

fn specific_force(
    mean: &[f64; STATES],
    value: [f64; 2],
    deviation: [f64; 2],
    place: Mounting,
    rate: f64,
) -> [Scalar; 2] {
    let at = |state: State| mean[state as usize];
    let point = Point::new(mean, place, rate);
    let origin = Point::new(mean, Mounting::default(), rate);
    let heel = at(State::Heel);
    let forward = point.acceleration[0] + at(State::ForwardBias) + at(State::WaveForward);
    let starboard = point.acceleration[1]
        + heel * origin.acceleration[1]
        + at(State::StarboardBias)
        + at(State::WaveStarboard);
    [
        Scalar::new(value[0] - forward, deviation[0])
            .by_motion(|i| point.by[1][0][i])
            .by(State::ForwardBias, 1.0)
            .by(State::WaveForward, 1.0),
        Scalar::new(value[1] - starboard, deviation[1])
            .by_motion(|i| point.by[1][1][i] + heel * origin.by[1][1][i])
            .by(State::Heel, origin.acceleration[1])
            .by(State::StarboardBias, 1.0)
            .by(State::WaveStarboard, 1.0),
    ]
}

fn body(mean: &[f64; STATES], value: [f64; 2], deviation: f64, place: Mounting, ground: bool) -> [Scalar; 2] {
    let at = |state: State| mean[state as usize];
    // The rate concerns accelerations alone.
    let point = Point::new(mean, place, 0.0);
    let (sine, cosine) = Float::sin_cos(at(State::Heading));
    let (north, east) = (at(State::CurrentNorth), at(State::CurrentEast));
    let share = if ground { 1.0 } else { 0.0 };
    let current = [cosine * north + sine * east, -sine * north + cosine * east];
    let scalar = |k: usize, turned: f64, axis: [f64; 2]| {
        Scalar::new(value[k] - point.velocity[k] - share * current[k], deviation)
            .by_motion(|i| point.by[0][k][i])
            .by(State::Heading, share * turned)
            .by(State::CurrentNorth, share * axis[0])
            .by(State::CurrentEast, share * axis[1])
    };
    [scalar(0, current[1], [cosine, sine]), scalar(1, -current[0], [-sine, cosine])]
}
