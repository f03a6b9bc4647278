//! Roles from names and units.

use super::{Boat, Evidence, Role};
use crate::log::Channel;

impl Boat {
    /// Adds the roles of inputs that follow from their names and units, where none is known.
    ///
    /// Several inputs with names of propulsion may also turn the vessel, as two propellers do: they are thrusters.
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
    let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
    let is =
        |words: &[&str]| name.split(|letter: char| !letter.is_alphabetic()).any(|part| words.contains(&part));
    let by = |role, evidence| Some((role, evidence));
    if name.starts_with("wind") {
        return by(Role::Disturbance, Evidence::Name);
    }
    if has(&["rudder", "helm", "steer", "tiller", "azimuth"]) || is(&["delta"]) {
        return by(Role::Steering, Evidence::Name);
    }
    if channel.unit == "rad" {
        return by(Role::Steering, Evidence::Unit);
    }
    if has(&["thruster"]) {
        return by(Role::Thruster, Evidence::Name);
    }
    if has(&["throttle", "thrust", "propeller", "rpm", "shaft"]) || is(&["n", "rps"]) {
        return by(Role::Propulsion, Evidence::Name);
    }
    if is(&["depth", "draught", "draft"]) {
        return by(Role::Setting, Evidence::Name);
    }
    None
}
