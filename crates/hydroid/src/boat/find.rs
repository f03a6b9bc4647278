//! Roles from names and units.

use super::{Boat, Evidence, Role};
use crate::log::Channel;

const PUSHES: [&str; 6] = ["throttle", "thrust", "propeller", "rpm", "rps", "shaft"];
const TURNS: [&str; 6] = ["rudder", "helm", "steer", "tiller", "azimuth", "delta"];
const DISTURBANCES: [&str; 3] = ["wind", "wave", "swell"];
const SETTINGS: [&str; 5] = ["depth", "draught", "draft", "ballast", "trim"];
const SIDES: [&str; 5] = ["left", "right", "port", "starboard", "stbd"];

impl Boat {
    /// Adds the roles of inputs that follow from their names and units, where none is known.
    ///
    /// A name has words of propulsion, of steering, or of what is not commanded. A name with words of two kinds, as
    /// `rudder_rpm`, or of propulsion with the unit of an angle, as `propeller_pitch [deg]`, has no role. Several inputs with
    /// words of propulsion, or one with a side, may also turn the vessel, as two propellers do: they are thrusters.
    pub fn find(&mut self, inputs: &[Channel]) {
        let found: Vec<Option<(Role, Evidence)>> = inputs.iter().map(of).collect();
        let is_propulsion = |found: &&Option<(Role, Evidence)>| matches!(found, Some((Role::Propulsion, _)));
        let several = found.iter().filter(is_propulsion).count() > 1;
        for (channel, found) in inputs.iter().zip(found) {
            let Some((role, evidence)) = found else { continue };
            let role = if several && role == Role::Propulsion { Role::Thruster } else { role };
            self.found_role(&channel.name, role, evidence);
        }
    }
}

fn of(channel: &Channel) -> Option<(Role, Evidence)> {
    let name = channel.name.to_lowercase();
    let parts: Vec<&str> =
        name.split(|letter: char| !letter.is_alphabetic()).filter(|part| !part.is_empty()).collect();
    let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
    let is = |words: &[&str]| parts.iter().any(|part| words.contains(part));
    let is_angle = channel.unit == "rad";
    // The letter of the shaft speed also stands for north and for a moment.
    let is_n = parts.iter().all(|part| *part == "n" || SIDES.contains(part))
        && parts.contains(&"n")
        && matches!(channel.unit.as_str(), "" | "1" | "rps" | "rad/s");
    let is_windlass = has(&["windlass"]);
    let kinds = [
        (Role::Propulsion, has(&PUSHES) || is_n),
        (Role::Steering, has(&TURNS)),
        (Role::Disturbance, has(&DISTURBANCES) && !is_windlass),
        (Role::Setting, is(&SETTINGS)),
    ];
    let mut named = kinds.into_iter().filter(|(_, named)| *named).map(|(role, _)| role);
    let role = match (named.next(), named.next()) {
        // What is a thruster in the name may be steered.
        (Some(Role::Propulsion), None) if has(&["thruster"]) && !is_angle => Role::Thruster,
        (Some(Role::Propulsion), None) if is(&SIDES) && !is_angle => Role::Thruster,
        (Some(Role::Propulsion), None) if is_angle => return None,
        (Some(role), None) => role,
        (Some(_), Some(_)) => return None,
        (None, _) => return is_angle.then_some((Role::Steering, Evidence::Unit)),
    };
    Some((role, Evidence::Name))
}
