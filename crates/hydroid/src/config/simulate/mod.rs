//! Settings of a simulated log: a vessel, or any model as a plant.

mod drive;
mod plan;
mod plant;

use hydroid_core::vessel::VesselParams;
use serde::Deserialize;

use super::{Duration, SettingError};
use crate::boat::Roles;
use crate::excitation::{Circle, Excitation, LawnMower, LowSpeed, Turn};
use crate::key::key;
use crate::model::Model;
use crate::plant::{InputMap, PlantError, current_before};
use crate::simulate::Options;
use crate::written;
use drive::commands_of;
use plan::GivenCommands;

pub use drive::Drive;
pub use plan::{ModelPlan, Plan};
pub use plant::{Plant, PlantKind};

/// Settings of a simulated log.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Simulate {
    /// Duration \[s\]; default 7,200 s, or as long as given commands last.
    pub duration: Option<f64>,
    /// Sample time of a vessel \[s\]; default 0.1 s.
    pub dt: Option<f64>,
    /// Integration step of a vessel with one propeller and one rudder \[s\]; default 0.01 s.
    pub step: Option<f64>,
    /// Seed of commands and noise.
    pub seed: u64,
    /// Factor on the measurement noise.
    pub noise: f64,
    /// Velocity of the water, north and east \[m/s\]; default still water or, with a log, the estimate of the model.
    pub current: Option<[f64; 2]>,
    /// Factor on the process noise of a model.
    pub process_noise: f64,
    /// Time from the start of a log at which the simulation of a model starts.
    pub start: Option<Duration>,
    /// Roles of inputs, in place of those of the model.
    #[serde(deserialize_with = "written::table")]
    pub role: Roles,
    /// Inputs that push the vessel, for random commands of a model; `-NAME` pushes astern. Default: by the roles of the inputs.
    pub push: Vec<String>,
    /// Inputs that turn the vessel to starboard; `-NAME` turns to port. Default: by the roles of the inputs.
    pub turn: Vec<String>,
    /// Lawn-mower: length of a leg \[m\].
    pub leg: Option<f64>,
    /// Lawn-mower: distance between legs \[m\].
    pub spacing: Option<f64>,
    /// Lawn-mower: speeds of the legs \[m/s\]; random if empty.
    pub leg_speeds: Vec<f64>,
    /// Lawn-mower: sharp turns instead of half circles.
    pub sharp_turns: bool,
    /// Circle: radius \[m\].
    pub radius: Option<f64>,
    /// Circle: speed. Low-speed: upper limit of the speed. Lawn-mower with sharp turns: speed between legs \[m/s\].
    pub speed: Option<f64>,
}

impl Default for Simulate {
    fn default() -> Self {
        Self {
            duration: None,
            dt: None,
            step: None,
            seed: 0,
            noise: 1.0,
            current: None,
            process_noise: 0.0,
            start: None,
            role: Roles::new(),
            push: Vec::new(),
            turn: Vec::new(),
            leg: None,
            spacing: None,
            leg_speeds: Vec::new(),
            sharp_turns: false,
            radius: None,
            speed: None,
        }
    }
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
            PlantKind::Vessel(vessel) => self.of_vessel(plant, vessel, drive),
            PlantKind::Model(model) => {
                self.of_model(plant, model, drive).map(|plan| Plan::Model(Box::new(plan)))
            }
        }
    }

    fn of_vessel(&self, plant: &Plant, vessel: &VesselParams, drive: &Drive) -> Result<Plan, SettingError> {
        for (option, given) in [
            ("start", self.start.is_some()),
            ("process_noise", self.process_noise != 0.0),
            ("role", !self.role.is_empty()),
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
            noise_scale: self.noise,
            current: self.current.unwrap_or_default(),
            ..options
        };
        Ok(Plan::Vessel { options: Box::new(options), label })
    }

    fn excitation(&self, vessel: &VesselParams, drive: &Drive) -> Result<(Excitation, String), SettingError> {
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
                return Ok((Excitation::Given(commands_of(log, vessel)?), String::from("commands")));
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
        let model = model.clone().at_step(dt).map_err(PlantError::from)?.with_roles(&self.role)?;
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
