//! Checks that a craft describes a vessel.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::f64::consts::PI;

use super::invalid::{InvalidCraft, Mode};
use super::servo::Servo;
use super::{Craft, MAX_SERVOS, NormalForce, RudderLaw};

impl Craft {
    /// Finds the first invalid part.
    ///
    /// # Errors
    /// See [`InvalidCraft`].
    pub fn validate(&self) -> Result<(), InvalidCraft> {
        self.check_numbers()?;
        self.check_hull()?;
        self.check_commands()?;
        self.check_actuators()
    }

    fn check_numbers(&self) -> Result<(), InvalidCraft> {
        let wrong = |path: &str, value: f64, needed: &'static str| {
            Err(InvalidCraft::Number { path: String::from(path), value, needed })
        };
        for (parameter, value) in self.parameters() {
            let path = parameter.path.as_str();
            let name = path.rsplit('.').next().unwrap_or(path);
            if !value.is_finite() {
                return wrong(path, value, "a finite number is needed");
            }
            match name {
                "mass" | "i_z" | "lift_slope" | "rate" | "gain" | "transition_speed" | "slope"
                    if value <= 0.0 =>
                {
                    return wrong(path, value, "it must be greater than 0");
                }
                "x_udot" | "y_vdot" | "n_rdot" if value > 0.0 => {
                    return wrong(
                        path,
                        value,
                        "as a hydrodynamic derivative (SNAME) it must not be positive: added mass is its negative",
                    );
                }
                "x_udot" | "y_vdot" | "n_rdot" => {}
                _ if !parameter.signed && value < 0.0 => {
                    return wrong(path, value, "it must not be negative");
                }
                _ => {}
            }
        }
        for (name, value) in ["noise.u", "noise.v", "noise.r"].into_iter().zip(self.noise) {
            if !(value.is_finite() && value >= 0.0) {
                return wrong(name, value, "it must not be negative");
            }
        }
        if !(self.water_density.is_finite() && self.water_density > 0.0) {
            return wrong("water_density", self.water_density, "it must be greater than 0");
        }
        Ok(())
    }

    fn check_hull(&self) -> Result<(), InvalidCraft> {
        let hull = &self.hull;
        let least = hull.mass * hull.x_g * hull.x_g;
        if hull.i_z <= least {
            return Err(InvalidCraft::YawInertia { i_z: hull.i_z, least });
        }
        let modes =
            [(Mode::Normal, Some(1.0)), (Mode::Flying, self.flying.map(|flying| flying.added_mass_factor))];
        for (mode, added) in modes {
            let Some(added) = added else { continue };
            let [_, m22, m23, m33] = hull.mass_matrix_with(added);
            let determinant = m22 * m33 - m23 * m23;
            // Relative, because a determinant of the size of rounding errors is as singular as zero.
            if !(determinant.is_finite() && determinant > 1e-12 * m22 * m33) {
                return Err(InvalidCraft::MassMatrix { mode, determinant });
            }
        }
        match hull.size {
            None if hull.cross_flow > 0.0 => Err(InvalidCraft::NoSize { what: "drag.cross_flow" }),
            None => Ok(()),
            Some(size) => {
                for (name, value) in ["hull.length", "hull.beam", "hull.draught"].into_iter().zip(size) {
                    if !(value.is_finite() && value > 0.0) {
                        let needed = "it must be greater than 0";
                        return Err(InvalidCraft::Number { path: String::from(name), value, needed });
                    }
                }
                Ok(())
            }
        }
    }

    fn check_commands(&self) -> Result<(), InvalidCraft> {
        if self.commands.is_empty() {
            return Err(InvalidCraft::Nothing { what: "command" });
        }
        check_names("command", self.commands.iter().map(|command| command.name.as_str()))?;
        for (index, command) in self.commands.iter().enumerate() {
            let [low, high] = command.limits;
            let neutral = command.neutral;
            if !(low.is_finite() && high.is_finite() && low < high && (low..=high).contains(&neutral)) {
                let path = format!("command.{}.limits", command.name);
                return Err(InvalidCraft::Limits { path, low, high, neutral });
            }
            let used = self.servos().any(|(_, servo)| servo.order.terms.iter().any(|term| term.0 == index));
            if !used {
                return Err(InvalidCraft::Unused { name: command.name.clone() });
            }
        }
        Ok(())
    }

    fn normal_forces(&self) -> impl Iterator<Item = (&str, &NormalForce)> {
        self.rudders.iter().filter_map(|rudder| match &rudder.law {
            RudderLaw::Normal(normal) => Some((rudder.name.as_str(), normal)),
            RudderLaw::Linear(_) | RudderLaw::Sine(_) => None,
        })
    }

    /// All servos with their paths.
    pub(super) fn servos(&self) -> impl Iterator<Item = (String, &Servo)> {
        let thrusters = self.thrusters.iter().flat_map(|thruster| {
            let path = format!("thruster.{}", thruster.name);
            let steering = thruster.steering.as_ref().map(|servo| (format!("{path}.steering"), servo));
            core::iter::once((path, &thruster.servo)).chain(steering)
        });
        let rudders = self.rudders.iter().map(|rudder| (format!("rudder.{}", rudder.name), &rudder.servo));
        thrusters.chain(rudders)
    }

    fn check_actuators(&self) -> Result<(), InvalidCraft> {
        if self.thrusters.is_empty() {
            return Err(InvalidCraft::Nothing { what: "thruster" });
        }
        check_names("thruster", self.thrusters.iter().map(|thruster| thruster.name.as_str()))?;
        check_names("rudder", self.rudders.iter().map(|rudder| rudder.name.as_str()))?;
        let given = self.servos().count();
        if given > MAX_SERVOS {
            return Err(InvalidCraft::Servos { given });
        }
        let thrusters = self.thrusters.iter().map(|t| (format!("thruster.{}.position", t.name), t.position));
        let rudders = self.normal_forces().map(|(name, r)| (format!("rudder.{name}.position"), r.position));
        if let Some([length, beam, _]) = self.hull.size {
            let half = [0.5 * length, 0.5 * beam];
            for (path, position) in thrusters.chain(rudders) {
                // A rudder stock or a water jet may be just behind the length between perpendiculars.
                if position[0].abs() > 1.1 * half[0] || position[1].abs() > 1.1 * half[1] {
                    return Err(InvalidCraft::Outside { path, position, half });
                }
            }
        }
        for thruster in &self.thrusters {
            for (key, value) in [
                ("dead_band", Some(thruster.dead_band)),
                ("diameter", thruster.diameter),
                ("force_noise", thruster.force_noise),
            ] {
                if let Some(value) = value.filter(|value| !(value.is_finite() && *value >= 0.0)) {
                    let path = format!("thruster.{}.{key}", thruster.name);
                    return Err(InvalidCraft::Number { path, value, needed: "it must not be negative" });
                }
            }
        }
        for (name, rudder) in self.normal_forces() {
            if !(rudder.area.is_finite() && rudder.area > 0.0) {
                let path = format!("rudder.{name}.area");
                let needed = "it must be greater than 0";
                return Err(InvalidCraft::Number { path, value: rudder.area, needed });
            }
            if let Some(thruster) = rudder.thruster.and_then(|of| self.thrusters.get(of))
                && thruster.diameter.is_none_or(|diameter| diameter <= 0.0)
            {
                let (thruster, rudder) = (thruster.name.clone(), String::from(name));
                return Err(InvalidCraft::NoDiameter { thruster, rudder });
            }
        }
        for (path, servo) in self.servos() {
            let [low, high] = servo.order.limits;
            if low >= high || low.is_nan() || high.is_nan() {
                let path = format!("{path}.limits");
                return Err(InvalidCraft::Limits { path, low, high, neutral: 0.0 });
            }
            let is_linear = |law: &RudderLaw| matches!(law, RudderLaw::Linear(_));
            let rudder =
                path.strip_prefix("rudder.").and_then(|name| self.rudders.iter().find(|r| r.name == name));
            let is_angle =
                path.ends_with(".steering") || rudder.is_some_and(|rudder| !is_linear(&rudder.law));
            let reached = self.reach(servo);
            if is_angle && reached > PI * 1.001 {
                return Err(InvalidCraft::Degrees { path: format!("{path}.order"), angle: reached });
            }
        }
        Ok(())
    }

    /// Time after which the actuators have forgotten their positions \[s\]: the longest time for the whole range at the limit
    /// of the rate, and three time constants.
    pub fn settling_time(&self) -> f64 {
        let time = |servo: &Servo| {
            let range = 2.0 * self.reach(servo);
            3.0 * servo.lag + servo.rate.map_or(0.0, |rate| range / rate)
        };
        self.servos().map(|(_, servo)| time(servo)).fold(0.0, f64::max)
    }

    /// Largest magnitude of an order within the limits of the commands.
    fn reach(&self, servo: &Servo) -> f64 {
        let ends = |sign: f64| {
            let each = servo.order.terms.iter().map(|&(c, neutral, gain)| {
                let [low, high] = self.commands[c].limits;
                let (a, b) = (gain * (low - neutral), gain * (high - neutral));
                if sign > 0.0 { a.max(b) } else { a.min(b) }
            });
            each.sum::<f64>().clamp(servo.order.limits[0], servo.order.limits[1]).abs()
        };
        ends(1.0).max(ends(-1.0))
    }
}

fn check_names<'a>(kind: &'static str, names: impl Iterator<Item = &'a str>) -> Result<(), InvalidCraft> {
    let names: Vec<&str> = names.collect();
    for (i, name) in names.iter().enumerate() {
        if name.trim().is_empty() || names[..i].contains(name) {
            return Err(InvalidCraft::Name { kind, name: String::from(name.trim()) });
        }
    }
    Ok(())
}
