//! The numbers of a craft by their paths in a vessel file.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use super::servo::Servo;
use super::{Craft, Hull, Rudder, Thruster};
use crate::vessel::Real;

/// A number of a craft.
#[derive(Clone, Debug, PartialEq)]
pub struct CraftParameter {
    /// Path in the vessel file: `hull.mass`, `drag.linear[0][0]`, `thruster.port.forward`.
    pub path: String,
    /// Unit.
    pub unit: &'static str,
    /// Whether the sign is free. It is fixed for masses, inertia, direct damping, thrust and times.
    pub signed: bool,
}

/// Calls a function with every number in a fixed order, and collects its results in a craft of another type.
struct Mapper<'a, T, U> {
    map: &'a mut dyn FnMut(&CraftParameter, T) -> U,
}

impl<T: Real, U: Real> Mapper<'_, T, U> {
    fn of(&mut self, path: String, unit: &'static str, signed: bool, value: T) -> U {
        (self.map)(&CraftParameter { path, unit, signed }, value)
    }

    fn fixed(&mut self, path: &str, unit: &'static str, value: T) -> U {
        self.of(String::from(path), unit, false, value)
    }

    fn signed(&mut self, path: &str, unit: &'static str, value: T) -> U {
        self.of(String::from(path), unit, true, value)
    }

    fn hull(&mut self, hull: &Hull<T>) -> Hull<U> {
        const LINEAR: [[&str; 3]; 3] =
            [["N s/m", "N s/m", "N s"], ["N s/m", "N s/m", "N s"], ["N s", "N s", "N m s"]];
        const QUADRATIC: [[&str; 3]; 3] = [
            ["N s^2/m^2", "N s^2/m^2", "N s^2"],
            ["N s^2/m^2", "N s^2/m^2", "N s^2"],
            ["N s^2/m", "N s^2/m", "N m s^2"],
        ];
        const LIFT: [[&str; 2]; 2] = [["N s^2/m^2", "N s^2/m"], ["N s^2/m", "N s^2"]];
        Hull {
            size: hull.size,
            mass: self.fixed("rigid_body.mass", "kg", hull.mass),
            x_g: self.signed("rigid_body.x_g", "m", hull.x_g),
            i_z: self.fixed("rigid_body.i_z", "kg m^2", hull.i_z),
            x_udot: self.fixed("added_mass.x_udot", "kg", hull.x_udot),
            y_vdot: self.fixed("added_mass.y_vdot", "kg", hull.y_vdot),
            y_rdot: self.signed("added_mass.y_rdot", "kg m", hull.y_rdot),
            n_rdot: self.fixed("added_mass.n_rdot", "kg m^2", hull.n_rdot),
            linear: self.matrix("drag.linear", &LINEAR, &hull.linear),
            quadratic: self.matrix("drag.quadratic", &QUADRATIC, &hull.quadratic),
            lift: self.matrix("drag.lift", &LIFT, &hull.lift),
            cross_flow: self.fixed("drag.cross_flow", "1", hull.cross_flow),
        }
    }

    fn matrix<const N: usize>(
        &mut self,
        path: &str,
        units: &[[&'static str; N]; N],
        values: &[[T; N]; N],
    ) -> [[U; N]; N] {
        core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                // A lift on the diagonal can have either sign: it contains a part of the Coriolis forces.
                let signed = i != j || N == 2;
                self.of(format!("{path}[{i}][{j}]"), units[i][j], signed, values[i][j])
            })
        })
    }

    fn servo(&mut self, path: &str, servo: &Servo<T>) -> Servo<U> {
        Servo {
            order: servo.order.clone(),
            lag: self.of(format!("{path}.lag"), "s", false, servo.lag),
            rate: servo.rate.map(|rate| self.of(format!("{path}.rate"), "1/s", false, rate)),
        }
    }

    fn position(&mut self, path: &str, position: &[T; 2]) -> [U; 2] {
        core::array::from_fn(|i| self.of(format!("{path}.position[{i}]"), "m", true, position[i]))
    }

    fn thruster(&mut self, t: &Thruster<T>) -> Thruster<U> {
        let path = format!("thruster.{}", t.name);
        let at = |key: &str| format!("{path}.{key}");
        Thruster {
            name: t.name.clone(),
            position: self.position(&path, &t.position),
            angle: self.of(at("angle"), "rad", true, t.angle),
            servo: self.servo(&path, &t.servo),
            dead_band: t.dead_band,
            law: t.law,
            forward: self.of(at("forward"), "N", false, t.forward),
            reverse: self.of(at("reverse"), "N", false, t.reverse),
            speed_loss: self.of(at("speed_loss"), "N s/m", false, t.speed_loss),
            diameter: t.diameter,
            steering: t.steering.as_ref().map(|servo| self.servo(&at("steering"), servo)),
        }
    }

    fn rudder(&mut self, r: &Rudder<T>) -> Rudder<U> {
        let path = format!("rudder.{}", r.name);
        let at = |key: &str| format!("{path}.{key}");
        Rudder {
            name: r.name.clone(),
            position: self.position(&path, &r.position),
            servo: self.servo(&path, &r.servo),
            area: r.area,
            lift_slope: self.of(at("lift_slope"), "1/rad", false, r.lift_slope),
            wake: self.of(at("wake"), "1", true, r.wake),
            straightening: self.of(at("straightening"), "1", false, r.straightening),
            drag_deduction: self.of(at("drag_deduction"), "1", true, r.drag_deduction),
            hull_force: self.of(at("hull_force"), "1", false, r.hull_force),
            hull_position: self.of(at("hull_position"), "m", true, r.hull_position),
            thruster: r.thruster,
            race: self.of(at("race"), "1", false, r.race),
        }
    }
}

impl<T: Real> Craft<T> {
    /// The craft with the results of a function of each number.
    pub fn map<U: Real>(&self, map: &mut dyn FnMut(&CraftParameter, T) -> U) -> Craft<U> {
        let mut mapper = Mapper { map };
        Craft {
            name: self.name.clone(),
            water_density: self.water_density,
            hull: mapper.hull(&self.hull),
            commands: self.commands.clone(),
            thrusters: self.thrusters.iter().map(|thruster| mapper.thruster(thruster)).collect(),
            rudders: self.rudders.iter().map(|rudder| mapper.rudder(rudder)).collect(),
            noise: self.noise,
        }
    }

    /// The craft with other numbers, in the order of [`parameters`](Craft::parameters); missing ones stay.
    pub fn with_numbers<U: Real>(&self, numbers: &[U]) -> Craft<U> {
        let mut numbers = numbers.iter();
        self.map(&mut |_, value| numbers.next().copied().unwrap_or(U::constant(value.value())))
    }
}

impl Craft {
    /// All numbers with their descriptions.
    pub fn parameters(&self) -> Vec<(CraftParameter, f64)> {
        let mut all = Vec::new();
        let _: Self = self.map(&mut |parameter, value| {
            all.push((parameter.clone(), value));
            value
        });
        all
    }
}
