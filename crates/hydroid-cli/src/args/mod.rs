//! What can be said on the command line.

mod adapt;
mod control;
mod identify;
mod thesis;
mod values;

use std::path::PathBuf;

use clap::{Args as ClapArgs, Parser, Subcommand};
use hydroid::log::{CommandTiming, InputDelay};

pub use adapt::{Adapt, EquationsArgs, Learner, NetworksArgs};
pub use control::{
    Control, ControllerKind, FleetArgs, HelmArgs, LearnArgs, SeaArgs, TaskArgs, TaskKind, TimingKind,
};
pub use identify::Identify;
pub use thesis::Thesis;
use values::parse_timing;
pub use values::{Against, Duration, Horizon, Method, NamedNumber, NamedRange, Origin};

/// Learns how a surface vessel moves from its own log.
#[derive(Debug, Parser)]
#[command(
    version,
    about,
    after_help = "Examples:
  hydroid identify -o demo                      no log at hand: simulates a hydrofoil and identifies it
  hydroid inspect log.csv                       what is in a log, and where it will hurt
  hydroid identify a.csv b.csv c.csv -o out     equations, judgement and report.html from three runs
  hydroid identify a.csv b.csv c.csv --methods sindy,gru --budget 2m -o out    a recurrent network beside them
  hydroid evaluate out/sindy.safetensors d.csv --horizon 100
  hydroid adapt out/sindy.safetensors d.csv     the same model learning on the way, beside it frozen
  hydroid control hydrofoil --controller fl --speed 4 --radius 30 -o steered    steer a vessel with a model

Exit status: 0 done, 1 done but a stated criterion was missed, 2 wrong input, 130 interrupted."
)]
pub struct Args {
    #[command(flatten)]
    pub global: Global,
    #[command(subcommand)]
    pub command: Command,
}

/// Said before or after any command.
#[derive(Clone, Copy, Debug, ClapArgs)]
pub struct Global {
    /// Print one JSON document on standard output and nothing else there
    #[arg(long, global = true)]
    pub json: bool,
    /// Threads to use (default: one for each core). The result does not depend on it
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// No progress bar and no notes; results, warnings and errors remain
    #[arg(long, short, global = true)]
    pub quiet: bool,
}

/// The verbs.
#[derive(Debug, Subcommand)]
pub enum Command {
    Simulate(Simulate),
    Inspect(Inspect),
    Identify(Box<Identify>),
    Evaluate(Evaluate),
    Adapt(Box<Adapt>),
    Control(Box<Control>),
    Thesis(Thesis),
}

/// Simulate a vessel and write its log
#[derive(Debug, ClapArgs)]
#[command(after_help = "Examples:
  hydroid simulate hydrofoil -o run.csv                           two hours through both modes
  hydroid simulate simple --duration 600 --seed 7 -o run.csv
  hydroid simulate hydrofoil --excitation lawn-mower --leg-speeds 1.5,4,2 -o lawn.csv
  hydroid simulate hydrofoil --print-vessel > mine.toml           a start for a vessel of your own
  hydroid simulate mine.toml --excitation low-speed -o slow.csv
  hydroid simulate simple --excitation commands.csv -o run.csv    commands from a file: t, propeller, rudder")]
pub struct Simulate {
    /// simple, hydrofoil, hydrofoil-low-speed, or a vessel of your own (a TOML file)
    #[arg(value_name = "PLANT")]
    pub plant: String,
    /// mixed, low-speed, lawn-mower, circle, or a CSV file with time and the two commands
    #[arg(long, default_value = "mixed", value_name = "KIND|FILE")]
    pub excitation: String,
    /// Duration [s] (default: 7200, or as long as the commands of a file last)
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub duration: Option<f64>,
    /// Sample time [s]
    #[arg(long, default_value_t = 0.1, value_name = "S", allow_negative_numbers = true)]
    pub dt: f64,
    /// Integration step [s]; the sample time is a whole number of them
    #[arg(long, default_value_t = 0.01, value_name = "S", allow_negative_numbers = true)]
    pub step: f64,
    /// Seed of commands and noise; the same seed gives the same bytes
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Scale of the vessel's measurement noise; 0 for none
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR", allow_negative_numbers = true)]
    pub noise: f64,
    /// Lawn-mower: length of a leg [m]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub leg: Option<f64>,
    /// Lawn-mower: distance between legs [m]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub spacing: Option<f64>,
    /// Lawn-mower: speed of each leg [m/s], separated by commas (default: drawn)
    #[arg(long, value_delimiter = ',', value_name = "M_S")]
    pub leg_speeds: Vec<f64>,
    /// Lawn-mower: turn sharply between legs instead of in half circles
    #[arg(long)]
    pub sharp_turns: bool,
    /// Circle: radius [m]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub radius: Option<f64>,
    /// Circle: speed [m/s]. Low-speed: speed that is never reached [m/s]
    #[arg(long, value_name = "M_S", allow_negative_numbers = true)]
    pub speed: Option<f64>,
    /// Where to write the log; - for standard output (default: named after plant, excitation and seed)
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Print the vessel's parameters as TOML and stop
    #[arg(long)]
    pub print_vessel: bool,
}

/// Show what is in a log (channels, units, rate, gaps, ranges, excitation, delays) in a model, or in
/// a black box (hydroid adapt --black-box): time span, settings, what became of the samples, events, health
#[derive(Debug, ClapArgs)]
#[command(after_help = "Examples:
  hydroid inspect log.csv
  hydroid inspect log.csv --outputs u=SOG_kn[kn],r=ROT[deg/min] --inputs n=rpm[rpm],delta=rudder[deg]
  hydroid inspect out/sindy.safetensors
  hydroid inspect out/sindy.safetensors --latex > equations.tex   for a document with the package amsmath
  hydroid inspect out/sindy.safetensors --json                    also the Jacobian, entry by entry
  hydroid inspect boat.box                                        what happened before it went wrong")]
pub struct Inspect {
    /// Logs (CSV), models (.safetensors; vessels: .toml) or black boxes
    #[arg(required = true, value_name = "LOG|MODEL|BOX")]
    pub files: Vec<PathBuf>,
    /// Print the equations of models in LaTeX and nothing else (--json has them too)
    #[arg(long)]
    pub latex: bool,
    #[command(flatten)]
    pub log: LogArgs,
}

/// Judge a model on logs: errors by horizon and channel beside persistence
#[derive(Debug, ClapArgs)]
#[command(after_help = "Examples:
  hydroid evaluate out/sindy.safetensors test.csv --horizon 10s
  hydroid evaluate out/sindy.safetensors run.csv --origin true --against truth    simulated logs
  hydroid evaluate mine.toml test.csv                  a vessel with given parameters
  hydroid evaluate out/sindy.safetensors test.csv --json > errors.json")]
pub struct Evaluate {
    /// The model: a .safetensors file, a vessel of your own (a TOML file), or hydrofoil, hydrofoil-low-speed, simple
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// Logs; each is a run, or several where it has gaps
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    #[command(flatten)]
    pub judging: Judging,
    #[command(flatten)]
    pub log: LogArgs,
}

/// How predictions are judged.
#[derive(Clone, Copy, Debug, ClapArgs)]
pub struct Judging {
    /// Longest horizon: samples (100) or seconds (10s)
    #[arg(long, default_value = "100", value_name = "N|Ns")]
    pub horizon: Horizon,
    /// Samples between two origins
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub origin_stride: usize,
    /// What the model sees before it predicts
    #[arg(long, default_value = "measured")]
    pub origin: Origin,
    /// What predictions are compared with
    #[arg(long, default_value = "measurement")]
    pub against: Against,
}

/// How to read logs.
#[derive(Clone, Debug, Default, PartialEq, ClapArgs)]
#[command(next_help_heading = "Reading logs")]
pub struct LogArgs {
    /// Time column: seconds, ISO 8601 stamps, or with its unit: `timestamp [ms]` (default: t, time, t_s,
    /// timestamp, time_s)
    #[arg(long, value_name = "COLUMN")]
    pub time: Option<String>,
    /// Outputs: NAME, NAME=COLUMN, with [unit] and * scale where needed (default: u,v,r)
    #[arg(long, value_name = "LIST")]
    pub outputs: Option<String>,
    /// Inputs, likewise (default: columns that end in _cmd or _ang)
    #[arg(long, value_name = "LIST")]
    pub inputs: Option<String>,
    /// Wind speed and direction columns; become the inputs U^2 cos and U^2 sin
    #[arg(long, value_name = "SPEED,DIRECTION")]
    pub wind: Option<String>,
    /// Which comes first. before: row k holds the command that acts from its measurement on, until row k+1
    /// (default). after: row k holds the command that led to its measurement, since row k-1
    #[arg(long, value_name = "before|after", value_parser = parse_timing)]
    pub command_timing: Option<CommandTiming>,
    /// How much later a command acts than it is logged: samples (3) or seconds (0.3s), may be negative
    #[arg(long, value_name = "DELAY", allow_hyphen_values = true)]
    pub input_delay: Option<InputDelay>,
    /// Longest time [s] that an output may be missing before the run is cut
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub max_gap: Option<f64>,
    /// Keep the ends of a log at which all commands are zero for 20 s and more and the vessel gathers way all the
    /// same, as where it is towed (default: they are left out, and it is told)
    #[arg(long)]
    pub keep_towed: bool,
    /// Step [s] to resample to (default: the log's own), or of the rows of a log without a time column
    #[arg(long = "dt", value_name = "S", allow_negative_numbers = true)]
    pub dt: Option<f64>,
}
