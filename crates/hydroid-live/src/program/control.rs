//! Arguments of `hydroid control`, whose section of the configuration file has the path and the controller on board.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use hydroid::config::Duration;
use hydroid::config::control::ClosedLoopOptions;

/// Answers and state of a live stream.
#[derive(Clone, Debug, Default, ClapArgs)]
#[command(next_help_heading = "Live stream")]
pub struct AnswerArgs {
    /// Horizons of the predictions in each answer [samples], ascending (default: 1,10,50,100)
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub horizons: Option<Vec<usize>>,
    /// Save the state of model and controller in this file once a second, and resume from it; lines that were answered before are not used again
    #[arg(long, value_name = "FILE")]
    pub state: Option<PathBuf>,
    /// Add the computing time to each answer [us]
    #[arg(long)]
    pub timing: bool,
}

impl AnswerArgs {
    /// Horizons of the predictions \[samples\].
    pub fn horizons(&self) -> Vec<usize> {
        self.horizons.clone().unwrap_or_else(|| vec![1, 10, 50, 100])
    }

    /// Whether an option is given.
    pub fn is_given(&self) -> bool {
        self.horizons.is_some() || self.state.is_some() || self.timing
    }
}

/// A live stream.
#[derive(Clone, Debug, Default, ClapArgs)]
#[command(next_help_heading = "Live stream")]
pub struct ServiceArgs {
    /// Answers.
    #[command(flatten)]
    pub answers: AnswerArgs,
    /// Record samples, updates and events of the adaptation of the last minutes in this file, for hydroid inspect and
    /// hydroid adapt --replay
    #[arg(long, value_name = "FILE", requires = "adapt")]
    pub black_box: Option<PathBuf>,
    /// Shortest time that the black box holds [min], at least 2 (default: 5)
    #[arg(long, value_name = "MINUTES", requires = "black_box", allow_negative_numbers = true)]
    pub black_box_minutes: Option<f64>,
}

/// Simulate a closed loop, or steer a vessel through a live stream
///
/// Simulation: a controller with a model, and a vessel with noise, current, wind and delay
///
/// The vessel is the model itself, or another plant (--plant). fl and backstepping invert the model: equations with one
/// known function of each command (hydroid identify --for-control), a control-affine network, or a vessel. cem plans with
/// any model. pid is tuned on any model. With --adapt the model adapts in the loop under the guard, and each command uses
/// the adapted model.
///
/// Live stream (-): each line, CSV after a header or a JSON object, has the time, the position (x and y, or lat and lon for
/// geographic way-points), the heading and the outputs of the model. It is answered with a line of JSON: command, status,
/// reference, predicted track and bands. See docs/control-service.md.
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/control.txt"))]
pub struct Control {
    /// The model: a .safetensors file, a vessel file (.toml), or hydrofoil, hydrofoil-low-speed, simple. pid is tuned on it
    #[arg(value_name = "MODEL")]
    pub model: Option<PathBuf>,
    /// A live stream: - for standard input, or a file. Each line is answered with a command
    #[arg(value_name = "STREAM", allow_hyphen_values = true)]
    pub stream: Option<PathBuf>,
    /// Configuration file with a section [control] (default: hydroid.toml in the current folder, if it exists)
    #[arg(long, short, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// The true plant: a .safetensors file, a vessel file (.toml), or hydrofoil, hydrofoil-low-speed, simple (default: MODEL)
    #[arg(long, value_name = "PLANT")]
    pub plant: Option<PathBuf>,
    /// Folder for track.csv (a log), control.json and report.html
    #[arg(long, short, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Print all options
    #[arg(long)]
    pub help_advanced: bool,
    /// The closed loop.
    #[command(flatten)]
    pub options: ClosedLoopOptions,
    /// A log that the model was trained on: the filter runs over its beginning first. May be repeated
    #[arg(long, value_name = "LOG", requires = "adapt", help_heading = "Online adaptation")]
    pub training_log: Vec<PathBuf>,
    /// Length of the beginning of each training log
    #[arg(
        long,
        value_name = "TIME",
        default_value = "200s",
        requires = "training_log",
        help_heading = "Online adaptation"
    )]
    pub training_time: Duration,
    /// Live stream.
    #[command(flatten)]
    pub service: ServiceArgs,
}
