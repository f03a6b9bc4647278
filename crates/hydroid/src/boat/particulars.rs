//! Particulars of a vessel.

use serde::{Deserialize, Serialize};

use super::BoatError;

/// Particulars of a vessel, those of the ship where the logs are those of a model. What is not stated is not known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Particulars {
    /// Name, for pages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Length between perpendiculars \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
    /// Beam \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beam: Option<f64>,
    /// Draught \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub draught: Option<f64>,
    /// Displacement \[kg\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub displacement: Option<f64>,
    /// Block coefficient.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub block_coefficient: Option<f64>,
    /// Scale of the model in the logs: lengths of the ship relative to those of the model; 1 for logs of the ship.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
}

impl Particulars {
    /// Whether nothing is stated.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The stated numbers: key, value and unit.
    pub fn numbers(&self) -> impl Iterator<Item = (&'static str, f64, &'static str)> {
        let all = [
            ("length", self.length, "m"),
            ("beam", self.beam, "m"),
            ("draught", self.draught, "m"),
            ("displacement", self.displacement, "kg"),
            ("block_coefficient", self.block_coefficient, ""),
            ("scale", self.scale, ""),
        ];
        all.into_iter().filter_map(|(key, value, unit)| Some((key, value?, unit)))
    }

    /// Length of the vessel in the logs \[m\].
    pub fn length_in_logs(&self) -> Option<f64> {
        Some(self.length? / self.scale.unwrap_or(1.0))
    }

    pub(super) fn check(&self) -> Result<(), BoatError> {
        match self.numbers().find(|(_, value, _)| !(value.is_finite() && *value > 0.0)) {
            None => Ok(()),
            Some((key, value, unit)) => Err(BoatError::Particular { key, value, unit }),
        }
    }
}
