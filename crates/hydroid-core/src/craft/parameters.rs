//! The numbers of a craft by their paths in a vessel file.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use super::servo::Servo;
use super::{Craft, Flying, Hull, NormalForce, Rudder, RudderLaw, ThrustLaw, Thruster};
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
            coriolis: hull.coriolis,
        }
    }

    fn flying(&mut self, flying: &Flying<T>) -> Flying<U> {
        Flying {
            added_mass_factor: self.fixed("flying.added_mass_factor", "1", flying.added_mass_factor),
            drag_factor: self.fixed("flying.drag_factor", "1", flying.drag_factor),
            transition_speed: self.fixed("flying.transition_speed", "m/s", flying.transition_speed),
            slope: self.fixed("flying.slope", "s/m", flying.slope),
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
            force_noise: t.force_noise,
        }
    }

    fn rudder(&mut self, r: &Rudder<T>) -> Rudder<U> {
        let path = format!("rudder.{}", r.name);
        let at = |key: &str| format!("{path}.{key}");
        let position = match &r.law {
            RudderLaw::Normal(normal) => self.position(&path, &normal.position),
            RudderLaw::Linear(_) | RudderLaw::Sine(_) => [U::constant(0.0); 2],
        };
        let servo = self.servo(&path, &r.servo);
        let law = match &r.law {
            RudderLaw::Normal(normal) => RudderLaw::Normal(NormalForce {
                position,
                area: normal.area,
                lift_slope: self.of(at("lift_slope"), "1/rad", false, normal.lift_slope),
                wake: self.of(at("wake"), "1", true, normal.wake),
                straightening: self.of(at("straightening"), "1", false, normal.straightening),
                drag_deduction: self.of(at("drag_deduction"), "1", true, normal.drag_deduction),
                hull_force: self.of(at("hull_force"), "1", false, normal.hull_force),
                hull_position: self.of(at("hull_position"), "m", true, normal.hull_position),
                thruster: normal.thruster,
                race: self.of(at("race"), "1", false, normal.race),
            }),
            RudderLaw::Linear(gain) => RudderLaw::Linear(self.of(at("gain"), "1", false, *gain)),
            RudderLaw::Sine(gain) => RudderLaw::Sine(self.of(at("gain"), "N s", false, *gain)),
        };
        Rudder { name: r.name.clone(), servo, law }
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
            flying: self.flying.as_ref().map(|flying| mapper.flying(flying)),
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

impl<T> Hull<T> {
    /// Calls a function with the place of each number, in the order of [`Craft::parameters`].
    pub(crate) fn visit_numbers(&mut self, visit: &mut dyn FnMut(&mut T)) {
        let Self {
            mass, x_g, i_z, x_udot, y_vdot, y_rdot, n_rdot, linear, quadratic, lift, cross_flow, ..
        } = self;
        [mass, x_g, i_z, x_udot, y_vdot, y_rdot, n_rdot].into_iter().for_each(&mut *visit);
        linear.as_flattened_mut().iter_mut().for_each(&mut *visit);
        quadratic.as_flattened_mut().iter_mut().for_each(&mut *visit);
        lift.as_flattened_mut().iter_mut().for_each(&mut *visit);
        visit(cross_flow);
    }
}

impl<T> Flying<T> {
    /// As [`Hull::visit_numbers`].
    pub(crate) fn visit_numbers(&mut self, visit: &mut dyn FnMut(&mut T)) {
        let Self { added_mass_factor, drag_factor, transition_speed, slope } = self;
        [added_mass_factor, drag_factor, transition_speed, slope].into_iter().for_each(visit);
    }
}

fn visit_servo<T>(servo: &mut Servo<T>, visit: &mut dyn FnMut(&mut T)) {
    visit(&mut servo.lag);
    servo.rate.iter_mut().for_each(visit);
}

impl<T: Copy> Craft<T> {
    /// Replaces the numbers, in the order of [`parameters`](Craft::parameters), without allocating; missing ones stay.
    pub fn set_numbers(&mut self, numbers: &[T]) {
        let mut numbers = numbers.iter();
        let visit: &mut dyn FnMut(&mut T) = &mut |place| *place = numbers.next().copied().unwrap_or(*place);
        self.hull.visit_numbers(visit);
        self.flying.iter_mut().for_each(|flying| flying.visit_numbers(visit));
        for thruster in &mut self.thrusters {
            thruster.position.iter_mut().for_each(&mut *visit);
            visit(&mut thruster.angle);
            visit_servo(&mut thruster.servo, visit);
            let Thruster { forward, reverse, speed_loss, .. } = thruster;
            [forward, reverse, speed_loss].into_iter().for_each(&mut *visit);
            thruster.steering.iter_mut().for_each(|steering| visit_servo(steering, visit));
        }
        for rudder in &mut self.rudders {
            if let RudderLaw::Normal(normal) = &mut rudder.law {
                normal.position.iter_mut().for_each(&mut *visit);
            }
            visit_servo(&mut rudder.servo, visit);
            match &mut rudder.law {
                RudderLaw::Linear(gain) | RudderLaw::Sine(gain) => visit(gain),
                RudderLaw::Normal(NormalForce {
                    lift_slope,
                    wake,
                    straightening,
                    drag_deduction,
                    hull_force,
                    hull_position,
                    race,
                    ..
                }) => [lift_slope, wake, straightening, drag_deduction, hull_force, hull_position, race]
                    .into_iter()
                    .for_each(&mut *visit),
            }
        }
    }
}

impl Hull {
    /// Whether the equations can be solved: the yaw inertia exceeds `m x_g^2`, and the mass matrix of each mode is positive
    /// definite. Signs of other numbers are not checked.
    pub(crate) fn is_solvable(&self, flying: Option<&Flying>) -> bool {
        let definite = |added: f64| {
            let [m11, m22, m23, m33] = self.mass_matrix_with(added);
            m11 > 0.0 && m22 > 0.0 && m22 * m33 - m23 * m23 > 1e-12 * m22 * m33
        };
        self.i_z > self.mass * self.x_g * self.x_g
            && definite(1.0)
            && flying.is_none_or(|flying| definite(flying.added_mass_factor))
    }
}

impl Craft {
    /// Indices of the numbers that an adaptation changes if nothing else is stated: those that are not zero, but for places
    /// and directions of the actuators, and for the thrust of a thruster whose order is its force (linear law, 1 N at the
    /// order 1).
    pub fn adaptable(&self) -> Vec<usize> {
        let is_force = |path: &str| {
            self.thrusters.iter().any(|thruster| {
                let key = path.strip_prefix("thruster.").and_then(|path| path.strip_prefix(&*thruster.name));
                thruster.law == ThrustLaw::Linear
                    && (key == Some(".forward") && thruster.forward == 1.0
                        || key == Some(".reverse") && thruster.reverse == 1.0)
            })
        };
        let is_place = |path: &str| {
            let key = path.rsplit('.').next().unwrap_or(path);
            key == "angle" || key.starts_with("position[")
        };
        let all = self.parameters().into_iter().enumerate();
        all.filter(|(_, (parameter, number))| {
            *number != 0.0 && !is_place(&parameter.path) && !is_force(&parameter.path)
        })
        .map(|(index, _)| index)
        .collect()
    }

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
