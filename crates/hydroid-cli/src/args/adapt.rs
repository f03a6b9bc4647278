//! Arguments of `hydroid adapt`.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use hydroid::adapt::{CovarianceForm, Method};
use hydroid::config::value::named;
use hydroid::faults::Faults;

use super::{AnswerArgs, Duration, EvaluationArgs, LogArgs};

/// Recursive least squares: equations of motion, and the last layer of direct predictors.
#[derive(Clone, Debug, Default, PartialEq, ClapArgs)]
#[command(next_help_heading = "Recursive least squares (equations, direct predictors)")]
pub struct LeastSquaresArgs {
    /// Window of the increments that equations learn from [s] (default: the window of the identification, or 1)
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub window: Option<f64>,
    /// Weight of the initial model: seconds of excited data that it counts for (default: 10; direct predictors 0.003)
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub prior: Option<f64>,
    /// Keep coefficients that the data no longer excites, instead of their slow return to the initial model
    #[arg(long)]
    pub no_leak: bool,
    /// Adapt all terms of the library, also those that the identification left out of an equation (equations)
    #[arg(long)]
    pub all_terms: bool,
    /// Give outliers the same weight as all other samples (equations)
    #[arg(long)]
    pub no_gate: bool,
}

/// The extended Kalman filter over state and weights. The variances are those of the scaled model.
#[derive(Clone, Debug, Default, PartialEq, ClapArgs)]
#[command(
    next_help_heading = "Extended Kalman filter (recurrent networks, vessels, and equations with --learner kalman)"
)]
pub struct KalmanArgs {
    /// Standard deviation of the noise of each output, in its SI unit: u=0.01,v=0.01,r=0.02 (default: that of the training logs)
    #[arg(long, value_name = "NAME=STD", value_delimiter = ',', value_parser = named::<f64>)]
    pub noise: Vec<(String, f64)>,
    /// Factor on the variance of the noise; it accounts for model error (default: 3; equations and vessels 1)
    #[arg(long, value_name = "X")]
    pub noise_factor: Option<f64>,
    /// Initial variance of each weight (default: 0.02; equations 0.001; vessels 0.01, relative: 10 %)
    #[arg(long, value_name = "P0")]
    pub weight_variance: Option<f64>,
    /// Process noise of each weight: variance per second (default: 6e-7; equations and vessels 1e-6)
    #[arg(long, value_name = "Q")]
    pub weight_noise: Option<f64>,
    /// Process noise of each component of the state: variance per second (default: 1e-4; equations 1e-3; vessels 1e-5)
    #[arg(long, value_name = "Q")]
    pub state_noise: Option<f64>,
    /// Time constant of the return of the weights to the initial model [s]; inf: no return (default: 33000; equations, vessels inf)
    #[arg(long, value_name = "S")]
    pub leak: Option<f64>,
    /// Huber threshold of the innovations [standard deviations]; larger innovations have less weight (default: inf)
    #[arg(long, value_name = "X")]
    pub huber: Option<f64>,
    /// Form of the covariance of the weights: full, blocks:GROUP (neighbouring units) (default: full)
    #[arg(long, value_name = "FORM", value_parser = str::parse::<CovarianceForm>)]
    pub covariance: Option<CovarianceForm>,
}

/// Method of adaptation and its options.
#[derive(Clone, Debug, Default, PartialEq, ClapArgs)]
pub struct MethodArgs {
    /// Method of adaptation (default: least-squares for equations and direct predictors, kalman for networks and vessels)
    #[arg(long, value_name = "METHOD", value_enum)]
    pub learner: Option<Method>,
    /// Forgetting time: age at which a sample has the weight 1/e [s]; inf: none (default: 60; direct predictors 300; kalman inf)
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub forgetting: Option<f64>,
    #[command(flatten)]
    pub least_squares: LeastSquaresArgs,
    #[command(flatten)]
    pub kalman: KalmanArgs,
}

/// Guard, training logs, and faults for tests.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Guard and training logs")]
pub struct GuardArgs {
    /// Switch the guard off: learn from every measurement, and always predict with the adapted model
    #[arg(long)]
    pub no_guard: bool,
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
    #[arg(long, value_name = "FILE", conflicts_with_all = ["run", "output", "learner", "forgetting", "LeastSquaresArgs",
        "KalmanArgs", "StreamArgs", "LogArgs", "black_box"])]
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
    /// Take the model as one of the motion through the water, and estimate the current beside its weights: standard deviation
    /// of the components of the current at the start of a run [m/s], as in 0.3. Needs a heading
    #[arg(long, value_name = "M/S", allow_negative_numbers = true)]
    pub estimate_current: Option<f64>,
    /// Print all options
    #[arg(long)]
    pub help_advanced: bool,
    #[command(flatten)]
    pub method: MethodArgs,
    #[command(flatten)]
    pub guard: GuardArgs,
    #[command(flatten)]
    pub evaluation: EvaluationArgs,
    #[command(flatten)]
    pub stream: StreamArgs,
    #[command(flatten)]
    pub black_box: BlackBoxArgs,
    #[command(flatten)]
    pub log: LogArgs,
}
