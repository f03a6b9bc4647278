//! Variables of a library and their kinds.

use crate::log::{Channel, Trajectory};

/// Kind of a variable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VariableKind {
    /// A quantity with meaningful powers: a speed, a rate, a force, a shaft speed.
    #[default]
    Plain,
    /// An angle \[rad\], for example of a rudder or of roll. Forces depend on its sine.
    Angle,
    /// A wind component `U^2 cos` or `U^2 sin` \[m^2/s^2\], in which the force is linear (Fossen 2021, section 10.1).
    Wind,
}

/// The variables of terms: outputs first, then inputs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Variables {
    outputs: Vec<VariableKind>,
    inputs: Vec<VariableKind>,
    surge: Option<u16>,
}

impl Variables {
    /// Variables of given kinds. The surge speed is the first of three or more outputs.
    pub fn new(outputs: Vec<VariableKind>, inputs: Vec<VariableKind>) -> Self {
        let surge = (outputs.len() >= 3).then_some(0);
        Self { outputs, inputs, surge }
    }

    /// Outputs and inputs of the plain kind.
    pub fn plain(outputs: usize, inputs: usize) -> Self {
        Self::new(vec![VariableKind::Plain; outputs], vec![VariableKind::Plain; inputs])
    }

    /// The variables of a run: angles by the unit `rad`, wind by the names of the log reader, the surge speed by the
    /// name `u`, else the first of three or more outputs.
    pub fn of(run: &Trajectory) -> Self {
        Self::of_channels(run.outputs.channels(), run.inputs.channels())
    }

    /// The variables of given output and input channels.
    pub fn of_channels(outputs: &[Channel], inputs: &[Channel]) -> Self {
        let kinds = |channels: &[Channel]| channels.iter().map(kind).collect();
        let variables = Self::new(kinds(outputs), kinds(inputs));
        let named = outputs.iter().position(|c| c.name.eq_ignore_ascii_case("u"));
        let named = named.and_then(|u| u16::try_from(u).ok());
        Self { surge: named.or(variables.surge), ..variables }
    }

    /// Number of variables, outputs and inputs together.
    pub fn len(&self) -> usize {
        self.outputs.len() + self.inputs.len()
    }

    /// Whether there are no variables.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The output of the surge speed, if any.
    pub fn surge(&self) -> Option<u16> {
        self.surge
    }

    /// All variables, up to the 65,536 that a term can address; programs have fewer.
    pub fn all(&self) -> impl Iterator<Item = (u16, VariableKind)> + Clone {
        (0..=u16::MAX).zip(self.outputs.iter().chain(&self.inputs).copied())
    }

    /// The outputs.
    pub fn outputs(&self) -> impl Iterator<Item = (u16, VariableKind)> + Clone {
        self.all().take(self.outputs.len())
    }

    /// The inputs.
    pub fn inputs(&self) -> impl Iterator<Item = (u16, VariableKind)> + Clone {
        self.all().skip(self.outputs.len())
    }
}

fn kind(channel: &Channel) -> VariableKind {
    match (channel.unit.as_str(), channel.name.as_str()) {
        ("rad", _) => VariableKind::Angle,
        ("m^2/s^2", "wind_x" | "wind_y") => VariableKind::Wind,
        _ => VariableKind::Plain,
    }
}
