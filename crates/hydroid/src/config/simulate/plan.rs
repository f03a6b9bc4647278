//! Simulations that are ready to run.

use super::{DURATION_S, Simulate};
use crate::log::{Note, Trajectory};
use crate::manoeuvre::Track;
use crate::model::Model;
use crate::plant::{Commands, InputMap, PlantError, Record, RecordOptions, record};
use crate::progress::Progress;
use crate::simulate::Options;

/// A simulation that settings ask for.
#[derive(Clone, Debug)]
pub enum Plan {
    /// Of a vessel with one propeller and one rudder.
    Vessel {
        /// Options.
        options: Box<Options>,
        /// Kind of the excitation; `commands` for those of a log.
        label: String,
    },
    /// Of a model.
    Model(Box<ModelPlan>),
}

/// The simulation of a model.
#[derive(Clone, Debug)]
pub struct ModelPlan {
    /// The model.
    pub model: Model,
    /// Which inputs push and turn the vessel, for random commands.
    pub(super) map: Option<InputMap>,
    pub(super) commands: GivenCommands,
    pub(super) settings: Simulate,
    /// Velocity of the water, north and east \[m/s\].
    pub current: [f64; 2],
    /// Notes from reading a log.
    pub notes: Vec<Note>,
}

/// Commands of a model.
#[derive(Clone, Debug)]
pub(super) enum GivenCommands {
    Mixed,
    Rows(Vec<f64>),
    /// A log with the outputs of the model, up to the end of the simulation.
    Log {
        run: Box<Trajectory>,
        from: usize,
    },
}

impl ModelPlan {
    /// Simulates.
    ///
    /// # Errors
    /// If the simulation fails, or `progress` cancels.
    pub fn run(&self, progress: Progress<'_>) -> Result<Record, PlantError> {
        record(&self.model, self.map.as_ref(), &self.options(), progress)
    }

    /// Options of the simulation.
    pub fn options(&self) -> RecordOptions<'_> {
        RecordOptions {
            commands: match &self.commands {
                GivenCommands::Mixed => {
                    Commands::Mixed { duration_s: self.settings.duration.unwrap_or(DURATION_S) }
                }
                GivenCommands::Rows(rows) => Commands::Given(rows.clone()),
                GivenCommands::Log { run, from } => Commands::Run { run, from: *from },
            },
            seed: self.settings.seed,
            noise: self.settings.noise.unwrap_or(1.0),
            process_noise: self.settings.process_noise.unwrap_or(0.0),
            current: self.current,
        }
    }

    /// The measured motion of the log whose commands are simulated.
    pub fn measured(&self) -> Option<Track> {
        match &self.commands {
            GivenCommands::Log { run, from } => Track::measured(run, *from, run.len() - 1),
            GivenCommands::Mixed | GivenCommands::Rows(_) => None,
        }
    }
}
