//! Roles of inputs as arguments.

use clap::Args as ClapArgs;
use hydroid::boat::{Roles, StatedRole};

/// Roles of inputs.
#[derive(Clone, Debug, Default, ClapArgs)]
pub struct RoleArgs {
    /// Roles of inputs: propulsion, steering, thruster, disturbance or setting, as in delta=steering,wind_x=disturbance
    /// (default: those of the model, found from names, units and its response)
    #[arg(long, value_delimiter = ',', value_name = "INPUT=ROLE")]
    pub role: Vec<StatedRole>,
}

impl RoleArgs {
    /// The roles by input; the last one of an input counts.
    pub fn roles(&self) -> Roles {
        self.role.iter().map(|stated| (stated.input.clone(), stated.role)).collect()
    }
}
