//! What a model calls what is measured.

use hydroid_core::vessel::VesselParams;

use super::error::SteerError;
use super::helm::Sight;
use crate::model::Description;

/// What stands in a column of a model's outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    /// One of `u`, `v`, `r`.
    Motion(usize),
    /// The force of the propeller.
    Force,
}

/// A model's outputs on a plant.
#[derive(Clone, Debug)]
pub(super) struct Channels {
    columns: Vec<Column>,
    /// Where `u`, `v` and `r` are.
    pub(super) motion: [usize; 3],
}

impl Channels {
    /// Of a model that is to steer a vessel.
    pub(super) fn of(model: &Description, vessel: &VesselParams) -> Result<Self, SteerError> {
        let known = [("u", "m/s"), ("v", "m/s"), ("r", "rad/s"), ("P_f", "N")];
        let mut columns = Vec::new();
        let mut motion = [None; 3];
        for (index, port) in model.outputs.iter().enumerate() {
            let (name, unit) = (port.channel.name.as_str(), port.channel.unit.as_str());
            let place = known.iter().position(|(own, _)| *own == name);
            let Some(place) = place.filter(|&place| place < 3 || vessel.propeller.force_measured) else {
                return Err(SteerError::Channels(format!(
                    "its output '{name}' is not measured on '{}', which has u, v, r{}: identify with --outputs u,v,r",
                    vessel.name,
                    if vessel.propeller.force_measured { ", P_f" } else { "" }
                )));
            };
            same_unit(name, unit, known[place].1)?;
            if let Some(of) = motion.get_mut(place) {
                *of = Some(index);
                columns.push(Column::Motion(place));
            } else {
                columns.push(Column::Force);
            }
        }
        let [Some(u), Some(v), Some(r)] = motion else {
            return Err(SteerError::Channels(format!(
                "it has the outputs {}, and steering needs u, v and r: identify with --outputs u,v,r",
                list(model.outputs.iter().map(|port| port.channel.name.as_str()))
            )));
        };
        let commands = [&vessel.commands.propeller, &vessel.commands.rudder];
        if !model.inputs.iter().map(|port| &port.channel.name).eq(commands.iter().map(|c| &c.name)) {
            return Err(SteerError::Channels(format!(
                "its inputs are {}, and the commands of '{}' are {}: identify with --inputs {},{}",
                list(model.inputs.iter().map(|port| port.channel.name.as_str())),
                vessel.name,
                list(commands.iter().map(|c| c.name.as_str())),
                commands[0].name,
                commands[1].name
            )));
        }
        for (port, command) in model.inputs.iter().zip(commands) {
            same_unit(&command.name, &port.channel.unit, &command.unit)?;
        }
        Ok(Self { columns, motion: [u, v, r] })
    }

    pub(super) fn len(&self) -> usize {
        self.columns.len()
    }

    /// What was measured, as the model has its outputs.
    pub(super) fn fill(&self, sight: &Sight<'_>, y: &mut [f64]) {
        for (y, column) in y.iter_mut().zip(&self.columns) {
            *y = match *column {
                Column::Motion(i) => sight.nu[i],
                Column::Force => sight.force,
            };
        }
    }
}

fn same_unit(name: &str, model: &str, plant: &str) -> Result<(), SteerError> {
    if model.is_empty() || plant.is_empty() || model == plant {
        return Ok(());
    }
    Err(SteerError::Channels(format!("it has '{name}' in {model}, the plant in {plant}")))
}

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}
