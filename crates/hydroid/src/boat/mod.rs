//! What a vessel and its inputs are: the section `[boat]` of `hydroid.toml`, which every model file contains.
//!
//! The [`Role`] of an input decides how trials, controllers and simulations use it. A role that is not stated is found from
//! name and unit ([`Boat::find`]), or from the response of a model ([`find_roles`](crate::plant::find_roles)); its
//! [`Evidence`] is kept.
//!
//! ```
//! use hydroid::boat::{Boat, Role};
//! use hydroid::log::Channel;
//!
//! let mut boat = Boat::default();
//! boat.state(&[("x1".to_owned(), Role::Steering)].into(), &["x1", "n"])?;
//! boat.find(&[Channel::new("x1", ""), Channel::new("n", "rad/s")]);
//! assert_eq!(boat.role("x1"), Some(Role::Steering));
//! assert_eq!(boat.role("n"), Some(Role::Propulsion));
//! # Ok::<(), hydroid::boat::BoatError>(())
//! ```

mod autopilot;
mod error;
mod find;
mod particulars;
mod raw;
mod read;
mod text;
mod values;

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::key::key;
use crate::toml_file::nearest;

pub(crate) use autopilot::FUNCTIONS;
pub use autopilot::{Output, Range};
pub use error::BoatError;
pub use particulars::Particulars;
pub use raw::Raw;
pub use values::{HARD_OVER_DEG, Value, check_firm};

/// Roles by name of input, as they are stated.
pub type Roles = BTreeMap<String, Role>;

/// A vessel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Boat {
    /// Its particulars.
    #[serde(skip_serializing_if = "Particulars::is_empty")]
    pub particulars: Particulars,
    /// Its inputs by name; an input that is not named has no known role.
    pub inputs: BTreeMap<String, Input>,
}

/// An input of a vessel. What is not stated or found is not known.
///
/// The values are those that are sent to the actuator and logged, in `unit`: pulse widths, degrees, percent. The model's input is
///
/// ```text
/// (raw - neutral) / scale    with a scale, a pure number
/// raw in the SI unit         without one
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Input {
    /// What it does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub role: Option<Role>,
    /// Unit of the raw values; the unit of the model's input if it is not stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Raw value without effect: that of a vessel at rest, of a rudder amidships.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub neutral: Option<f64>,
    /// Lowest and highest raw value that the actuator takes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limits: Option<[f64; 2]>,
    /// Raw change that is 1 in the model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// How the properties were found that are not stated.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub found: BTreeMap<Property, Evidence>,
}

/// A property of an input that can be found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Property {
    /// [`Input::role`].
    Role,
    /// [`Input::neutral`].
    Neutral,
    /// [`Input::limits`].
    Limits,
    /// [`Input::scale`].
    Scale,
}

/// What an input does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// It pushes the vessel and does not turn it: a propeller, a throttle.
    Propulsion,
    /// It turns the vessel and does not push it: a rudder, the angle of a steerable thruster.
    Steering,
    /// It may do both: one of two propellers, a bow thruster.
    Thruster,
    /// It acts on the vessel and cannot be commanded: the wind. Its value in plans and trials is 0.
    Disturbance,
    /// It is set for a voyage and not commanded: a draught, a depth of water. Its value in plans and trials is the middle of its
    /// range.
    Setting,
}

impl Role {
    /// All roles.
    pub const ALL: [Self; 5] =
        [Self::Propulsion, Self::Steering, Self::Thruster, Self::Disturbance, Self::Setting];

    /// Name in files and options.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Propulsion => "propulsion",
            Self::Steering => "steering",
            Self::Thruster => "thruster",
            Self::Disturbance => "disturbance",
            Self::Setting => "setting",
        }
    }

    /// Whether the input may push the vessel.
    pub const fn pushes(self) -> bool {
        matches!(self, Self::Propulsion | Self::Thruster)
    }

    /// Whether the input may turn the vessel.
    pub const fn turns(self) -> bool {
        matches!(self, Self::Steering | Self::Thruster)
    }

    /// Whether the input is commanded.
    pub const fn is_commanded(self) -> bool {
        !matches!(self, Self::Disturbance | Self::Setting)
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How a property was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Evidence {
    /// The name of the input.
    Name,
    /// Its unit: an angle steers.
    Unit,
    /// The actuators of a vessel file.
    Actuators,
    /// The response of the model: what a change of the input does to the motion.
    Response(String),
    /// The name of the input, which the response of the model contradicts.
    Contradicted(String),
    /// The input was constant in the logs, or a shaft speed varied by less than 2 % of it.
    Constant,
    /// Parameters of the autopilot, as in `SERVO1_FUNCTION = 73`.
    Parameter(String),
    /// What is usual, as 1500 us for the neutral pulse width.
    Convention(String),
    /// Weak: what the logs contain, as the extremes or the most common value of a command. It holds in simulations, and not on
    /// board.
    Log(String),
}

impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name => f.write_str("its name"),
            Self::Unit => f.write_str("its unit, an angle"),
            Self::Actuators => f.write_str("the actuators of the vessel file"),
            Self::Response(text) => write!(f, "the response of the model: {text}"),
            Self::Contradicted(text) => {
                write!(
                    f,
                    "its name, but the response of the model contradicts it: {text}. State it with {}",
                    key("role")
                )
            }
            Self::Constant => f.write_str("it was constant, or nearly so, in the logs"),
            Self::Parameter(text) | Self::Convention(text) | Self::Log(text) => f.write_str(text),
        }
    }
}

impl FromStr for Role {
    type Err = BoatError;

    fn from_str(text: &str) -> Result<Self, BoatError> {
        let known = Self::ALL.into_iter().find(|known| known.name() == text);
        known.ok_or_else(|| BoatError::UnknownRole(text.to_owned()))
    }
}

/// Roles as an option states them: `delta=steering,wind_x=disturbance`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct StatedRoles(pub Roles);

impl StatedRoles {
    /// The roles of an option that may be left out.
    pub fn given(option: &Option<Self>) -> Roles {
        option.clone().unwrap_or_default().0
    }
}

impl FromStr for StatedRoles {
    type Err = BoatError;

    fn from_str(text: &str) -> Result<Self, BoatError> {
        let mut roles = Roles::new();
        for stated in text.split(',') {
            let (input, role) = stated.split_once('=').ok_or_else(|| BoatError::NoRole(stated.to_owned()))?;
            let role: Role = role.trim().parse()?;
            let name = input.trim().to_owned();
            if let Some(other) = roles.insert(name.clone(), role).filter(|other| *other != role) {
                return Err(BoatError::TwoRoles { name, roles: [other, role] });
            }
        }
        Ok(Self(roles))
    }
}

impl Boat {
    /// Whether nothing is known.
    pub fn is_empty(&self) -> bool {
        self.inputs.is_empty()
    }

    /// The role of an input; `None` if it is not known.
    pub fn role(&self, input: &str) -> Option<Role> {
        self.inputs.get(input).and_then(|input| input.role)
    }

    /// Adds a role that was found, where none is known.
    pub fn found_role(&mut self, input: &str, role: Role, evidence: Evidence) {
        let known = self.inputs.entry(input.to_owned()).or_default();
        if known.role.is_none() {
            known.role = Some(role);
            known.found.insert(Property::Role, evidence);
        }
    }

    /// Doubts a role that the response of the model contradicts. A unit says less than the response, which then decides.
    pub(crate) fn doubt(&mut self, input: &str, role: Role, response: String) {
        let Some(known) = self.inputs.get_mut(input) else { return };
        match known.found.get(&Property::Role) {
            Some(Evidence::Unit) => {
                known.role = Some(role);
                known.found.insert(Property::Role, Evidence::Response(response));
            }
            Some(Evidence::Name) => {
                known.found.insert(Property::Role, Evidence::Contradicted(response));
            }
            _ => (),
        }
    }

    /// Why the role of an input is in doubt.
    pub fn contradiction(&self, input: &str) -> Option<&str> {
        match self.inputs.get(input)?.found.get(&Property::Role)? {
            Evidence::Contradicted(response) => Some(response),
            _ => None,
        }
    }

    /// Checks that the role of an input is known and not in doubt.
    pub(crate) fn check_role(&self, input: &str) -> Result<(), BoatError> {
        let why = match (self.role(input), self.contradiction(input)) {
            (Some(_), None) => return Ok(()),
            (_, Some(response)) => {
                format!("its name says one, and the response of the model another ({response})")
            }
            (None, None) => "it is not known".to_owned(),
        };
        Err(BoatError::RoleNotKnown { input: input.to_owned(), why })
    }

    /// States roles of inputs, in place of those that are known.
    ///
    /// # Errors
    /// If there is no such input.
    pub fn state(&mut self, roles: &Roles, inputs: &[&str]) -> Result<(), BoatError> {
        for (input, &role) in roles {
            let known = self.inputs.entry(input.clone()).or_default();
            known.role = Some(role);
            known.found.remove(&Property::Role);
        }
        self.check(inputs)
    }

    /// Checks that all inputs of the boat are among those of a model or log.
    ///
    /// # Errors
    /// The first one that is not.
    pub fn check(&self, inputs: &[&str]) -> Result<(), BoatError> {
        self.particulars.check()?;
        match self.inputs.keys().find(|name| !inputs.contains(&name.as_str())) {
            None => Ok(()),
            Some(name) => Err(BoatError::UnknownInput {
                name: name.clone(),
                nearest: nearest(name, inputs.iter().copied()),
                known: inputs.join(", "),
            }),
        }
    }
}
