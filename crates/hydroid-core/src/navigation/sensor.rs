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
    /// A scalar; none if the measurement is not finite.
    fn new(residual: f64, deviation: f64, entries: &[(State, f64)]) -> Option<Self> {
        let mut gradient = [0.0; STATES];
        for (state, value) in entries {
            gradient[*state as usize] += value;
        }
        residual.is_finite().then_some(Self { residual, gradient, variance: deviation * deviation })
    }
}

/// An angle in (-pi, pi].
pub(super) fn wrapped(angle: f64) -> f64 {
    angle - 2.0 * PI * Float::round(angle / (2.0 * PI))
}

/// Velocity and acceleration of a point of the body, with their derivatives by surge, sway, yaw rate and their rates.
struct Point {
    /// Body axes, through the water.
    velocity: [f64; 2],
    /// Inertial acceleration in body axes.
    acceleration: [f64; 2],
    /// Of the acceleration by u, v, r.
    by_velocity: [[f64; 3]; 2],
    /// Lever from the pivot point, forward and to starboard.
    lever: [f64; 2],
    /// Of velocity and acceleration by the place of the pivot point.
    by_pivot: [[f64; 2]; 2],
}

impl Point {
    fn new(mean: &[f64; STATES], place: Mounting) -> Self {
        let at = |state: State| mean[state as usize];
        let (u, v, r) = (at(State::Surge), at(State::Sway), at(State::YawRate));
        // The sway velocity is that of the pivot point.
        let (x, y) = (place.forward - at(State::Pivot), place.starboard);
        let turn = at(State::YawAcceleration);
        Self {
            velocity: [u - r * y, v + r * x],
            acceleration: [
                at(State::SurgeRate) - r * v - turn * y - r * r * x,
                at(State::SwayRate) + r * u + turn * x - r * r * y,
            ],
            by_velocity: [[0.0, -r, -v - 2.0 * r * x], [r, 0.0, u - 2.0 * r * y]],
            lever: [x, y],
            by_pivot: [[0.0, -r], [r * r, -turn]],
        }
    }
}

impl Measurement {
    /// The scalars of the measurement in this state; only finite values count.
    pub(super) fn scalars(&self, mean: &[f64; STATES]) -> impl Iterator<Item = Scalar> {
        let pair = match *self {
            Self::Position { value, deviation, mounting } => position(mean, value, deviation, mounting),
            Self::Velocity { value, deviation, mounting } => velocity(mean, value, deviation, mounting),
            Self::Heading { value, deviation } => {
                let states = [State::Heading, State::Misalignment, State::CompassError];
                let predicted: f64 = states.iter().map(|state| mean[*state as usize]).sum();
                let entries = states.map(|state| (state, 1.0));
                [Scalar::new(wrapped(value - predicted), deviation, &entries), None]
            }
            Self::YawRate { value, deviation } => {
                let predicted = mean[State::YawRate as usize] + mean[State::GyroBias as usize];
                let entries = [(State::YawRate, 1.0), (State::GyroBias, 1.0)];
                [Scalar::new(value - predicted, deviation, &entries), None]
            }
            Self::SpecificForce { value, deviation, mounting } => {
                specific_force(mean, value, deviation, mounting)
            }
            Self::OverGround { value, deviation, mounting } => body(mean, value, deviation, mounting, true),
            Self::ThroughWater { value, deviation, mounting } => {
                body(mean, value, deviation, mounting, false)
            }
        };
        pair.into_iter().flatten()
    }
}

fn position(mean: &[f64; STATES], value: [f64; 2], deviation: f64, place: Mounting) -> [Option<Scalar>; 2] {
    let (sine, cosine) = Float::sin_cos(mean[State::Heading as usize]);
    let point = Point::new(mean, place);
    let delay = mean[State::Delay as usize];
    let half = 0.5 * delay * delay;
    let (x, y) = (place.forward, place.starboard);
    let axis = |c: f64, s: f64, place_state, error, current, value: f64| {
        // c and s project body axes on the axis; -s and c are the derivatives of the projection by the heading, negated.
        let along = |vector: [f64; 2]| c * vector[0] + s * vector[1];
        let turned = |vector: [f64; 2]| s * vector[0] - c * vector[1];
        let ground = along(point.velocity) + mean[current as usize];
        let acceleration = along(point.acceleration);
        let predicted = mean[place_state as usize] + c * x + s * y - delay * ground
            + half * acceleration
            + mean[error as usize];
        let by = |k: usize| c * point.by_velocity[0][k] + s * point.by_velocity[1][k];
        let by_turn = s * point.lever[0] - c * point.lever[1];
        Scalar::new(
            value - predicted,
            deviation,
            &[
                (place_state, 1.0),
                (error, 1.0),
                (
                    State::Heading,
                    turned([x, y]) - delay * turned(point.velocity) + half * turned(point.acceleration),
                ),
                (State::Surge, -delay * c + half * by(0)),
                (State::Sway, -delay * s + half * by(1)),
                (State::YawRate, -delay * by_turn + half * by(2)),
                (State::Pivot, -delay * along(point.by_pivot[0]) + half * along(point.by_pivot[1])),
                (State::SurgeRate, half * c),
                (State::SwayRate, half * s),
                (State::YawAcceleration, half * by_turn),
                (current, -delay),
                (State::Delay, -ground + delay * acceleration),
            ],
        )
    };
    [
        axis(cosine, -sine, State::North, State::GnssNorth, State::CurrentNorth, value[0]),
        axis(sine, cosine, State::East, State::GnssEast, State::CurrentEast, value[1]),
    ]
}

fn velocity(mean: &[f64; STATES], value: [f64; 2], deviation: f64, place: Mounting) -> [Option<Scalar>; 2] {
    let (sine, cosine) = Float::sin_cos(mean[State::Heading as usize]);
    let point = Point::new(mean, place);
    let delay = mean[State::Delay as usize];
    let axis = |c: f64, s: f64, current, value: f64| {
        let along = |vector: [f64; 2]| c * vector[0] + s * vector[1];
        let turned = |vector: [f64; 2]| s * vector[0] - c * vector[1];
        let acceleration = along(point.acceleration);
        let predicted = along(point.velocity) + mean[current as usize] - delay * acceleration;
        let by = |k: usize| c * point.by_velocity[0][k] + s * point.by_velocity[1][k];
        let by_turn = s * point.lever[0] - c * point.lever[1];
        Scalar::new(
            value - predicted,
            deviation,
            &[
                (State::Pivot, along(point.by_pivot[0]) - delay * along(point.by_pivot[1])),
                (State::Heading, turned(point.velocity) - delay * turned(point.acceleration)),
                (State::Surge, c - delay * by(0)),
                (State::Sway, s - delay * by(1)),
                (State::YawRate, by_turn - delay * by(2)),
                (State::SurgeRate, -delay * c),
                (State::SwayRate, -delay * s),
                (State::YawAcceleration, -delay * by_turn),
                (current, 1.0),
                (State::Delay, -acceleration),
            ],
        )
    };
    [axis(cosine, -sine, State::CurrentNorth, value[0]), axis(sine, cosine, State::CurrentEast, value[1])]
}

fn specific_force(
    mean: &[f64; STATES],
    value: [f64; 2],
    deviation: [f64; 2],
    place: Mounting,
) -> [Option<Scalar>; 2] {
    let at = |state: State| mean[state as usize];
    let point = Point::new(mean, place);
    let [x, y] = point.lever;
    let [a, b] = point.by_velocity;
    let (u, r, heel) = (at(State::Surge), at(State::YawRate), at(State::Heel));
    let forward = point.acceleration[0] + at(State::ForwardBias) + at(State::WaveForward);
    let starboard =
        point.acceleration[1] + heel * u * r + at(State::StarboardBias) + at(State::WaveStarboard);
    [
        Scalar::new(
            value[0] - forward,
            deviation[0],
            &[
                (State::Surge, a[0]),
                (State::Sway, a[1]),
                (State::YawRate, a[2]),
                (State::SurgeRate, 1.0),
                (State::YawAcceleration, -y),
                (State::Pivot, point.by_pivot[1][0]),
                (State::ForwardBias, 1.0),
                (State::WaveForward, 1.0),
            ],
        ),
        Scalar::new(
            value[1] - starboard,
            deviation[1],
            &[
                (State::Surge, b[0] + heel * r),
                (State::Sway, b[1]),
                (State::YawRate, b[2] + heel * u),
                (State::SwayRate, 1.0),
                (State::YawAcceleration, x),
                (State::Pivot, point.by_pivot[1][1]),
                (State::Heel, u * r),
                (State::StarboardBias, 1.0),
                (State::WaveStarboard, 1.0),
            ],
        ),
    ]
}

fn body(
    mean: &[f64; STATES],
    value: [f64; 2],
    deviation: f64,
    place: Mounting,
    ground: bool,
) -> [Option<Scalar>; 2] {
    let at = |state: State| mean[state as usize];
    let point = Point::new(mean, place);
    let (sine, cosine) = Float::sin_cos(at(State::Heading));
    let (north, east) = (at(State::CurrentNorth), at(State::CurrentEast));
    let share = if ground { 1.0 } else { 0.0 };
    let current = [cosine * north + sine * east, -sine * north + cosine * east];
    [
        Scalar::new(
            value[0] - point.velocity[0] - share * current[0],
            deviation,
            &[
                (State::Surge, 1.0),
                (State::YawRate, -point.lever[1]),
                (State::Heading, share * current[1]),
                (State::CurrentNorth, share * cosine),
                (State::CurrentEast, share * sine),
            ],
        ),
        Scalar::new(
            value[1] - point.velocity[1] - share * current[1],
            deviation,
            &[
                (State::Sway, 1.0),
                (State::YawRate, point.lever[0]),
                (State::Pivot, point.by_pivot[0][1]),
                (State::Heading, -share * current[0]),
                (State::CurrentNorth, -share * sine),
                (State::CurrentEast, share * cosine),
            ],
        ),
    ]
}
