//! Roles, limits and neutral values of inputs as arguments.

use std::collections::BTreeMap;

use clap::Args as ClapArgs;
use hydroid::boat::{Roles, StatedRoles};
use hydroid::identify::GivenRanges;

use super::values::{NamedNumber, NamedRange};

/// Roles of inputs.
#[derive(Clone, Debug, Default, ClapArgs)]
pub struct RoleArgs {
    /// Roles of inputs: propulsion, steering, thruster, disturbance or setting, as in delta=steering,wind_x=disturbance
    /// (default: those of the model, found from names, units and its response)
    #[arg(long, value_name = "INPUT=ROLE,..")]
    pub role: Option<StatedRoles>,
}

impl RoleArgs {
    /// The roles by input.
    pub fn roles(&self) -> Roles {
        self.role.clone().unwrap_or_default().0
    }
}

/// Limits and neutral values of inputs.
#[derive(Clone, Debug, Default, ClapArgs)]
pub struct ValueArgs {
    /// Limits of a command, in the unit of the input in the boat, else of the model (default: those of the boat, 35 deg for a
    /// steering angle, or in simulations the range of the log). May be repeated
    #[arg(long, value_name = "NAME=LOW:HIGH", allow_hyphen_values = true)]
    pub limit: Vec<NamedRange>,
    /// Value of a command without effect, in the same unit (default: that of the boat, 1500 for pulses in us, 0 for physical
    /// quantities); value of an input that is not commanded, as of the wind (default: 0). May be repeated
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    pub neutral: Vec<NamedNumber>,
}

impl ValueArgs {
    /// The limits by input; the last ones of an input count.
    pub fn limits(&self) -> GivenRanges {
        self.limit.iter().map(|given| (given.name.clone(), given.range.clone())).collect()
    }

    /// The neutral values by input.
    pub fn neutrals(&self) -> BTreeMap<String, f64> {
        self.neutral.iter().map(|given| (given.name.clone(), given.number)).collect()
    }
}
