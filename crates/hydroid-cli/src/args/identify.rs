//! Arguments of `hydroid identify`.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use hydroid::config::value::named;
use hydroid::config::{self, Log};
use hydroid::identify::{GivenRange, SindyOptions};

/// Identify models from logs, judge them by cross-validation or on test runs, and write a report
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/identify.txt"))]
pub struct Identify {
    /// Logs to identify from. The methods sindy, committee and grey-box are cross-validated over these runs (blocks of one or two
    /// runs) and then fitted to all of them; other methods split them into training, validation and test
    #[arg(value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Configuration file (default: hydroid.toml in the current folder, if it exists)
    #[arg(long, short, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Validation logs, for the choice of hyperparameters, in place of the cross-validation (needs --test)
    #[arg(long, num_args = 1.., value_name = "LOG")]
    pub validate: Vec<PathBuf>,
    /// Test logs, for the final evaluation only; without them the cross-validation judges
    #[arg(long, num_args = 1.., value_name = "LOG")]
    pub test: Vec<PathBuf>,
    /// Estimate the marked numbers of a vessel file (grey box), beside the methods; the logs are read with the commands of the
    /// file as inputs, and the result is a vessel file again
    #[arg(long, value_name = "BOAT.toml")]
    pub vessel: Option<PathBuf>,
    #[command(flatten)]
    pub options: config::Identify,
    #[command(flatten)]
    pub sindy: SindyOptions,
    /// Design range of outputs and inputs: u=0:6,v=-1:1 or 'u=0:12 [kn]'; sets the scaling of networks and the limit of
    /// divergence (default: the training range). May be repeated
    #[arg(long, alias = "range", value_name = "NAME=LOW:HIGH", value_delimiter = ',', value_parser = named::<GivenRange>, help_heading = "Networks")]
    pub ranges: Vec<(String, GivenRange)>,
    /// Largest number of epochs (default: depends on the network)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Networks")]
    pub epochs: Option<u32>,
    /// Restarts of each training from different initial weights; the best is kept (default: 1)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096), help_heading = "Networks")]
    pub restarts: Option<u16>,
    /// Require that the training continues from the checkpoint in the folder of -o; an error if none fits. Without this option
    /// a fitting checkpoint is used, and others are renamed
    #[arg(long, help_heading = "Networks")]
    pub resume: bool,
    /// Folder for the models, report.html and identify.json
    #[arg(long, short, value_name = "DIR")]
    pub output: PathBuf,
    #[command(flatten)]
    pub log: Log,
}
