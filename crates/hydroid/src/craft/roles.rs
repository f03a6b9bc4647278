//! Roles of commands from the actuators that they move.

use hydroid_core::craft::{Craft, Servo};

use crate::boat::Role;

/// Least share of a force or lever that counts, relative to the sum over the actuators of the command.
const LEAST: f64 = 1e-6;

/// Force ahead, force aside and moment of a command on a vessel at rest, and the sums of their sizes.
#[derive(Clone, Copy, Default)]
struct Effect {
    sum: [f64; 3],
    size: [f64; 3],
    steers: bool,
}

/// The role of each command; none of a command that moves no actuator.
///
/// Rudders and the angles of thrusters steer. A command of thrusters pushes if their forces ahead do not cancel, and steers if
/// their moments do not.
pub(crate) fn roles(craft: &Craft) -> Vec<Option<Role>> {
    let mut effects = vec![Effect::default(); craft.commands.len()];
    for thruster in &craft.thrusters {
        let ([x, y], (sin, cos)) = (thruster.position, thruster.angle.sin_cos());
        for (command, gain) in gains(&thruster.servo) {
            let thrust = gain * thruster.forward;
            let effect = &mut effects[command];
            for (i, part) in
                [thrust * cos, thrust * sin, thrust * (x * sin - y * cos)].into_iter().enumerate()
            {
                effect.sum[i] += part;
                effect.size[i] += part.abs();
            }
        }
    }
    let rudders = craft.rudders.iter().map(|rudder| &rudder.servo);
    for servo in craft.thrusters.iter().filter_map(|thruster| thruster.steering.as_ref()).chain(rudders) {
        gains(servo).for_each(|(command, _)| effects[command].steers = true);
    }
    effects.into_iter().map(role).collect()
}

fn gains(servo: &Servo) -> impl Iterator<Item = (usize, f64)> + '_ {
    servo.order.terms.iter().map(|&(command, _, gain)| (command, gain)).filter(|(_, gain)| *gain != 0.0)
}

fn role(effect: Effect) -> Option<Role> {
    let thrust: f64 = effect.size.iter().sum();
    let [ahead, aside, moment] = effect.sum.map(|sum| sum.abs() > LEAST * thrust);
    match (ahead, aside || moment, effect.steers) {
        (false, false, false) => (thrust > 0.0).then_some(Role::Thruster),
        (true, false, false) => Some(Role::Propulsion),
        (false, false, true) => Some(Role::Steering),
        (false, true, _) if !aside => Some(Role::Steering),
        _ => Some(Role::Thruster),
    }
}
