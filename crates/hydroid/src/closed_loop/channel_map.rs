//! Assignment of the measured outputs of a plant to the outputs of a model.

use super::error::ClosedLoopError;
use super::options::Instruments;
use crate::key::key;
use crate::log::Channel;
use crate::model::Description;

#[derive(Clone, Debug)]
pub(super) struct ChannelMap {
    /// For each output of the model, its place among the measured ones.
    places: Vec<usize>,
    /// Indices of `u`, `v` and `r` in the outputs of the model.
    pub(super) motion: [usize; 3],
}

impl ChannelMap {
    /// Checks that the channels and units of a model fit those of a plant.
    pub(super) fn of(model: &Description, plant: &Instruments) -> Result<Self, ClosedLoopError> {
        let mut places = Vec::new();
        for port in &model.outputs {
            let Channel { name, unit } = &port.channel;
            let Some(place) = plant.measured.iter().position(|own| own.name == *name) else {
                return Err(ClosedLoopError::Channels(format!(
                    "its output '{name}' is not measured on '{}', which measures {}; identify with {}",
                    plant.name,
                    list(plant.measured.iter().map(|own| own.name.as_str())),
                    key("outputs").is("u,v,r")
                )));
            };
            same_unit(name, unit, &plant.measured[place].unit)?;
            places.push(place);
        }
        let known = [("u", "m/s"), ("v", "m/s"), ("r", "rad/s")];
        let motion = known.map(|(name, _)| model.outputs.iter().position(|port| port.channel.name == name));
        let [Some(u), Some(v), Some(r)] = motion else {
            return Err(ClosedLoopError::Channels(format!(
                "it has the outputs {}, and control needs u, v and r: identify with {}",
                list(model.outputs.iter().map(|port| port.channel.name.as_str())),
                key("outputs").is("u,v,r")
            )));
        };
        for ((name, needed), place) in known.into_iter().zip([u, v, r]) {
            same_unit(name, &model.outputs[place].channel.unit, needed)?;
        }
        let names = |channels: &mut dyn Iterator<Item = &Channel>| {
            channels.map(|channel| channel.name.clone()).collect::<Vec<String>>()
        };
        let (own, commands) =
            (names(&mut model.inputs.iter().map(|port| &port.channel)), names(&mut plant.commands.iter()));
        if own != commands {
            return Err(ClosedLoopError::Channels(format!(
                "its inputs are {}, and the commands of '{}' are {}; identify with {}",
                own.join(", "),
                plant.name,
                commands.join(", "),
                key("inputs").is(commands.join(","))
            )));
        }
        for (port, command) in model.inputs.iter().zip(&plant.commands) {
            same_unit(&command.name, &port.channel.unit, &command.unit)?;
        }
        Ok(Self { places, motion: [u, v, r] })
    }

    pub(super) fn len(&self) -> usize {
        self.places.len()
    }

    /// Fills `y` with the measurements, in the order of the outputs of the model.
    pub(super) fn fill(&self, measured: &[f64], y: &mut [f64]) {
        for (y, place) in y.iter_mut().zip(&self.places) {
            *y = measured[*place];
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
