//! Acceleration of a hull under a force.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use super::{Coriolis, Flying, Hull};
use crate::vessel::{Number, Real};

/// Mass, Coriolis forces and polynomial damping of a hull, in its modes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct HullMotion<T> {
    /// `m11`, `m22`, `m23`.
    mass: [T; 3],
    /// `m22 - m11` with the Munk moment, else 0.
    munk: T,
    inverse: InverseMass<T>,
    linear: [[T; 3]; 3],
    quadratic: [[T; 3]; 3],
    /// None if all entries are zero.
    lift: Option<[[T; 2]; 2]>,
    /// `1/2 rho T C_d`; 0 without a size of the hull.
    cross_flow: T,
    half_length: f64,
    flying: Option<FlyingMode<T>>,
}

/// Inverse of a mass matrix: entries 11, 22, 23, 33.
#[derive(Clone, Copy, Debug, PartialEq)]
struct InverseMass<T>([T; 4]);

impl<T: Number> InverseMass<T> {
    fn new([m11, m22, m23, m33]: [T; 4]) -> Self {
        let determinant = m22 * m33 - m23 * m23;
        Self([T::constant(1.0) / m11, m33 / determinant, -m23 / determinant, m22 / determinant])
    }

    #[inline(always)]
    fn apply(&self, [x, y, n]: [T; 3]) -> [T; 3] {
        let [i11, i22, i23, i33] = self.0;
        [i11 * x, i22 * y + i23 * n, i23 * y + i33 * n]
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct FlyingMode<T> {
    inverse: InverseMass<T>,
    drag_factor: T,
    transition_speed: T,
    slope: T,
}

impl<T: Number> FlyingMode<T> {
    #[inline(always)]
    fn blended(&self, u: T, normal: [T; 3], fly: [T; 3]) -> [T; 3] {
        let weight = (self.slope * (u - self.transition_speed)).logistic();
        // sigma(-z) = 1 - sigma(z) saves the second exponential.
        let rest = T::constant(1.0) - weight;
        let mut blended = fly;
        for i in 0..3 {
            blended[i] = weight * fly[i] + rest * normal[i];
        }
        blended
    }
}

impl<T: Real> HullMotion<T> {
    pub(super) fn new(hull: &Hull<T>, flying: Option<&Flying<T>>, water_density: f64) -> Self {
        let mass = hull.mass_matrix();
        let [length, _, draught] = hull.size.unwrap_or([0.0; 3]);
        Self {
            mass: [mass[0], mass[1], mass[2]],
            munk: match hull.coriolis {
                Coriolis::WithoutMunk => T::constant(0.0),
                Coriolis::Full => mass[1] - mass[0],
            },
            inverse: InverseMass::new(mass),
            linear: hull.linear,
            quadratic: hull.quadratic,
            lift: hull.lift.as_flattened().iter().any(|entry| entry.value() != 0.0).then_some(hull.lift),
            cross_flow: hull.cross_flow * (0.5 * water_density * draught),
            half_length: 0.5 * length,
            flying: flying.map(|flying| FlyingMode {
                inverse: InverseMass::new(hull.mass_matrix_with(flying.added_mass_factor)),
                drag_factor: flying.drag_factor,
                transition_speed: flying.transition_speed,
                slope: flying.slope,
            }),
        }
    }

    /// Damping forces `D(nu) nu` of the normal mode \[N, N, N m\].
    #[inline(always)]
    pub(super) fn damping(&self, nu: [T; 3]) -> [T; 3] {
        let mut force = self.polynomial_damping(nu);
        if self.half_length > 0.0 && self.cross_flow.value() > 0.0 {
            let [side, moment] = self.cross_flow_integrals(nu[1], nu[2]);
            force[1] = force[1] + self.cross_flow * side;
            force[2] = force[2] + self.cross_flow * moment;
        }
        force
    }

    /// `dnu/dt` \[m/s^2, m/s^2, rad/s^2\] under an applied force.
    #[inline(always)]
    pub(super) fn under(&self, nu: [T; 3], applied: [T; 3]) -> [T; 3] {
        self.acceleration(nu, applied, self.damping(nu))
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
}

impl HullMotion<f64> {
    /// Whether there is no cross-flow drag.
    pub(super) fn is_polynomial(&self) -> bool {
        self.half_length <= 0.0 || self.cross_flow <= 0.0
    }

    /// The same motion with numbers of another type.
    #[inline(always)]
    pub(super) fn spread<T: Number>(&self) -> HullMotion<T> {
        let all = T::constant;
        let inverse = |mass: &InverseMass<f64>| InverseMass(mass.0.map(all));
        HullMotion {
            mass: self.mass.map(all),
            munk: all(self.munk),
            inverse: inverse(&self.inverse),
            linear: self.linear.map(|row| row.map(all)),
            quadratic: self.quadratic.map(|row| row.map(all)),
            lift: self.lift.map(|lift| lift.map(|row| row.map(all))),
            cross_flow: all(self.cross_flow),
            half_length: self.half_length,
            flying: self.flying.as_ref().map(|flying| FlyingMode {
                inverse: inverse(&flying.inverse),
                drag_factor: all(flying.drag_factor),
                transition_speed: all(flying.transition_speed),
                slope: all(flying.slope),
            }),
        }
    }

    /// Weight of the flying mode at a surge velocity; 0 without one.
    pub(super) fn flying_weight(&self, u: f64) -> f64 {
        self.flying.map_or(0.0, |flying| (flying.slope * (u - flying.transition_speed)).logistic())
    }

    /// Surge force that holds a surge velocity \[N\].
    pub(super) fn holding_force(&self, u: f64) -> f64 {
        let [drag, ..] = self.damping([u, 0.0, 0.0]);
        let Some(flying) = &self.flying else { return drag };
        let weight = self.flying_weight(u);
        let (fly, normal) = (weight * flying.inverse.0[0], (1.0 - weight) * self.inverse.0[0]);
        drag * (fly * flying.drag_factor + normal) / (fly + normal)
    }
}

impl<T: Number> HullMotion<T> {
    /// Linear and quadratic damping and lift of the normal mode \[N, N, N m\].
    #[inline(always)]
    fn polynomial_damping(&self, nu: [T; 3]) -> [T; 3] {
        let [u, v, r] = nu;
        let squared = [u.abs() * u, v.abs() * v, r.abs() * r];
        let mut force = nu;
        for i in 0..3 {
            let (linear, quadratic) = (&self.linear[i], &self.quadratic[i]);
            force[i] = (linear[0] * nu[0] + quadratic[0] * squared[0])
                + (linear[1] * nu[1] + quadratic[1] * squared[1])
                + (linear[2] * nu[2] + quadratic[2] * squared[2]);
        }
        if let Some([sway, yaw]) = &self.lift {
            let speed = u.abs();
            force[1] = force[1] + speed * (sway[0] * v + sway[1] * r);
            force[2] = force[2] + speed * (yaw[0] * v + yaw[1] * r);
        }
        force
    }

    /// Coriolis and centripetal forces `C(nu) nu` \[N, N, N m\].
    #[inline(always)]
    pub(super) fn coriolis(&self, [u, v, r]: [T; 3]) -> [T; 3] {
        let [m11, m22, m23] = self.mass;
        [-(m22 * v + m23 * r) * r, m11 * u * r, self.munk * u * v + m23 * u * r]
    }

    /// `dnu/dt` \[m/s^2, m/s^2, rad/s^2\] under applied forces and polynomial damping.
    #[inline(always)]
    pub(super) fn under_polynomial(&self, nu: [T; 3], applied: [T; 3]) -> [T; 3] {
        self.acceleration(nu, applied, self.polynomial_damping(nu))
    }

    /// `dnu/dt` \[m/s^2, m/s^2, rad/s^2\] under applied forces and damping forces of the normal mode.
    #[inline(always)]
    fn acceleration(&self, nu: [T; 3], applied: [T; 3], damping: [T; 3]) -> [T; 3] {
        let coriolis = self.coriolis(nu);
        let [x, y, n] = [applied[0] - coriolis[0], applied[1] - coriolis[1], applied[2] - coriolis[2]];
        let normal = self.inverse.apply([x - damping[0], y - damping[1], n - damping[2]]);
        let Some(flying) = &self.flying else { return normal };
        let factor = flying.drag_factor;
        let less = [x - factor * damping[0], y - factor * damping[1], n - factor * damping[2]];
        let fly = flying.inverse.apply(less);
        flying.blended(nu[0], normal, fly)
    }

    /// Contribution of an external force `[X, Y, N]` \[N, N, N m\] to `dnu/dt` at surge velocity `u`. The motion is linear in
    /// the force.
    #[inline(always)]
    pub(super) fn pushed(&self, u: T, force: [T; 3]) -> [T; 3] {
        let normal = self.inverse.apply(force);
        let Some(flying) = &self.flying else { return normal };
        flying.blended(u, normal, flying.inverse.apply(force))
    }
}
