//! The inputs of a log in the unit of the model.

use super::values::Formula;
use super::{Boat, BoatError};
use crate::log::units::Unit;
use crate::log::{Channel, ChannelSpec};

impl Boat {
    /// Whether the model's input is not the logged value in the SI unit.
    pub fn is_scaled(&self) -> bool {
        self.inputs.values().any(|input| input.scale.is_some())
    }

    /// Puts the formula $(raw - neutral) / scale$ into the columns of inputs that have a scale. They state raw values.
    ///
    /// # Errors
    /// If the numbers of an input contradict each other, or a column has a formula or a unit that contradicts the boat.
    pub fn read(&self, inputs: &mut [ChannelSpec]) -> Result<(), BoatError> {
        for spec in inputs {
            let Some(input) = self.inputs.get(&spec.name) else { continue };
            let name = || spec.name.clone();
            if input.scale.is_none() {
                if spec.offset != 0.0 && (input.neutral.is_some() || input.limits.is_some()) {
                    return Err(BoatError::TwoFormulas { name: name(), spec: spec.to_string() });
                }
                continue;
            }
            if spec.offset != 0.0 || spec.scale != 1.0 || spec.is_number {
                return Err(BoatError::TwoFormulas { name: name(), spec: spec.to_string() });
            }
            let Formula { offset, factor } = input.formula(&Channel::new(spec.name.as_str(), ""))?;
            match (&spec.unit, &input.unit) {
                (Some(stated), Some(own)) if !is_same(stated, own) => {
                    return Err(BoatError::OtherUnit {
                        name: name(),
                        spec: spec.to_string(),
                        unit: own.clone(),
                    });
                }
                (None, own) => spec.unit.clone_from(own),
                _ => {}
            }
            (spec.offset, spec.scale, spec.is_number) = (offset, factor, true);
        }
        Ok(())
    }
}

fn is_same(one: &str, other: &str) -> bool {
    let parsed = |text: &str| Unit::parse(text).ok().map(|unit| (unit.si, unit.factor.to_bits()));
    one == other || parsed(one).is_some_and(|one| Some(one) == parsed(other))
}
