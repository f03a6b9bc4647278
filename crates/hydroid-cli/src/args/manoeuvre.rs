//! Arguments of `hydroid manoeuvre`.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use hydroid::config;

use super::Log;

/// Run manoeuvring trials of a vessel or of an identified model
///
/// Turning circle, zigzag, pull-out, spiral, acceleration and stopping, as defined by IMO resolution MSC.137(76) and ITTC
/// procedure 7.5-04-02-01. Each trial begins on a straight course at a steady speed. The roles of the inputs say which
/// ones push and turn the vessel; the wind is 0. A vessel that no input pushes, as one with a constant shaft speed in its
/// logs, has its own speed, and no trials of acceleration and stopping. Steering is stated in degrees if one input turns the vessel and is an angle, otherwise
/// in percent of its range. Intervals are the 5 % and 95 % quantiles over the members of the model's ensemble or committee,
/// joined with the errors of trials in the logs that were left out of the fit.
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/manoeuvre.txt"))]
pub struct Manoeuvre {
    /// The vessel: an identified model (.safetensors), a vessel file (.toml), or hydrofoil, hydrofoil-low-speed, simple
    #[arg(value_name = "PLANT")]
    pub plant: PathBuf,
    /// Logs: their turns and zigzags are set beside the predictions of the model from their first samples
    #[arg(value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    #[command(flatten)]
    pub settings: config::Manoeuvre,
    /// Folder for trials.json (comparisons.json with logs), tracks.csv and report.html
    #[arg(long, short, value_name = "DIR")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub log: Log,
}
