//! Assignment of measurements and commands to a model's channels.

use hydroid_core::vessel::VesselParams;

use super::controller::Observation;
use super::error::ClosedLoopError;
use crate::model::Description;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    /// One of `u`, `v`, `r`.
    Motion(usize),
    Force,
}

#[derive(Clone, Debug)]
pub(super) struct ChannelMap {
    columns: Vec<Column>,
    /// Indices of `u`, `v` and `r` in the outputs.
    pub(super) motion: [usize; 3],
}

impl ChannelMap {
    /// Checks that a model's channels and units fit a vessel.
    pub(super) fn of(model: &Description, vessel: &VesselParams) -> Result<Self, ClosedLoopError> {
        let known = [("u", "m/s"), ("v", "m/s"), ("r", "rad/s"), ("P_f", "N")];
        let mut columns = Vec::new();
        let mut motion = [None; 3];
        for (index, port) in model.outputs.iter().enumerate() {
            let (name, unit) = (port.channel.name.as_str(), port.channel.unit.as_str());
            let place = known.iter().position(|(own, _)| *own == name);
            let Some(place) = place.filter(|&place| place < 3 || vessel.propeller.force_measured) else {
                return Err(ClosedLoopError::Channels(format!(
                    "its output '{name}' is not measured on '{}', which measures u, v, r{}; identify with --outputs u,v,r",
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
            return Err(ClosedLoopError::Channels(format!(
                "it has the outputs {}, and control needs u, v and r: identify with --outputs u,v,r",
                list(model.outputs.iter().map(|port| port.channel.name.as_str()))
            )));
        };
        let commands = [&vessel.commands.propeller, &vessel.commands.rudder];
        if !model.inputs.iter().map(|port| &port.channel.name).eq(commands.iter().map(|c| &c.name)) {
            return Err(ClosedLoopError::Channels(format!(
                "its inputs are {}, and the commands of '{}' are {}; identify with --inputs {},{}",
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

    /// Fills `y` with the measurements, in the order of the outputs.
    pub(super) fn fill(&self, observation: &Observation<'_>, y: &mut [f64]) {
        for (y, column) in y.iter_mut().zip(&self.columns) {
            *y = match *column {
                Column::Motion(i) => observation.nu[i],
                Column::Force => observation.force,
            };
        }
    }
}

fn same_unit(name: &str, model: &str, plant: &str) -> Result<(), ClosedLoopError> {
    if model.is_empty() || plant.is_empty() || model == plant {
        return Ok(());
    }
    Err(ClosedLoopError::Channels(format!("'{name}' is in {model} in the model and in {plant} on the plant")))
}

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}
