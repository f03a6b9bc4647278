//! Vessel files with any set of actuators (TOML).
//!
//! A file states what is known of a boat: mass, hull, damping, commands, and for each thruster or rudder its place, its
//! order as a sum of commands, and its coefficients. Numbers are in SI units and radians, commands in the units that the
//! file states.
//! The equations are those of [`hydroid_core::craft`]. Annotated examples are in the folder `vessels`.
//!
//! ```
//! use hydroid::craft::parse;
//!
//! let text = r#"
//! name = "launch"
//! rigid_body = { mass = 400.0, x_g = 0.1, i_z = 900.0 }         # kg, m, kg m^2
//! added_mass = { x_udot = -30.0, y_vdot = -250.0, n_rdot = -500.0 }
//! drag = { linear = [60.0, 300.0, 400.0], quadratic = [20.0, 200.0, 300.0] }
//! command = [{ name = "throttle", limits = [-1.0, 1.0] }, { name = "steering", limits = [-1.0, 1.0] }]
//!
//! [[thruster]]
//! name = "port"
//! position = [-2.0, -0.6]                      # m: forward, starboard
//! order = { throttle = 100.0, steering = 30.0 } # rad/s for a command of 1
//! forward = 0.02                               # N for an order of 1
//! reverse = 0.01
//!
//! [[thruster]]
//! name = "starboard"
//! like = "port"
//! position = [-2.0, 0.6]
//! order = { throttle = 100.0, steering = -30.0 }
//! "#;
//! let file = parse(text, "launch.toml".as_ref())?;
//! assert_eq!(file.craft.commands.len(), 2);
//! assert_eq!(file.craft.thrusters.len(), 2);
//! # Ok::<(), hydroid::craft::CraftFileError>(())
//! ```

mod error;
mod file;
mod roles;
mod tables;
mod text;

use hydroid_core::craft::Craft;

pub use error::CraftFileError;
pub use file::{load, parse};
pub(crate) use roles::roles;

/// Names of the built-in vessels.
pub const BUILT_IN: [&str; 3] = ["simple", "hydrofoil", "hydrofoil-low-speed"];

/// A built-in vessel by its name, one of [`BUILT_IN`].
pub fn built_in(name: &str) -> Option<Craft> {
    match name {
        "simple" => Some(Craft::simple()),
        "hydrofoil" => Some(Craft::hydrofoil()),
        "hydrofoil-low-speed" => Some(Craft::hydrofoil_low_speed()),
        _ => None,
    }
}

/// Content of a vessel file.
#[derive(Clone, Debug, PartialEq)]
pub struct CraftFile {
    /// The vessel.
    pub craft: Craft,
    /// Units of the commands in the file.
    pub units: Vec<CommandUnit>,
    /// Numbers to estimate.
    pub estimate: Vec<Estimate>,
    /// Thrusters that share numbers with another one.
    pub ties: Vec<Tie>,
}

/// Unit of a command in the file.
///
/// The gains of orders are per unit of the file; a command that is an angle counts in radians.
#[derive(Clone, Debug, PartialEq)]
pub struct CommandUnit {
    /// Unit in the file.
    pub text: String,
    /// Unit of the stored values.
    pub stored: String,
    /// Stored value divided by the value in the file.
    pub factor: f64,
    /// Gain per stored unit divided by the gain in the file.
    pub gain: f64,
}

/// A number to estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Index in [`Craft::parameters`].
    pub index: usize,
    /// Standard deviation of the prior, relative to the given number.
    pub prior: f64,
    /// Standard deviation of the estimate, in the unit of the number; none before the estimation.
    pub deviation: Option<f64>,
}

/// A thruster that has the numbers of another one but for those that its table states.
#[derive(Clone, Debug, PartialEq)]
pub struct Tie {
    /// Index of the thruster.
    pub thruster: usize,
    /// Index of the other one.
    pub like: usize,
    /// Keys of the shared numbers.
    pub keys: Vec<&'static str>,
}

impl From<Craft> for CraftFile {
    /// A vessel whose commands have in the file the units in which they are stored.
    fn from(craft: Craft) -> Self {
        let unit =
            |text: &String| CommandUnit { text: text.clone(), stored: text.clone(), factor: 1.0, gain: 1.0 };
        let units = craft.commands.iter().map(|command| unit(&command.unit)).collect();
        Self { craft, units, estimate: Vec::new(), ties: Vec::new() }
    }
}

impl CraftFile {
    /// The numbers that an adaptation changes, as indices in [`Craft::parameters`]: those to estimate, or
    /// [all adaptable ones](Craft::adaptable) if the file names none. Numbers that are tied are in one group.
    pub fn learned(&self) -> Vec<Vec<usize>> {
        let representatives = self.representatives();
        let mut all: Vec<usize> = if self.estimate.is_empty() {
            self.craft.adaptable().into_iter().map(|index| representatives[index]).collect()
        } else {
            self.estimate.iter().map(|estimate| estimate.index).collect()
        };
        all.sort_unstable();
        all.dedup();
        let tied =
            |of: usize| (0..representatives.len()).filter(|&index| representatives[index] == of).collect();
        all.into_iter().map(tied).collect()
    }

    /// Sets numbers, in the order of [`Craft::parameters`]; those that are tied follow.
    pub fn set_numbers(&mut self, numbers: &[f64]) {
        let representatives = self.representatives();
        let tied: Vec<f64> = representatives.iter().map(|&of| numbers[of]).collect();
        self.craft = self.craft.with_numbers(&tied);
    }

    /// For each number the index of the one that it equals; its own index if it is free.
    pub fn representatives(&self) -> Vec<usize> {
        let parameters = self.craft.parameters();
        let find = |path: &str| parameters.iter().position(|(p, _)| p.path == path);
        (0..parameters.len())
            .map(|index| {
                let path = &parameters[index].0.path;
                let other = self.ties.iter().find_map(|tie| {
                    let name = |of: usize| format!("thruster.{}.", self.craft.thrusters[of].name);
                    let key = path.strip_prefix(&name(tie.thruster))?;
                    tie.keys.contains(&key).then(|| find(&format!("{}{key}", name(tie.like)))).flatten()
                });
                other.unwrap_or(index)
            })
            .collect()
    }
}
