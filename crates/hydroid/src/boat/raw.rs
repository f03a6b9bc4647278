//! From the values that are sent and logged to those of a model.

use serde::Serialize;

use crate::log::units::Unit;
use crate::model::{Description, Port};

/// The raw values of an input: as they are sent to the actuator and logged. The value of the model is
///
/// ```text
/// (raw - offset) factor
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Raw {
    /// Unit of the raw value; empty if it is not known.
    pub unit: String,
    /// Raw value that is 0 in the model.
    pub offset: f64,
    /// Change in the model for a raw change of 1.
    pub factor: f64,
}

impl Raw {
    /// The raw value of a value of the model.
    pub fn raw(&self, model: f64) -> f64 {
        model / self.factor + self.offset
    }
}

impl Description {
    /// Raw values of each input: by the boat, else by the column of the training logs; `None` if they are the values of the
    /// model.
    pub fn raw_inputs(&self) -> Vec<Option<Raw>> {
        self.inputs.iter().map(|port| self.raw_input(port)).collect()
    }

    fn raw_input(&self, port: &Port) -> Option<Raw> {
        let channel = &port.channel;
        let input = self.boat.inputs.get(&channel.name);
        let raw = match input.filter(|input| input.scale.is_some() || input.unit.is_some()) {
            Some(input) => {
                let formula = input.formula(channel).ok()?;
                let unit = input.unit.clone().unwrap_or_else(|| channel.unit.clone());
                Raw { unit, offset: formula.offset, factor: formula.factor }
            }
            None => {
                let mut columns = self.reading.selection.inputs.iter();
                let column = columns.find(|spec| spec.name == channel.name)?;
                let unit = column.unit.as_deref().and_then(|unit| Unit::parse(unit).ok());
                let si = unit.as_ref().filter(|_| !column.is_number).map_or(1.0, |unit| unit.factor);
                let text = match unit {
                    Some(unit) => unit.text,
                    // Without a scale, the unit of the column is that of the model.
                    None if column.scale == 1.0 => channel.unit.clone(),
                    None => String::new(),
                };
                Raw { unit: text, offset: column.offset, factor: column.scale * si }
            }
        };
        (raw.offset != 0.0 || raw.factor != 1.0).then_some(raw)
    }
}
