//! Equations of motion of a craft.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use alloc::vec::Vec;
use core::f64::consts::FRAC_PI_4;

use num_traits::Float;

use super::motion::HullMotion;
use super::servo::Servo;
use super::{Craft, Hull, NormalForce, RudderLaw, ThrustLaw};
use crate::vessel::kinematics::pose_rate;
use crate::vessel::{Number, Real};

/// Largest number of moving positions of a craft: orders of thrusters, their steering, rudders.
pub const MAX_SERVOS: usize = 16;

/// A craft compiled for integration. The state is the velocity `nu` and the position of each servo: for each thruster its
/// order and, if there is one, its steering, then for each rudder its angle.
#[derive(Clone, Debug, PartialEq)]
pub struct Dynamics<T = f64> {
    pub(super) motion: HullMotion<T>,
    half_density: f64,
    pub(super) servos: Vec<Servo<T>>,
    /// The angle to which the position of each servo adds; none where it is no angle.
    angles: Vec<Option<T>>,
    pub(super) thrusters: Vec<CompiledThruster<T>>,
    /// Whether thrust is lost with the speed of advance.
    pub(super) loses: bool,
    /// Place among the servos, and gain, of rudders that are a yaw moment.
    pub(super) moments: Vec<(usize, T)>,
    /// Place among the servos, and law, of rudders in the flow.
    rudders: Vec<(usize, NormalForce<T>)>,
}

/// Pose and motion of a vessel.
#[derive(Clone, Debug, PartialEq)]
pub struct Posed {
    /// Position north and east, heading clockwise from north, not wrapped \[m, m, rad\].
    pub eta: [f64; 3],
    /// Velocities through the water.
    pub nu: [f64; 3],
    /// Positions of the servos.
    pub positions: Vec<f64>,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct CompiledThruster<T> {
    law: ThrustLaw,
    dead_band: f64,
    forward: T,
    reverse: T,
    speed_loss: T,
    position: [T; 2],
    /// Force and moment of a unit of thrust; `None` if it is steered.
    pub(super) direction: Option<[T; 3]>,
    diameter: f64,
    /// Place among the servos; the steering follows.
    pub(super) order: usize,
}

/// Position of a servo; sine and cosine of its angle, if it is one.
#[derive(Clone, Copy)]
struct Position<T> {
    value: T,
    sin: T,
    cos: T,
}

/// A force that is affine in the velocity: `force - slope nu + [0, 0, moment u]`.
#[derive(Clone, Copy)]
pub(super) struct AffineForce<T> {
    pub(super) force: [T; 3],
    /// Loss of thrust with the speed of advance.
    pub(super) slope: [[T; 3]; 3],
    /// Yaw moment per surge velocity.
    pub(super) moment: T,
}

/// Positions of the servos, and the force of the actuators there.
struct Held<T> {
    at: [Position<T>; MAX_SERVOS],
    affine: AffineForce<T>,
}

impl<T: Number> AffineForce<T> {
    /// The force at a velocity \[N, N, N m\].
    #[inline(always)]
    pub(super) fn at(&self, nu: [T; 3], loses: bool) -> [T; 3] {
        let mut force = self.force;
        if loses {
            for (force, slope) in force.iter_mut().zip(&self.slope) {
                *force = *force - (slope[0] * nu[0] + slope[1] * nu[1] + slope[2] * nu[2]);
            }
        }
        force[2] = force[2] + nu[0] * self.moment;
        force
    }
}

impl<T: Real> Dynamics<T> {
    /// Compiles a craft. Its numbers are not checked; see [`Craft::validate`](super::Craft::validate).
    ///
    /// # Panics
    /// If there are more than [`MAX_SERVOS`] servos.
    pub fn new(craft: &Craft<T>) -> Self {
        let mut servos = Vec::new();
        for thruster in &craft.thrusters {
            servos.push(thruster.servo.clone());
            servos.extend(thruster.steering.clone());
        }
        servos.extend(craft.rudders.iter().map(|rudder| rudder.servo.clone()));
        assert!(servos.len() <= MAX_SERVOS, "at most {MAX_SERVOS} servos");
        let mut dynamics = Self {
            motion: HullMotion::new(&craft.hull, craft.flying.as_ref(), craft.water_density),
            half_density: 0.0,
            angles: Vec::with_capacity(servos.len()),
            servos,
            thrusters: Vec::with_capacity(craft.thrusters.len()),
            loses: false,
            moments: Vec::with_capacity(craft.rudders.len()),
            rudders: Vec::with_capacity(craft.rudders.len()),
        };
        dynamics.set(craft);
        dynamics
    }

    /// Replaces the numbers by those of a craft with the same actuators, without allocating.
    pub fn set(&mut self, craft: &Craft<T>) {
        self.motion = HullMotion::new(&craft.hull, craft.flying.as_ref(), craft.water_density);
        self.half_density = 0.5 * craft.water_density;
        self.loses = craft.thrusters.iter().any(|thruster| thruster.speed_loss.value() != 0.0);
        self.angles.clear();
        self.thrusters.clear();
        self.moments.clear();
        self.rudders.clear();
        let mut servos = self.servos.iter_mut();
        let mut next = |servo: &Servo<T>| {
            if let Some(own) = servos.next() {
                (own.lag, own.rate) = (servo.lag, servo.rate);
            }
        };
        for thruster in &craft.thrusters {
            let is_fixed = thruster.steering.is_none();
            self.thrusters.push(CompiledThruster {
                law: thruster.law,
                dead_band: thruster.dead_band,
                forward: thruster.forward,
                reverse: thruster.reverse,
                speed_loss: thruster.speed_loss,
                position: thruster.position,
                direction: is_fixed.then(|| direction(thruster.position, thruster.angle.sin_cos())),
                diameter: thruster.diameter.unwrap_or(0.0),
                order: self.angles.len(),
            });
            next(&thruster.servo);
            self.angles.push(None);
            if let Some(steering) = &thruster.steering {
                next(steering);
                self.angles.push(Some(thruster.angle));
            }
        }
        for rudder in &craft.rudders {
            next(&rudder.servo);
            let place = self.angles.len();
            let is_angle = !matches!(rudder.law, RudderLaw::Linear(_));
            self.angles.push(is_angle.then(|| T::constant(0.0)));
            match rudder.law {
                RudderLaw::Linear(gain) | RudderLaw::Sine(gain) => self.moments.push((place, gain)),
                RudderLaw::Normal(normal) => self.rudders.push((place, normal)),
            }
        }
    }

    /// Number of servos.
    pub fn servos(&self) -> usize {
        self.servos.len()
    }

    /// Servos that do not follow their orders at once.
    pub fn moving(&self) -> Vec<usize> {
        (0..self.servos.len()).filter(|&servo| !self.servos[servo].follows_at_once()).collect()
    }

    /// Sets the positions of servos that follow their orders at once.
    pub(crate) fn follow(&self, commands: &[f64], positions: &mut [T]) {
        for (position, servo) in positions.iter_mut().zip(&self.servos) {
            if servo.follows_at_once() {
                *position = T::constant(servo.order.value(commands));
            }
        }
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
        self.integrate(nu, positions, commands, h, steps, |nu, held| self.acceleration_at(*nu, held));
    }

    /// [`advance`](Self::advance) of a state that contains the velocity; `rate` is its rate at a stage.
    #[inline(always)]
    fn integrate<const N: usize>(
        &self,
        state: &mut [T; N],
        positions: &mut [T],
        commands: &[f64],
        h: f64,
        steps: usize,
        rate: impl Fn(&[T; N], &Held<T>) -> [T; N],
    ) {
        let half = 0.5 * h;
        let mut orders = [(0.0, T::constant(0.0)); MAX_SERVOS];
        for (order, servo) in orders.iter_mut().zip(&self.servos) {
            *order = (servo.order.value(commands), servo.decay(half));
        }
        let mut at = self.placed(positions);
        // A position that follows at once is at its order from the first stage on.
        for (i, servo) in self.servos.iter().enumerate() {
            if servo.follows_at_once() {
                at[i] = self.position(i, T::constant(orders[i].0));
            }
        }
        let mut held = Held { affine: self.affine(&at), at };
        let move_half = |held: &mut Held<T>| {
            for (i, servo) in self.servos.iter().enumerate() {
                if !servo.follows_at_once() {
                    let (order, decay) = orders[i];
                    held.at[i] = self.position(i, servo.step(held.at[i].value, order, half, decay));
                }
            }
            held.affine = self.affine(&held.at);
        };
        for _ in 0..steps {
            let along = |k: &[T; N], a: f64| -> [T; N] { core::array::from_fn(|i| state[i] + k[i] * a) };
            let k1 = rate(state, &held);
            move_half(&mut held);
            let k2 = rate(&along(&k1, half), &held);
            let k3 = rate(&along(&k2, half), &held);
            move_half(&mut held);
            let k4 = rate(&along(&k3, h), &held);
            let sixth = h / 6.0;
            *state = core::array::from_fn(|i| state[i] + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * sixth);
        }
        for (position, at) in positions.iter_mut().zip(&held.at) {
            *position = at.value;
        }
    }

    #[inline(always)]
    fn position(&self, servo: usize, value: T) -> Position<T> {
        let Some(angle) = self.angles[servo] else { return Position { value, sin: value, cos: value } };
        let (sin, cos) = (angle + value).sin_cos();
        Position { value, sin, cos }
    }

    #[inline(always)]
    fn placed(&self, positions: &[T]) -> [Position<T>; MAX_SERVOS] {
        let zero = T::constant(0.0);
        let mut at = [Position { value: zero, sin: zero, cos: zero }; MAX_SERVOS];
        for (i, (at, value)) in at.iter_mut().zip(positions).enumerate() {
            *at = self.position(i, *value);
        }
        at
    }

    /// `dnu/dt` \[m/s^2, m/s^2, rad/s^2\] at positions of the servos.
    pub fn acceleration(&self, nu: [T; 3], positions: &[T]) -> [T; 3] {
        let at = self.placed(positions);
        self.acceleration_at(nu, &Held { affine: self.affine(&at), at })
    }

    #[inline(always)]
    fn acceleration_at(&self, nu: [T; 3], Held { at, affine }: &Held<T>) -> [T; 3] {
        let mut applied = affine.at(nu, self.loses);
        for (place, rudder) in &self.rudders {
            let race = rudder.thruster.map(|of| self.thrusters[of].race(nu, at));
            let force = rudder.force(nu, &at[*place], race, self.half_density);
            for (sum, part) in applied.iter_mut().zip(force) {
                *sum = *sum + part;
            }
        }
        self.motion.under(nu, applied)
    }

    /// Damping forces `D(nu) nu` of the normal mode \[N, N, N m\].
    pub fn damping(&self, nu: [T; 3]) -> [T; 3] {
        self.motion.damping(nu)
    }

    /// Coriolis and centripetal forces `C(nu) nu` \[N, N, N m\].
    pub fn coriolis(&self, nu: [T; 3]) -> [T; 3] {
        self.motion.coriolis(nu)
    }

    /// Contribution of an external force `[X, Y, N]` \[N, N, N m\], for instance wind on the hull, to `dnu/dt` at surge
    /// velocity `u`. The motion is linear in the force.
    pub fn pushed(&self, u: T, force: [T; 3]) -> [T; 3] {
        self.motion.pushed(u, force)
    }

    /// The force of the thrusters at positions, and the moment of the rudders that are one. A thruster pushes along `d`, and its
    /// speed of advance is `d nu`.
    #[inline(always)]
    fn affine(&self, at: &[Position<T>; MAX_SERVOS]) -> AffineForce<T> {
        let zero = T::constant(0.0);
        let mut affine = AffineForce { force: [zero; 3], slope: [[zero; 3]; 3], moment: zero };
        for thruster in &self.thrusters {
            let (d, (thrust, loss)) = (thruster.direction(at), thruster.thrust(at[thruster.order].value));
            for (force, d) in affine.force.iter_mut().zip(d) {
                *force = *force + thrust * d;
            }
            if self.loses {
                for (slope, di) in affine.slope.iter_mut().zip(d) {
                    for (slope, dj) in slope.iter_mut().zip(d) {
                        *slope = *slope + loss * di * dj;
                    }
                }
            }
        }
        for (place, gain) in &self.moments {
            affine.moment = affine.moment + *gain * at[*place].sin;
        }
        affine
    }
}

impl Dynamics {
    /// Whether the motion of a batch can be computed side by side: all forces are affine, and there is no cross-flow drag.
    pub(crate) fn is_polynomial(&self) -> bool {
        self.rudders.is_empty() && self.motion.is_polynomial()
    }

    /// Force and moment of a unit of thrust of a steered thruster.
    #[inline(always)]
    pub(super) fn steered(&self, thruster: &CompiledThruster<f64>, steering: f64) -> [f64; 3] {
        let Position { sin, cos, .. } = self.position(thruster.order + 1, steering);
        direction(thruster.position, (sin, cos))
    }

    /// Sine of the angle of a servo, or the position of one that is no angle.
    #[inline(always)]
    pub(super) fn sine(&self, servo: usize, value: f64) -> f64 {
        self.angles[servo].map_or(value, |angle| Float::sin(angle + value))
    }

    /// [`advance`](Self::advance) with the pose. The water moves with the velocity `current`, north and east \[m/s\], and a
    /// force `push`, north and east \[N\], acts on the vessel. A steady irrotational current enters the kinematics only (T.
    /// I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2nd edition, 2021, property 10.1).
    pub fn advance_pose(
        &self,
        state: &mut Posed,
        commands: &[f64],
        h: f64,
        steps: usize,
        current: [f64; 2],
        push: [f64; 2],
    ) {
        let [x, y, psi] = state.eta;
        let [u, v, r] = state.nu;
        let is_pushed = push != [0.0; 2];
        let mut whole = [x, y, psi, u, v, r];
        self.integrate(
            &mut whole,
            &mut state.positions,
            commands,
            h,
            steps,
            |&[_, _, psi, u, v, r], held| {
                let nu = [u, v, r];
                let [north, east, turn] = pose_rate(psi, nu);
                let [mut du, mut dv, mut dr] = self.acceleration_at(nu, held);
                if is_pushed {
                    let (sin, cos) = Float::sin_cos(psi);
                    let body = [push[0] * cos + push[1] * sin, push[1] * cos - push[0] * sin, 0.0];
                    let pushed = self.motion.pushed(u, body);
                    (du, dv, dr) = (du + pushed[0], dv + pushed[1], dr + pushed[2]);
                }
                [north + current[0], east + current[1], turn, du, dv, dr]
            },
        );
        let [x, y, psi, u, v, r] = whole;
        (state.eta, state.nu) = ([x, y, psi], [u, v, r]);
    }

    /// Surge force that holds a surge velocity on a straight course \[N\]: the surge damping, blended between the modes. For
    /// a hydrofoil it decreases at take-off.
    pub fn holding_force(&self, u: f64) -> f64 {
        self.motion.holding_force(u)
    }

    /// Writes the positions at the start of a run with a measured surge velocity and a first row of commands: those that hold
    /// the commands, but a lone linear propeller holds the velocity.
    pub fn start(&self, u: f64, commands: &[f64], positions: &mut [f64]) {
        positions.fill(f64::NAN);
        self.hold(u, positions);
        self.settle_unknown(commands, positions);
    }

    /// Sets the unknown position of a propeller at a measured surge velocity to the one that holds it: the lag of a lone linear
    /// propeller then starts in steady motion.
    pub(crate) fn hold(&self, u: f64, positions: &mut [f64]) {
        let [propeller] = &self.thrusters[..] else { return };
        let is_linear = propeller.law == ThrustLaw::Linear && propeller.speed_loss == 0.0;
        let is_ahead = propeller.direction.is_some_and(|[x, y, _]| x > 0.0 && y == 0.0);
        let position = &mut positions[propeller.order];
        if is_linear && is_ahead && u.is_finite() && position.is_nan() {
            let force = self.holding_force(u);
            let gain = if force > 0.0 { propeller.forward } else { propeller.reverse };
            // A propeller without thrust in this direction holds nothing: its first order counts.
            if gain <= 0.0 {
                return;
            }
            let band = if force == 0.0 { 0.0 } else { propeller.dead_band };
            let order = Float::abs(force) / gain + band;
            let [low, high] = self.servos[propeller.order].order.limits;
            *position = Float::copysign(order, force).max(low).min(high);
        }
    }

    /// Writes the positions that hold a row of commands where they are not known. Returns whether one was not.
    pub(crate) fn settle_unknown(&self, commands: &[f64], positions: &mut [f64]) -> bool {
        let mut is_unknown = false;
        for (position, servo) in positions.iter_mut().zip(&self.servos) {
            if position.is_nan() {
                is_unknown = true;
                *position = servo.order.value(commands);
            }
        }
        is_unknown
    }

    /// Weight of the flying mode at a surge velocity; 0 without a flying mode.
    pub fn flying_weight(&self, u: f64) -> f64 {
        self.motion.flying_weight(u)
    }

    /// Force of each thruster at a velocity and positions of the servos \[N\].
    pub fn thrusts(&self, nu: [f64; 3], positions: &[f64]) -> impl Iterator<Item = f64> {
        let at = self.placed(positions);
        self.thrusters.iter().map(move |thruster| thruster.race(nu, &at).0)
    }
}

/// Force and moment of a unit of thrust.
fn direction<T: Real>([x, y]: [T; 2], (sin, cos): (T, T)) -> [T; 3] {
    [cos, sin, x * sin - y * cos]
}

impl<T: Real> Hull<T> {
    /// Mass matrix as `[m11, m22, m23, m33]`.
    pub fn mass_matrix(&self) -> [T; 4] {
        self.mass_matrix_with(T::constant(1.0))
    }

    /// Mass matrix with a factor on the added mass.
    pub fn mass_matrix_with(&self, added: T) -> [T; 4] {
        [
            self.mass - added * self.x_udot,
            self.mass - added * self.y_vdot,
            self.mass * self.x_g - added * self.y_rdot,
            self.i_z - added * self.n_rdot,
        ]
    }
}

impl<T: Real> CompiledThruster<T> {
    #[inline(always)]
    fn direction(&self, at: &[Position<T>; MAX_SERVOS]) -> [T; 3] {
        self.direction.unwrap_or_else(|| {
            let steering = &at[self.order + 1];
            direction(self.position, (steering.sin, steering.cos))
        })
    }

    /// Thrust at rest \[N\], and its loss per speed of advance \[N s/m\].
    #[inline(always)]
    pub(super) fn thrust(&self, order: T) -> (T, T) {
        let size = order.abs();
        if size.value() <= self.dead_band {
            return (T::constant(0.0), T::constant(0.0));
        }
        let n = size - T::constant(self.dead_band);
        let gain = if order.value() > 0.0 { self.forward } else { -self.reverse };
        let thrust = match self.law {
            ThrustLaw::Quadratic => gain * n * n,
            ThrustLaw::Linear => gain * n,
        };
        (thrust, self.speed_loss * n)
    }

    /// Thrust \[N\], speed of advance \[m/s\] and diameter \[m\].
    fn race(&self, nu: [T; 3], at: &[Position<T>; MAX_SERVOS]) -> (T, T, f64) {
        let (d, (thrust, loss)) = (self.direction(at), self.thrust(at[self.order].value));
        let advance = d[0] * nu[0] + d[1] * nu[1] + d[2] * nu[2];
        (thrust - loss * advance, advance, self.diameter)
    }
}

impl<T: Real> NormalForce<T> {
    /// Force \[N, N, N m\] at an angle; `race` are thrust, speed of advance and diameter of the thruster ahead of it.
    #[inline]
    fn force(
        &self,
        nu: [T; 3],
        &Position { sin, cos, .. }: &Position<T>,
        race: Option<(T, T, f64)>,
        half_density: f64,
    ) -> [T; 3] {
        let [x, y] = self.position;
        let one = T::constant(1.0);
        let mut u = (nu[0] - y * nu[2]) * (one - self.wake);
        if let Some((thrust, advance, diameter)) = race
            && thrust.value() > 0.0
        {
            let disc = FRAC_PI_4 * diameter * diameter;
            let behind = (advance * advance + thrust * (1.0 / (half_density * disc))).sqrt();
            u = u + self.race * (behind - advance.abs());
        }
        let v = (nu[1] + x * nu[2]) * self.straightening;
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
