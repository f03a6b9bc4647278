//! Arguments of the command line.

mod adapt;
mod export;
mod file;
mod help;
mod identify;
mod live;
mod manoeuvre;
mod report;
mod thesis;
mod values;

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Args as ClapArgs, CommandFactory, Parser, Subcommand};
use hydroid::config;

pub use crate::global::Global;
pub use adapt::Adapt;
pub use export::{Export, Target};
pub use hydroid::config::{Duration, Horizon, Log};
pub use hydroid_live::program::control::{AnswerArgs, Control};
use hydroid_live::program::file::parse;
pub use identify::Identify;
pub use live::Live;
pub use manoeuvre::Manoeuvre;
pub use report::Report;
pub use thesis::Thesis;
pub use values::{Against, Origin};

/// Identifies the dynamics of surface vessels from logs, adapts the model online, and controls the vessel.
#[derive(Debug, Parser)]
#[command(
    name = "hydroid",
    version,
    about,
    after_help = include_str!("help/hydroid.txt")
)]
pub struct Args {
    #[command(flatten)]
    pub global: Global,
    #[command(subcommand)]
    pub command: Command,
}

impl Args {
    /// Parses the command line with the options of a configuration file. Help and invalid arguments end the program.
    pub fn read() -> anyhow::Result<Self> {
        let words: Vec<OsString> = std::env::args_os().collect();
        if let Some(name) = help::advanced(words.iter().filter_map(|word| word.to_str())) {
            let mut command = Self::command();
            command.build();
            if let Some(subcommand) = command.find_subcommand_mut(name) {
                outln!("{}", subcommand.render_long_help());
                std::process::exit(0);
            }
        }
        let command = help::short(Self::command());
        // Required options may be in the file.
        let partial = command.clone().ignore_errors(true).try_get_matches_from(&words);
        let from_file = partial.ok().map(|matches| file::read(&command, &matches)).transpose()?.flatten();
        let after = from_file.as_ref().and_then(|file| words.iter().position(|word| word == file.verb));
        parse(&command, words, from_file, after.map_or(0, |at| at + 1))
    }
}

/// Subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    Simulate(Box<Simulate>),
    Inspect(Inspect),
    Convert(Convert),
    Identify(Box<Identify>),
    Evaluate(Evaluate),
    Adapt(Box<Adapt>),
    Manoeuvre(Manoeuvre),
    Control(Box<Control>),
    Live(Box<Live>),
    Export(Export),
    Report(Report),
    Thesis(Thesis),
}

/// Simulate a vessel and write its log
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/simulate.txt"))]
pub struct Simulate {
    /// simple, hydrofoil, hydrofoil-low-speed, a vessel file (.toml), or an identified model (.safetensors)
    #[arg(value_name = "PLANT")]
    pub plant: String,
    /// mixed, low-speed, lawn-mower, circle, or a CSV file with time and the commands. For an identified model: mixed, or a
    /// file; if the file is a log with the outputs of the model, the simulation starts with the measured motion
    #[arg(long, default_value = "mixed", value_name = "KIND|FILE")]
    pub excitation: String,
    #[command(flatten)]
    pub settings: config::Simulate,
    /// Identified model: file of a figure (.svg) with the simulated track, those of the model's members, and the measured one
    #[arg(long, value_name = "FILE")]
    pub figure: Option<PathBuf>,
    /// File of the log; - for standard output (default: PLANT-EXCITATION-seedN.csv)
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Print the vessel's parameters as TOML and stop
    #[arg(long)]
    pub print_vessel: bool,
}

/// Show the contents of logs, models and black boxes
///
/// Logs: channels, units, rate, gaps, ranges, excitation, delays. Models: equations with standard errors or layers,
/// training range, history. Black boxes (hydroid adapt --black-box): time span, settings, outcomes of the samples, events.
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/inspect.txt"))]
pub struct Inspect {
    /// Logs (CSV, Parquet, XLSX), recordings (MCAP, ROS bags, ArduPilot .BIN, PX4 .ulg, NMEA 0183, a folder of CSV files with
    /// a topic each), models (.safetensors; vessels: .toml), black boxes
    #[arg(required = true, value_name = "LOG|MODEL|BOX")]
    pub files: Vec<PathBuf>,
    /// Write which columns look like sensors and commands to a new file (default: hydroid.toml). With several files, those
    /// of the first log
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true, default_missing_value = config::FILE)]
    pub write_config: Option<PathBuf>,
    /// Print only the equations of models, with standard errors of the coefficients, in LaTeX
    #[arg(long)]
    pub latex: bool,
    /// Write an experiment that adds what the logs lack for identification: a table of commands, each held until the next row (.csv)
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    #[command(flatten)]
    pub log: Log,
}

/// Convert recordings to runs: tables of pose, velocities and commands
///
/// Velocities are computed from position, heading, yaw rate and accelerations if the file hydroid.toml has a section
/// [log.sensors], with standard deviations; the delay of the GNSS and the misalignment of the compass are estimated.
/// `hydroid inspect RECORDING --write-config` proposes the file. Other commands read recordings in the same way.
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/convert.txt"))]
pub struct Convert {
    /// Recordings and logs. Those of one vessel together: delay and misalignment are the same in all
    #[arg(required = true, value_name = "RECORDING")]
    pub logs: Vec<PathBuf>,
    /// File of the run, whose extension names the format: .csv or .parquet. For several recordings, {} in its name stands
    /// for the name of each; a folder FOLDER is FOLDER/{}.csv
    #[arg(long, short, required = true, value_name = "FILE|FOLDER")]
    pub output: PathBuf,
    /// Configuration file with the section [log] (default: hydroid.toml in the current folder)
    #[arg(long, short, value_name = "FILE")]
    pub config: Option<PathBuf>,
    #[command(flatten)]
    pub log: Log,
}

/// Evaluate a model on logs: errors by horizon and output, compared with persistence
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/evaluate.txt"))]
pub struct Evaluate {
    /// The model: a .safetensors file, a vessel file (.toml), or hydrofoil, hydrofoil-low-speed, simple
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// Logs; a log with gaps becomes several runs
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    #[command(flatten)]
    pub evaluation: EvaluationArgs,
    /// Take the model as one of the motion through the water, and estimate the current: standard deviation of its components
    /// at the start of a run [m/s], as in 0.3. Needs a heading
    #[arg(long, value_name = "M/S", allow_negative_numbers = true)]
    pub estimate_current: Option<f64>,
    #[command(flatten)]
    pub log: Log,
}

/// Evaluation of predictions.
#[derive(Clone, Copy, Debug, ClapArgs)]
#[command(next_help_heading = "Evaluation")]
pub struct EvaluationArgs {
    /// Longest prediction horizon: samples (100) or seconds (10s)
    #[arg(long, default_value = "100", value_name = "N|Ns")]
    pub horizon: Horizon,
    /// Distance between origins [samples]
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub origin_stride: usize,
    /// Outputs that the model observes before the origin
    #[arg(long, default_value = "measured")]
    pub origin: Origin,
    /// Reference of the errors
    #[arg(long, default_value = "measurement")]
    pub against: Against,
}
