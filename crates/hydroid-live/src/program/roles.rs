//! Roles of inputs as arguments.

use clap::Args as ClapArgs;
use hydroid::boat::{Roles, StatedRoles};

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
