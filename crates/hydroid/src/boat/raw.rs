//! From the values that are sent and logged to those of a model.

use serde::Serialize;

use super::Boat;
use crate::log::units::Unit;
use crate::log::{Channel, ChannelSpec};

/// The raw values of an input: as they are sent to the actuator and logged. The value of the model is
///
/// ```text
/// factor (raw - offset)
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
    /// The raw value of a value of the model, to six decimals: a limit is not exceeded by a rounding.
    pub fn raw(&self, model: f64) -> f64 {
        (1e6 * (model / self.factor + self.offset)).round() / 1e6 + 0.0
    }
}

impl Boat {
    /// Raw values of an input: by its unit and scale, else by its column in the logs; `None` if they are those of the model.
    pub fn raw_input(&self, channel: &Channel, column: Option<&ChannelSpec>) -> Option<Raw> {
        let input = self.inputs.get(&channel.name);
        let raw = if let Some(input) = input.filter(|input| input.scale.is_some() || input.unit.is_some()) {
            let formula = input.formula(channel).ok()?;
            let unit = input.unit.clone().unwrap_or_else(|| channel.unit.clone());
            Raw { unit, offset: formula.offset, factor: formula.factor }
        } else {
            let column = column?;
            let unit = column.unit.as_deref().and_then(|unit| Unit::parse(unit).ok());
            let si = unit.as_ref().filter(|_| !column.is_number).map_or(1.0, |unit| unit.factor);
            let text = match unit {
                Some(unit) => unit.text,
                // Without a scale, the unit of the column is that of the model.
                None if column.scale == 1.0 => channel.unit.clone(),
                None => String::new(),
            };
            Raw { unit: text, offset: column.offset, factor: column.scale * si }
        };
        (raw.offset != 0.0 || raw.factor != 1.0).then_some(raw)
    }
}
