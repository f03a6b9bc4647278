//! Settings of a simulated log: a vessel, or any model as a plant.
// Help texts come from the comments of the options; brackets are units.
#![expect(rustdoc::broken_intra_doc_links, reason = "the comments are help texts, too")]

mod drive;
mod plan;
mod plant;

use hydroid_core::craft::Craft;
use serde::Deserialize;

#[cfg(feature = "arguments")]
use super::value::numbers;
use super::{Duration, SettingError};
use crate::boat::StatedRoles;
use crate::excitation::{Circle, Excitation, LawnMower, LowSpeed, PropellerRudder, Turn};
use crate::key::key;
use crate::model::Model;
use crate::plant::{InputMap, PlantError, current_before};
use crate::simulate::{Options, SimulateError};
use crate::written;
use drive::commands_of;
use plan::GivenCommands;

pub use drive::Drive;
pub use plan::{ModelPlan, Plan};
pub use plant::{Plant, PlantKind};

/// Options of a simulated log, of the command and of Python.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[cfg_attr(feature = "arguments", derive(clap::Args), group(skip))]
pub struct Simulate {
    /// Duration [s] (default: 7200, or as long as the commands of a file last)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", allow_negative_numbers = true))]
    pub duration: Option<f64>,
    /// Sample time of a vessel [s] (default: 0.1); an identified model has its own
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", allow_negative_numbers = true))]
    pub dt: Option<f64>,
    /// Integration step of a vessel [s] (default: 0.01); the sample time is a multiple of it
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", allow_negative_numbers = true))]
    pub step: Option<f64>,
    /// Seed of commands and noise; the same seed gives the same bytes
    #[cfg_attr(feature = "arguments", arg(long, default_value_t))]
    pub seed: u64,
    /// Factor on the measurement noise of the vessel; 0: none (default: 1)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "FACTOR", allow_negative_numbers = true))]
    pub noise: Option<f64>,
    /// Velocity of a constant current: north,east [m/s]; pose and velocities are over ground (default: still water; with a
    /// log, the estimate of the model from the samples before the start)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N,E", value_parser = numbers::<2>, allow_hyphen_values = true))]
    #[serde(deserialize_with = "crate::config::value::read_numbers")]
    pub current: Option<[f64; 2]>,
    /// Identified model: factor on its process noise, from the growth of its errors; 0: none (default: 0)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "FACTOR", allow_negative_numbers = true))]
    pub process_noise: Option<f64>,
    /// Identified model and a log: time from the start of the log at which the simulation starts [s]
    #[cfg_attr(feature = "arguments", arg(long, value_name = "TIME"))]
    pub start: Option<Duration>,
    /// Roles of inputs: propulsion, steering, thruster, disturbance or setting, as in delta=steering,wind=disturbance
    /// (default: those of the model, found from names, units and its response)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "INPUT=ROLE,.."))]
    #[serde(deserialize_with = "written::optional")]
    pub role: Option<StatedRoles>,
    /// Identified model: inputs that push the vessel, for mixed; -NAME pushes astern (default: by the roles of the inputs)
    #[cfg_attr(
        feature = "arguments",
        arg(long, value_delimiter = ',', value_name = "INPUTS", allow_hyphen_values = true)
    )]
    #[serde(deserialize_with = "written::list")]
    pub push: Vec<String>,
    /// Identified model: inputs that turn the vessel to starboard, for mixed; -NAME turns to port (default: by the roles of the inputs)
    #[cfg_attr(
        feature = "arguments",
        arg(long, value_delimiter = ',', value_name = "INPUTS", allow_hyphen_values = true)
    )]
    #[serde(deserialize_with = "written::list")]
    pub turn: Vec<String>,
    /// Lawn-mower: length of a leg [m]
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M", allow_negative_numbers = true))]
    pub leg: Option<f64>,
    /// Lawn-mower: distance between legs [m]
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M", allow_negative_numbers = true))]
    pub spacing: Option<f64>,
    /// Lawn-mower: speeds of the legs [m/s], separated by commas (default: random)
    #[cfg_attr(feature = "arguments", arg(long, value_delimiter = ',', value_name = "M_S"))]
    #[serde(deserialize_with = "written::list")]
    pub leg_speeds: Vec<f64>,
    /// Lawn-mower: sharp turns between legs instead of half circles
    #[cfg_attr(feature = "arguments", arg(long))]
    pub sharp_turns: bool,
    /// Circle: radius [m]
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M", allow_negative_numbers = true))]
    pub radius: Option<f64>,
    /// Circle: speed [m/s]. Low-speed: upper limit of the speed [m/s]
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M_S", allow_negative_numbers = true))]
    pub speed: Option<f64>,
}

/// Default duration \[s\].
const DURATION_S: f64 = 7_200.0;

/// Default sample time of a vessel \[s\].
const DT_S: f64 = 0.1;

fn wrong<T>(message: String) -> Result<T, SettingError> {
    Err(SettingError::Option(message))
}

impl Simulate {
    /// The simulation of a plant under an excitation.
    ///
    /// # Errors
    /// If an option does not fit the plant or the excitation, or the commands of a log cannot be used.
    pub fn plan(&self, plant: &Plant, drive: &Drive) -> Result<Plan, SettingError> {
        match &plant.kind {
            PlantKind::Vessel(file) => self.of_vessel(plant, &file.craft, drive),
            PlantKind::Model(model) => {
                self.of_model(plant, model, drive).map(|plan| Plan::Model(Box::new(plan)))
            }
        }
    }

    fn of_vessel(&self, plant: &Plant, vessel: &Craft, drive: &Drive) -> Result<Plan, SettingError> {
        for (option, given) in [
            ("start", self.start.is_some()),
            ("process_noise", self.process_noise.is_some()),
            ("role", self.role.is_some()),
            ("push", !self.push.is_empty()),
            ("turn", !self.turn.is_empty()),
        ] {
            if given {
                return wrong(format!(
                    "{} needs an identified model (.safetensors): '{}' is a vessel",
                    key(option),
                    plant.name
                ));
            }
        }
        let (excitation, label) = self.excitation(vessel, drive)?;
        let dt_s = self.dt.unwrap_or(DT_S);
        let options = Options::new(vessel.clone(), excitation);
        let options = Options {
            duration_s: self
                .duration
                .or_else(|| options.excitation.natural_duration_s(dt_s))
                .unwrap_or(DURATION_S),
            dt_s,
            step_s: self.step.unwrap_or(options.step_s),
            seed: self.seed,
            noise_scale: self.noise.unwrap_or(1.0),
            current: self.current.unwrap_or_default(),
            ..options
        };
        Ok(Plan::Vessel { options: Box::new(options), label })
    }

    fn excitation(&self, vessel: &Craft, drive: &Drive) -> Result<(Excitation, String), SettingError> {
        let kind = drive.name();
        for (option, given, kinds) in [
            ("leg", self.leg.is_some(), &["lawn-mower"][..]),
            ("spacing", self.spacing.is_some(), &["lawn-mower"]),
            ("leg_speeds", !self.leg_speeds.is_empty(), &["lawn-mower"]),
            ("sharp_turns", self.sharp_turns, &["lawn-mower"]),
            ("radius", self.radius.is_some(), &["circle"]),
            ("speed", self.speed.is_some(), &["circle", "low-speed", "lawn-mower"]),
        ] {
            if given && !kinds.contains(&kind) {
                return wrong(format!(
                    "{} cannot be used with {}: it needs {}",
                    key(option),
                    key("excitation").is(kind),
                    kinds.join(", ")
                ));
            }
        }
        let excitation = match drive {
            Drive::Log(log) => {
                return Ok((
                    Excitation::Given(commands_of(
                        log,
                        &PropellerRudder::new(vessel).map_err(SimulateError::from)?,
                    )?),
                    String::from("commands"),
                ));
            }
            Drive::Kind(kind) => match kind.as_str() {
                "mixed" => Excitation::Mixed,
                "low-speed" => Excitation::LowSpeed(
                    self.speed.map_or_else(LowSpeed::default, |ceiling| LowSpeed { ceiling }),
                ),
                "lawn-mower" => Excitation::LawnMower(LawnMower {
                    leg: self.leg,
                    spacing: self.spacing,
                    turn: if self.sharp_turns { Turn::Sharp { speed: self.speed } } else { Turn::Arc },
                    speeds: self.leg_speeds.clone(),
                }),
                "circle" => Excitation::Circle(Circle { radius: self.radius, speed: self.speed }),
                other => {
                    return wrong(format!(
                        "'{other}' is not an excitation: write mixed, low-speed, lawn-mower, circle, or the name of a CSV file with time and the two commands"
                    ));
                }
            },
        };
        Ok((excitation, kind.to_owned()))
    }

    fn of_model(&self, plant: &Plant, model: &Model, drive: &Drive) -> Result<ModelPlan, SettingError> {
        self.check_for_model(plant, model, drive)?;
        let dt = self.dt.unwrap_or(model.description.dt);
        let model = model
            .clone()
            .at_step(dt)
            .map_err(PlantError::from)?
            .with_roles(&StatedRoles::given(&self.role))?;
        let mut notes = Vec::new();
        let commands = match drive {
            Drive::Kind(_) => GivenCommands::Mixed,
            Drive::Log(log) => self.commands_of_log(&model, log, &mut notes)?,
        };
        let current = match (self.current, &commands) {
            (Some(current), _) => current,
            (None, GivenCommands::Log { run, from }) => current_before(&model, run, *from),
            (None, GivenCommands::Mixed | GivenCommands::Rows(_)) => [0.0; 2],
        };
        // Given commands need no map.
        let map = match commands {
            GivenCommands::Mixed => Some(InputMap::with(&model, &self.push, &self.turn)?),
            GivenCommands::Rows(_) | GivenCommands::Log { .. } => None,
        };
        Ok(ModelPlan { model, map, commands, settings: self.clone(), current, notes })
    }

    fn check_for_model(&self, plant: &Plant, model: &Model, drive: &Drive) -> Result<(), SettingError> {
        if self.dt.is_some() && !model.is_vessel() {
            return wrong(plant.needs_a_vessel("dt"));
        }
        for (option, given) in [
            ("step", self.step.is_some()),
            ("leg", self.leg.is_some()),
            ("spacing", self.spacing.is_some()),
            ("leg_speeds", !self.leg_speeds.is_empty()),
            ("sharp_turns", self.sharp_turns),
            ("radius", self.radius.is_some()),
            ("speed", self.speed.is_some()),
        ] {
            if given {
                return wrong(format!(
                    "{} needs a vessel with one propeller and one rudder: '{}' has inputs of its own",
                    key(option),
                    plant.name
                ));
            }
        }
        match drive {
            Drive::Kind(kind) if kind != "mixed" => wrong(format!(
                "{} needs a vessel with one propeller and one rudder: with '{}' write mixed, or the name of a CSV file with time and its inputs",
                key("excitation").is(kind),
                plant.name
            )),
            Drive::Kind(_) | Drive::Log(_) => Ok(()),
        }
    }
}
