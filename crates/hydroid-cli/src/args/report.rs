//! Arguments of `hydroid report`.

use std::path::PathBuf;

use clap::Args as ClapArgs;

use hydroid::boat::StatedRoles;

use super::{EvaluationArgs, Log};

/// Write a page about a model: what it is, its errors on logs, its trials; on it, the model can be driven
///
/// The page is one file. It loads nothing and can be mailed. With logs, it states the errors of the model on them, and sets their
/// turns and zigzags beside the predictions. Trials are those of `hydroid manoeuvre`. With --interactive, the model is driven on
/// the page: with keys, sliders or a gamepad, in a current, and with wind if it is an input. A click shows a trial in its place.
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/report.txt"))]
pub struct Report {
    /// The model: a .safetensors file, a vessel file (.toml), or hydrofoil, hydrofoil-low-speed, simple
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// Logs that the model is judged on
    #[arg(value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// File of the page
    #[arg(long, short, default_value = "report.html", value_name = "FILE")]
    pub output: PathBuf,
    /// The model can be driven on the page
    #[arg(long)]
    pub interactive: bool,
    /// Length of the ship [m]: adds the criteria of IMO resolution MSC.137(76)
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub length: Option<f64>,
    /// Roles of inputs: propulsion, steering, thruster, disturbance or setting, as in delta=steering,wind=disturbance
    /// (default: those of the model, found from names, units and its response)
    #[arg(long, value_name = "INPUT=ROLE,..")]
    pub role: Option<StatedRoles>,
    /// Inputs that push the vessel, separated by commas; -NAME pushes astern (default: by the roles of the inputs)
    #[arg(long, value_delimiter = ',', value_name = "INPUTS", allow_hyphen_values = true)]
    pub push: Vec<String>,
    /// Inputs that turn the vessel to starboard; -NAME turns to port (default: by the roles of the inputs)
    #[arg(long, value_delimiter = ',', value_name = "INPUTS", allow_hyphen_values = true)]
    pub turn: Vec<String>,
    #[command(flatten)]
    pub evaluation: EvaluationArgs,
    #[command(flatten)]
    pub log: Log,
}
