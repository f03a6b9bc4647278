//! Rollouts of several command sequences side by side.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use pulp::{Simd, WithSimd};

use super::dynamics::{AffineForce, Dynamics, MAX_SERVOS};
use super::motion::HullMotion;
use crate::vessel::{Lanes, Number as _};

/// Number of command sequences that are integrated side by side.
pub(crate) const LANES: usize = 16;

/// Rollouts of at most [`LANES`] command sequences from one state, sequence by sequence in `commands` and `y`.
pub(crate) struct BatchRollout<'a> {
    pub(crate) dynamics: &'a Dynamics,
    pub(crate) nu: [f64; 3],
    /// NaN where the first command is to settle them.
    pub(crate) positions: &'a [f64],
    pub(crate) h: f64,
    pub(crate) steps: usize,
    pub(crate) count: usize,
    pub(crate) inputs: usize,
    pub(crate) commands: &'a [f64],
    pub(crate) y: &'a mut [f64],
}

/// Positions of the servos: one row for each of them.
type Rows = [[f64; LANES]; MAX_SERVOS];

impl WithSimd for BatchRollout<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { dynamics, nu, positions, h, steps, count, inputs, commands, y } = self;
        let samples = y.len() / (count * 3);
        let half = 0.5 * h;
        let hull: HullMotion<Lanes<LANES>> = dynamics.motion.spread();
        let mut nu = nu.map(Lanes::constant);
        let servos = &dynamics.servos;
        let (mut at, mut orders, mut decay): (Rows, Rows, _) =
            ([[0.0; LANES]; MAX_SERVOS], [[0.0; LANES]; MAX_SERVOS], [0.0; MAX_SERVOS]);
        for (i, servo) in servos.iter().enumerate() {
            (at[i], decay[i]) = ([positions[i]; LANES], servo.decay(half));
        }
        for sample in 0..samples {
            for sequence in 0..count {
                let c = &commands[(sequence * samples + sample) * inputs..][..inputs];
                for (orders, servo) in orders.iter_mut().zip(servos) {
                    orders[sequence] = servo.order.value(c);
                }
            }
            for (i, servo) in servos.iter().enumerate() {
                if servo.follows_at_once() || (sample == 0 && positions[i].is_nan()) {
                    at[i] = orders[i];
                }
            }
            let mut affine = forces(dynamics, &at);
            let move_half = |at: &mut Rows| {
                for (i, servo) in servos.iter().enumerate() {
                    if servo.follows_at_once() {
                        continue;
                    }
                    for (at, order) in at[i].iter_mut().zip(orders[i]) {
                        *at = servo.step(*at, order, half, decay[i]);
                    }
                }
                forces(dynamics, at)
            };
            for _ in 0..steps {
                let rate = |nu: [Lanes<LANES>; 3], affine: &AffineForce<Lanes<LANES>>| {
                    hull.under_polynomial(nu, affine.at(nu, dynamics.loses))
                };
                let k1 = rate(nu, &affine);
                affine = move_half(&mut at);
                let k2 = rate(along(&nu, &k1, half), &affine);
                let k3 = rate(along(&nu, &k2, half), &affine);
                affine = move_half(&mut at);
                let k4 = rate(along(&nu, &k3, h), &affine);
                for i in 0..3 {
                    nu[i] = nu[i] + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * (h / 6.0);
                }
            }
            for sequence in 0..count {
                let y = &mut y[(sequence * samples + sample) * 3..][..3];
                y.iter_mut().zip(&nu).for_each(|(y, x)| *y = x.0[sequence]);
            }
        }
    }
}

#[inline(always)]
fn along(x: &[Lanes<LANES>; 3], k: &[Lanes<LANES>; 3], a: f64) -> [Lanes<LANES>; 3] {
    let mut moved = *x;
    for (moved, k) in moved.iter_mut().zip(k) {
        *moved = *moved + *k * a;
    }
    moved
}

/// As [`Dynamics`] computes it for one sequence.
#[inline(always)]
fn forces(dynamics: &Dynamics, at: &Rows) -> AffineForce<Lanes<LANES>> {
    let zero = Lanes([0.0; LANES]);
    let mut affine = AffineForce { force: [zero; 3], slope: [[zero; 3]; 3], moment: zero };
    for thruster in &dynamics.thrusters {
        let (mut thrust, mut loss) = (zero, zero);
        for (lane, order) in at[thruster.order].iter().enumerate() {
            (thrust.0[lane], loss.0[lane]) = thruster.thrust(*order);
        }
        let mut direction = thruster.direction.unwrap_or_default().map(Lanes::constant);
        if thruster.direction.is_none() {
            for lane in 0..LANES {
                let of_lane = dynamics.steered(thruster, at[thruster.order + 1][lane]);
                direction.iter_mut().zip(of_lane).for_each(|(all, d)| all.0[lane] = d);
            }
        }
        for i in 0..3 {
            affine.force[i] = affine.force[i] + thrust * direction[i];
            if dynamics.loses {
                for j in 0..3 {
                    affine.slope[i][j] = affine.slope[i][j] + loss * direction[i] * direction[j];
                }
            }
        }
    }
    for (place, gain) in &dynamics.moments {
        for (lane, position) in at[*place].iter().enumerate() {
            affine.moment.0[lane] += gain * dynamics.sine(*place, *position);
        }
    }
    affine
}
