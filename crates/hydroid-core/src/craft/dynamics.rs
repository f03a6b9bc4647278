//! Equations of motion of a craft.

use alloc::vec::Vec;
use core::f64::consts::FRAC_PI_4;

use super::servo::Servo;
use super::{Craft, Hull, Rudder, ThrustLaw, Thruster};
use crate::vessel::{Number, Real};

/// Largest number of moving positions of a craft: orders of thrusters, their steering, rudders.
pub const MAX_SERVOS: usize = 16;

/// A craft compiled for integration. The state is the velocity `nu` and the position of each servo: for each thruster its
/// order and, if there is one, its steering, then for each rudder its angle.
#[derive(Clone, Debug, PartialEq)]
pub struct Dynamics<T = f64> {
    /// `m11`, `m22`, `m23`.
    mass: [T; 3],
    /// Inverse of the mass matrix: entries 11, 22, 23, 33.
    inverse: [T; 4],
    /// Row, column and value of the entries of the damping that are not zero.
    linear: Vec<(usize, usize, T)>,
    quadratic: Vec<(usize, usize, T)>,
    lift: Vec<(usize, usize, T)>,
    /// `1/2 rho T C_d`.
    cross_flow: T,
    half_length: f64,
    half_density: f64,
    servos: Vec<Servo<T>>,
    thrusters: Vec<Thruster<T>>,
    /// Sine and cosine of the angle of each thruster.
    directions: Vec<(T, T)>,
    rudders: Vec<Rudder<T>>,
}

impl<T: Real> Dynamics<T> {
    /// Compiles a craft. Its numbers are not checked; see [`Craft::validate`](super::Craft::validate).
    ///
    /// # Panics
    /// If there are more than [`MAX_SERVOS`] servos.
    pub fn new(craft: &Craft<T>) -> Self {
        let hull = craft.hull;
        let [m11, m22, m23, m33] = hull.mass_matrix();
        let [length, _, draught] = hull.size.unwrap_or([0.0; 3]);
        let mut servos = Vec::new();
        for thruster in &craft.thrusters {
            servos.push(thruster.servo.clone());
            servos.extend(thruster.steering.clone());
        }
        servos.extend(craft.rudders.iter().map(|rudder| rudder.servo.clone()));
        assert!(servos.len() <= MAX_SERVOS, "at most {MAX_SERVOS} servos");
        let determinant = m22 * m33 - m23 * m23;
        Self {
            mass: [m11, m22, m23],
            inverse: [T::constant(1.0) / m11, m33 / determinant, -m23 / determinant, m22 / determinant],
            linear: entries(&hull.linear, 0),
            quadratic: entries(&hull.quadratic, 0),
            lift: entries(&hull.lift, 1),
            cross_flow: hull.cross_flow * (0.5 * craft.water_density * draught),
            half_length: 0.5 * length,
            half_density: 0.5 * craft.water_density,
            servos,
            thrusters: craft.thrusters.clone(),
            directions: craft.thrusters.iter().map(|thruster| thruster.angle.sin_cos()).collect(),
            rudders: craft.rudders.clone(),
        }
    }

    /// Number of servos.
    pub fn servos(&self) -> usize {
        self.servos.len()
    }

    /// The shortest lag of a servo \[s\]; infinite if there is none.
    pub fn shortest_lag(&self) -> f64 {
        let lags = self.servos.iter().map(|servo| servo.lag.value());
        lags.filter(|lag| *lag > 0.0).fold(f64::INFINITY, f64::min)
    }

    /// Writes the positions that hold a row of commands.
    pub fn settle(&self, commands: &[f64], positions: &mut [T]) {
        for (position, servo) in positions.iter_mut().zip(&self.servos) {
            *position = T::constant(servo.order.value(commands));
        }
    }

    /// Moves the positions through `h` seconds with the commands held.
    pub fn move_servos(&self, positions: &mut [T], commands: &[f64], h: f64) {
        for (position, servo) in positions.iter_mut().zip(&self.servos) {
            *position = servo.step(*position, servo.order.value(commands), h, servo.decay(h));
        }
    }

    /// Integrates velocity and positions over `steps` steps of `h` seconds with the commands held: positions exactly,
    /// velocities by the classical Runge-Kutta method of order 4.
    pub fn advance(&self, nu: &mut [T; 3], positions: &mut [T], commands: &[f64], h: f64, steps: usize) {
        let count = self.servos.len();
        let half = 0.5 * h;
        let mut held = [(0.0, T::constant(0.0)); MAX_SERVOS];
        for (held, servo) in held.iter_mut().zip(&self.servos) {
            *held = (servo.order.value(commands), servo.decay(half));
        }
        let move_half = |positions: &mut [T; MAX_SERVOS]| {
            for ((position, servo), (order, decay)) in positions.iter_mut().zip(&self.servos).zip(held) {
                *position = servo.step(*position, order, half, decay);
            }
        };
        let mut at = [T::constant(0.0); MAX_SERVOS];
        at[..count].copy_from_slice(&positions[..count]);
        // A position that follows at once is at its order from the first stage on.
        for ((position, servo), (order, _)) in at.iter_mut().zip(&self.servos).zip(held) {
            if servo.follows_at_once() {
                *position = T::constant(order);
            }
        }
        for _ in 0..steps {
            let along = |k: &[T; 3], a: f64| -> [T; 3] { core::array::from_fn(|i| nu[i] + k[i] * a) };
            let k1 = self.acceleration(*nu, &at[..count]);
            move_half(&mut at);
            let k2 = self.acceleration(along(&k1, half), &at[..count]);
            let k3 = self.acceleration(along(&k2, half), &at[..count]);
            move_half(&mut at);
            let k4 = self.acceleration(along(&k3, h), &at[..count]);
            let sixth = h / 6.0;
            *nu = core::array::from_fn(|i| nu[i] + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * sixth);
        }
        positions[..count].copy_from_slice(&at[..count]);
    }

    /// `dnu/dt` \[m/s^2, m/s^2, rad/s^2\] at positions of the servos.
    #[inline]
    pub fn acceleration(&self, nu: [T; 3], positions: &[T]) -> [T; 3] {
        let [m11, m22, m23] = self.mass;
        let [u, v, r] = nu;
        let damping = self.damping(nu);
        let applied = self.actuators(nu, positions);
        let x = applied[0] - damping[0] + (m22 * v + m23 * r) * r;
        let y = applied[1] - damping[1] - m11 * u * r;
        let n = applied[2] - damping[2] - (m22 - m11) * u * v - m23 * u * r;
        let [i11, i22, i23, i33] = self.inverse;
        [i11 * x, i22 * y + i23 * n, i23 * y + i33 * n]
    }

    /// Damping forces `D(nu) nu` \[N, N, N m\].
    #[inline]
    pub fn damping(&self, nu: [T; 3]) -> [T; 3] {
        let [u, v, r] = nu;
        let mut force = [T::constant(0.0); 3];
        for &(i, j, value) in &self.linear {
            force[i] = force[i] + value * nu[j];
        }
        for &(i, j, value) in &self.quadratic {
            force[i] = force[i] + value * nu[j].abs() * nu[j];
        }
        for &(i, j, value) in &self.lift {
            force[i] = force[i] + value * u.abs() * nu[j];
        }
        if self.half_length > 0.0 && self.cross_flow.value() > 0.0 {
            let [side, moment] = self.cross_flow_integrals(v, r);
            force[1] = force[1] + self.cross_flow * side;
            force[2] = force[2] + self.cross_flow * moment;
        }
        force
    }

    /// Integrals of `|w| w` and `x |w| w` over the hull, `w = v + x r`: exact, by parts without change of sign.
    #[inline]
    fn cross_flow_integrals(&self, v: T, r: T) -> [T; 2] {
        let l = self.half_length;
        if Number::abs(v.value()) >= Number::abs(r.value()) * l {
            // v^2 + 2 x v r + x^2 r^2 over the whole length.
            let cubed = 2.0 * l * l * l / 3.0;
            let side = if v.value() < 0.0 { -1.0 } else { 1.0 };
            return [(v * v * (2.0 * l) + r * r * cubed) * side, v * r * (2.0 * cubed * side)];
        }
        // The primitives of |w| w and w |w| w over w, with x = (w - v) / r.
        let (fore, aft) = (v + r * l, v - r * l);
        let cube = |w: T| w * w * w.abs();
        let force = (cube(fore) - cube(aft)) / (r * 3.0);
        let fourth = (cube(fore) * fore - cube(aft) * aft) / (r * r * 4.0);
        [force, fourth - v * force / r]
    }

    /// Force of all actuators \[N, N, N m\].
    #[inline]
    fn actuators(&self, nu: [T; 3], positions: &[T]) -> [T; 3] {
        let zero = T::constant(0.0);
        let mut tau = [zero; 3];
        let mut thrusts = [(zero, zero); MAX_SERVOS];
        let mut place = 0;
        for ((thruster, &direction), slot) in self.thrusters.iter().zip(&self.directions).zip(&mut thrusts) {
            let order = positions[place];
            place += 1;
            let (sin, cos) = if thruster.steering.is_some() {
                place += 1;
                (thruster.angle + positions[place - 1]).sin_cos()
            } else {
                direction
            };
            let [x, y] = thruster.position;
            let advance = (nu[0] - y * nu[2]) * cos + (nu[1] + x * nu[2]) * sin;
            let thrust = thruster.thrust(order, advance);
            *slot = (thrust, advance);
            tau[0] = tau[0] + thrust * cos;
            tau[1] = tau[1] + thrust * sin;
            tau[2] = tau[2] + thrust * (x * sin - y * cos);
        }
        for (rudder, &angle) in self.rudders.iter().zip(&positions[place..]) {
            let race = rudder.thruster.map(|of| (thrusts[of], self.thrusters[of].diameter.unwrap_or(0.0)));
            let force = rudder.force(nu, angle, race, self.half_density);
            for (sum, part) in tau.iter_mut().zip(force) {
                *sum = *sum + part;
            }
        }
        tau
    }
}

/// Row, column and value of the entries that are not zero; rows and columns are counted from `first`.
fn entries<T: Real, const N: usize>(matrix: &[[T; N]; N], first: usize) -> Vec<(usize, usize, T)> {
    let all = matrix
        .iter()
        .enumerate()
        .flat_map(|(i, row)| row.iter().enumerate().map(move |(j, value)| (first + i, first + j, *value)));
    all.filter(|(_, _, value)| value.value() != 0.0).collect()
}

impl<T: Real> Hull<T> {
    /// Mass matrix as `[m11, m22, m23, m33]`.
    pub fn mass_matrix(&self) -> [T; 4] {
        [
            self.mass - self.x_udot,
            self.mass - self.y_vdot,
            self.mass * self.x_g - self.y_rdot,
            self.i_z - self.n_rdot,
        ]
    }
}

impl<T: Real> Thruster<T> {
    /// Thrust \[N\] at an order and a speed of advance \[m/s\].
    #[inline]
    fn thrust(&self, order: T, advance: T) -> T {
        let size = order.abs();
        if size.value() <= self.dead_band {
            return T::constant(0.0);
        }
        let n = size - T::constant(self.dead_band);
        let ahead = order.value() > 0.0;
        let gain = if ahead { self.forward } else { -self.reverse };
        let static_thrust = match self.law {
            ThrustLaw::Quadratic => gain * n * n,
            ThrustLaw::Linear => gain * n,
        };
        static_thrust - self.speed_loss * n * advance
    }
}

impl<T: Real> Rudder<T> {
    /// Force \[N, N, N m\] at an angle; `race` are thrust, speed of advance and diameter of the thruster ahead of it.
    #[inline]
    fn force(&self, nu: [T; 3], angle: T, race: Option<((T, T), f64)>, half_density: f64) -> [T; 3] {
        let [x, y] = self.position;
        let one = T::constant(1.0);
        let mut u = (nu[0] - y * nu[2]) * (one - self.wake);
        if let Some(((thrust, advance), diameter)) = race
            && thrust.value() > 0.0
        {
            let disc = FRAC_PI_4 * diameter * diameter;
            let behind = (advance * advance + thrust * (1.0 / (half_density * disc))).sqrt();
            u = u + self.race * (behind - advance.abs());
        }
        let v = (nu[1] + x * nu[2]) * self.straightening;
        let (sin, cos) = angle.sin_cos();
        let speed = (u * u + v * v).sqrt();
        let normal = self.lift_slope * (half_density * self.area) * speed * (u * sin + v * cos);
        let along = -normal * (one - self.drag_deduction) * sin;
        let aside = -normal * cos;
        [
            along,
            aside * (one + self.hull_force),
            aside * (x + self.hull_force * self.hull_position) - y * along,
        ]
    }
}
