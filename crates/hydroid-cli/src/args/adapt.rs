//! Arguments of `hydroid adapt`.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use hydroid::adapt::{Memory, Which};
use hydroid::faults::Faults;

use super::values::{Duration, NamedNumber};
use super::{Judging, LogArgs};

/// How equations learn by least squares, and the last layer of direct predictors.
#[derive(Clone, Debug, Default, PartialEq, ClapArgs)]
#[command(next_help_heading = "Learning by least squares (equations, direct predictors)")]
pub struct EquationsArgs {
    /// Learn from increments over this time [s] (equations; default: what the model's identification chose, or 1)
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub window: Option<f64>,
    /// Seconds of lively sailing that the model is worth: so long takes the log to count as much as it does (default:
    /// 10; direct predictors 0.003, in each direction of the last layer)
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub prior: Option<f64>,
    /// Coefficients, or weights, about which the log has long said nothing stay where they are, instead of returning to
    /// the model's
    #[arg(long)]
    pub no_leak: bool,
    /// Terms of the library that are not in an equation may enter it (equations)
    #[arg(long)]
    pub all_terms: bool,
    /// Learn from outliers as from every other sample (equations)
    #[arg(long)]
    pub no_gate: bool,
}

/// How recurrent networks and vessels learn, and equations by the filter.
#[derive(Clone, Debug, Default, PartialEq, ClapArgs)]
#[command(
    next_help_heading = "Learning by the filter (recurrent networks, vessels, and equations with --learner kalman; variances of the scaled model)"
)]
pub struct NetworksArgs {
    /// Standard deviation of the noise of each output, in its SI unit: u=0.01,v=0.01,r=0.02 (default: as in the logs that the
    /// model was trained on)
    #[arg(long, value_name = "NAME=STD", value_delimiter = ',')]
    pub noise: Vec<NamedNumber>,
    /// The noise counts for so many times its variance: what else the model misses is in there (default: 3; equations and
    /// vessels 1)
    #[arg(long, value_name = "X")]
    pub noise_factor: Option<f64>,
    /// Variance of each weight at the start: how far the vessel may be from the model (default: 0.02; equations 0.001;
    /// vessels 0.01, of relative changes: 10 %)
    #[arg(long, value_name = "P0")]
    pub weight_variance: Option<f64>,
    /// Variance that each weight gains in a second: how fast the vessel may change (default: 6e-7; equations and vessels
    /// 1e-6)
    #[arg(long, value_name = "Q")]
    pub weight_noise: Option<f64>,
    /// Variance and noise of the weights of gates are so many times that of the others (LSTM, GRU; default: 5)
    #[arg(long, value_name = "X")]
    pub gate_factor: Option<f64>,
    /// Variance that each number of the state gains in a second: of a network the hidden one, of equations the outputs,
    /// of a vessel these and the propeller force (default: 1e-4; equations 1e-3; vessels 1e-5)
    #[arg(long, value_name = "Q")]
    pub state_noise: Option<f64>,
    /// Time constant [s] with which weights return to those of the model; inf not to (default: 33000; equations and
    /// vessels inf)
    #[arg(long, value_name = "S")]
    pub leak: Option<f64>,
    /// Innovations of more standard deviations than this weigh less (default: inf)
    #[arg(long, value_name = "DEVIATIONS")]
    pub huber: Option<f64>,
    /// Time [s] over which the noise follows what is measured (default: inf)
    #[arg(long, value_name = "S")]
    pub adaptive_noise: Option<f64>,
    /// Which weights learn (networks; default: all)
    #[arg(long, value_name = "WHICH", value_enum)]
    pub weights: Option<WhichWeights>,
    /// How much of the covariance of the weights is kept: full, blocks:GROUP (of so many neighbouring units), diagonal,
    /// low-rank:RANK (default: full)
    #[arg(long, value_name = "WHAT", value_parser = str::parse::<Memory>)]
    pub memory: Option<Memory>,
    /// The filter works in single precision (networks)
    #[arg(long)]
    pub single_precision: bool,
}

/// Which weights of a network learn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum WhichWeights {
    /// All
    All,
    /// Those of the last layer, and of what comes after it
    LastLayer,
    /// Those of the read-out (of the projection, where it is the output)
    ReadOut,
}

impl From<WhichWeights> for Which {
    fn from(which: WhichWeights) -> Self {
        match which {
            WhichWeights::All => Self::All,
            WhichWeights::LastLayer => Self::LastLayer,
            WhichWeights::ReadOut => Self::ReadOut,
        }
    }
}

/// How equations learn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Learner {
    /// Recursive least squares on increments
    LeastSquares,
    /// An extended Kalman filter over outputs and coefficients: it filters the noise of the sensors, too
    Kalman,
}

/// Trust in what is learned.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Trust")]
pub struct TrustArgs {
    /// No guard: whatever is measured is learned from, and whatever was learned predicts
    #[arg(long)]
    pub no_guard: bool,
    /// A log that the model was trained on: the filter walks through the beginning of it first, and knows then what it
    /// determines of the weights; networks rehearse windows of all of it on the way. May be given again
    #[arg(long, value_name = "LOG")]
    pub shore: Vec<PathBuf>,
    /// How much of each of these logs it walks through
    #[arg(long, value_name = "TIME", default_value = "200s")]
    pub shore_time: Duration,
    /// Do not rehearse windows of these logs on the way, as networks do: a sample then takes half the time, and what was known
    /// is forgotten
    #[arg(long, requires = "shore")]
    pub no_rehearsal: bool,
    /// Put faults into the log first, and judge by what was measured before: spikes=0.01, dropout=u:10s, stuck=r:5s,
    /// bias=v:0.2, separated by commas; @TIME behind one says when [s]
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
    /// Serve the log line by line, as - does standard input
    #[arg(long)]
    pub stream: bool,
    /// Horizons of the predictions in the answers: samples, ascending (default: 1,10,50,100)
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub horizons: Option<Vec<usize>>,
    /// Keep the state in this file, at least once in a second of the stream, and go on from it if it is there: lines
    /// up to its time are skipped without an answer
    #[arg(long, value_name = "FILE")]
    pub state: Option<PathBuf>,
    /// Say in each answer how long it took [us]
    #[arg(long)]
    pub timing: bool,
}

/// A black box.
#[derive(Clone, Debug, Default, PartialEq, ClapArgs)]
#[command(next_help_heading = "Black box")]
pub struct BlackBoxArgs {
    /// Note in this file what the learner gets and what comes of it: a ring that holds the last minutes, for hydroid
    /// inspect and for --replay
    #[arg(long, value_name = "FILE")]
    pub black_box: Option<PathBuf>,
    /// Minutes that the black box holds at the least, from 2 on (default: 5)
    #[arg(long, value_name = "MINUTES", requires = "black_box", allow_negative_numbers = true)]
    pub black_box_minutes: Option<f64>,
    /// Do again what this black box has noted, and compare bit for bit: exit status 0 all the same, 1 not. With --json a
    /// line for each sample as it was made
    #[arg(long, value_name = "FILE", conflicts_with_all = ["run", "output", "learner", "forgetting", "EquationsArgs",
        "NetworksArgs", "StreamArgs", "LogArgs", "black_box"])]
    pub replay: Option<PathBuf>,
}

/// Let a model learn along a log, and compare it with the same model frozen; or serve a live stream
///
/// Walks the log once, sample by sample. At every origin the adapted model predicts with what it had learned
/// by then, and nothing later. The coefficients of equations follow by recursive least squares with forgetting; the
/// model itself stays the prior, to which coefficients return that the log says nothing about; so does the last layer of
/// a direct predictor, all of its steps at once. The weights of a recurrent network, and with --learner kalman coefficients too, are estimated together with the state by an extended Kalman
/// filter; so are the parameters of a vessel (masses, drag, rudder, propeller, flying mode), and -o writes its file.
///
/// A guard stands beside it: it leaves out what no sensor can have measured, tests all the time whether what was learned
/// predicts better than the model from shore, and predicts with that where it does not. Its actions are told.
///
/// With - (standard input) or --stream it is a service: each line, CSV below a header or a JSON object, is
/// answered at once with a line of JSON that holds what became of the sample, the estimate, and predictions with
/// their bands.
#[derive(Debug, ClapArgs)]
#[command(after_help = "Examples:
  hydroid adapt out/sindy.safetensors today.csv --horizon 20s
  hydroid adapt out/sindy.safetensors today.csv -o adapted.safetensors --forgetting 120
  hydroid adapt out/sindy.safetensors today.csv --learner kalman --noise u=0.01,v=0.01,r=0.02
  hydroid adapt out/gru.safetensors today.csv --noise u=0.01,v=0.01,r=0.02
  hydroid adapt out/direct.safetensors today.csv --horizon 2s --shore train.csv --shore-time 600s
  hydroid adapt mine.toml today.csv -o learned.toml    a vessel with given parameters, as `hydroid simulate` takes it
  hydroid adapt out/gru.safetensors today.csv --shore train.csv --inject spikes=0.01,dropout=u:10s
  logger | hydroid adapt out/sindy.safetensors - --state boat.state | controller
  hydroid adapt out/sindy.safetensors today.csv --stream > answers.jsonl
  logger | hydroid adapt out/sindy.safetensors - --black-box boat.box | controller
  hydroid adapt out/sindy.safetensors --replay boat.box        the same again, bit for bit?

Exit status: 0 adapted is at least as good as frozen in the mean of outputs and horizons, and no rollout of it
diverged; 1 otherwise; 2 wrong input. Of a replay: 0 all the same, 1 not, 2 wrong input. Of a stream: 0 at its end,
2 wrong input, 130 interrupted, with state and model written.")]
pub struct Adapt {
    /// The model: a .safetensors file, a vessel of your own (a TOML file), or hydrofoil, hydrofoil-low-speed, simple
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// The log; - to serve a stream on standard input
    #[arg(value_name = "LOG|-", required_unless_present = "replay")]
    pub run: Option<PathBuf>,
    /// Where to write the model with the coefficients or weights that it had at the end; a vessel as a .toml file
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// How the model learns: equations by least squares (the default) or by the filter, direct predictors by least squares,
    /// recurrent networks and vessels by the filter
    #[arg(long, value_name = "HOW", value_enum)]
    pub learner: Option<Learner>,
    /// Time [s] after which a sample counts 1/e; inf to forget nothing (default: 60 for least squares, 300 for direct
    /// predictors, inf for the filter)
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub forgetting: Option<f64>,
    #[command(flatten)]
    pub equations: EquationsArgs,
    #[command(flatten)]
    pub networks: NetworksArgs,
    #[command(flatten)]
    pub trust: TrustArgs,
    #[command(flatten)]
    pub judging: Judging,
    #[command(flatten)]
    pub stream: StreamArgs,
    #[command(flatten)]
    pub black_box: BlackBoxArgs,
    #[command(flatten)]
    pub log: LogArgs,
}
