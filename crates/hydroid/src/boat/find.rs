//! Roles from names and units.

use super::{Boat, Evidence, Input, Role};
use crate::log::Channel;

impl Boat {
    /// Adds the roles of inputs that follow from their names and units, where none is known.
    ///
    /// Several inputs with names of propulsion may also turn the vessel, as two propellers do: they are thrusters.
    pub fn find(&mut self, inputs: &[Channel]) {
        let found: Vec<Option<Input>> = inputs.iter().map(of).collect();
        let is_propulsion =
            |input: &Option<Input>| matches!(input, Some(input) if input.role == Role::Propulsion);
        let several = found.iter().filter(|input| is_propulsion(input)).count() > 1;
        for (channel, found) in inputs.iter().zip(found) {
            let Some(mut input) = found else { continue };
            if several && input.role == Role::Propulsion {
                input.role = Role::Thruster;
            }
            self.inputs.entry(channel.name.clone()).or_insert(input);
        }
    }
}

fn of(channel: &Channel) -> Option<Input> {
    let name = channel.name.to_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
    let is =
        |words: &[&str]| name.split(|letter: char| !letter.is_alphabetic()).any(|part| words.contains(&part));
    let by = |role, found| Some(Input { role, found: Some(found) });
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
