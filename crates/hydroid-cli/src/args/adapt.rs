//! Arguments of `hydroid adapt`.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use hydroid::config;
use hydroid::faults::Faults;

use super::{AnswerArgs, Duration, EvaluationArgs, Log};

/// Guard, training logs, and faults for tests.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Guard and training logs")]
pub struct GuardArgs {
    /// A log that the model was trained on: the filter runs over its beginning first, and networks rehearse windows of it. May be repeated
    #[arg(long, value_name = "LOG")]
    pub training_log: Vec<PathBuf>,
    /// Length of the beginning of each training log that the filter runs over
    #[arg(long, value_name = "TIME", default_value = "200s")]
    pub training_time: Duration,
    /// Do not rehearse windows of the training logs: half the time for each sample, but the network forgets (networks)
    #[arg(long, requires = "training_log")]
    pub no_rehearsal: bool,
    /// Add faults to the log and evaluate against the log without them: spikes=0.01,dropout=u:10s,stuck=r:5s,bias=v:0.2; @TIME sets the start [s]
    #[arg(long, value_name = "FAULTS", value_parser = str::parse::<Faults>)]
    pub inject: Option<Faults>,
    /// Seed of the faults
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
}

/// A live stream.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Live stream")]
pub struct StreamArgs {
    /// Treat the log as a live stream: answer line by line, as for standard input (-)
    #[arg(long)]
    pub stream: bool,
    #[command(flatten)]
    pub answers: AnswerArgs,
}

/// A black box.
#[derive(Clone, Debug, Default, PartialEq, ClapArgs)]
#[command(next_help_heading = "Black box")]
pub struct BlackBoxArgs {
    /// Record samples, updates and events of the last minutes in this file, for hydroid inspect and --replay
    #[arg(long, value_name = "FILE")]
    pub black_box: Option<PathBuf>,
    /// Shortest time that the black box holds [min], at least 2 (default: 5)
    #[arg(long, value_name = "MINUTES", requires = "black_box", allow_negative_numbers = true)]
    pub black_box_minutes: Option<f64>,
    /// Compute a recorded session again and compare it bit for bit (exit status 1: it differs). With --json a line for each sample
    #[arg(long, value_name = "FILE", conflicts_with_all = ["run", "output", "AdaptOptions", "StreamArgs", "Log", "black_box"])]
    pub replay: Option<PathBuf>,
}

/// Adapt a model online along a log and compare it with the frozen model, or serve a live stream
///
/// The log is read once, sample by sample. The predictions from an origin use only the data up to this origin.
/// Equations and the last layer of direct predictors adapt by recursive least squares with forgetting, the members of a
/// committee without forgetting. Recurrent networks, vessels, and equations with --learner kalman adapt by an extended
/// Kalman filter over state and weights.
///
/// The guard rejects implausible measurements, compares the adapted model with the reference model by shadow tests, and
/// predicts with the reference model where the tests do not support the adapted one. Each event is logged.
///
/// With - (standard input) or --stream the command serves a live stream: a JSON line with the outcome, the estimate and the
/// predictions with their bands answers each line of the input (CSV below a header, or JSON objects).
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/adapt.txt"))]
pub struct Adapt {
    /// The model: a .safetensors file, a vessel file (.toml), or hydrofoil, hydrofoil-low-speed, simple
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// The log; - serves a live stream on standard input
    #[arg(value_name = "LOG|-", required_unless_present = "replay")]
    pub run: Option<PathBuf>,
    /// Configuration file with a section [adapt] (default: hydroid.toml in the current folder, if it exists)
    #[arg(long, short, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Write the adapted model to this file (.safetensors; vessels: .toml)
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Print all options
    #[arg(long)]
    pub help_advanced: bool,
    #[command(flatten)]
    pub options: config::Adapt,
    #[command(flatten)]
    pub guard: GuardArgs,
    #[command(flatten)]
    pub evaluation: EvaluationArgs,
    #[command(flatten)]
    pub stream: StreamArgs,
    #[command(flatten)]
    pub black_box: BlackBoxArgs,
    #[command(flatten)]
    pub log: Log,
}
