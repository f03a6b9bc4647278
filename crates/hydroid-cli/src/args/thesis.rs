//! Arguments of `hydroid thesis`.

use std::path::PathBuf;

use clap::Args as ClapArgs;

/// Reproduce the thesis: simulation, identification, adaptation, control; all figures and claims on one page
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/thesis.txt"))]
pub struct Thesis {
    /// Experiments to run (default: all)
    #[arg(value_name = "EXPERIMENT")]
    pub only: Vec<String>,
    /// Short version: short records, few epochs, few seeds
    #[arg(long)]
    pub quick: bool,
    /// Folder of the page, its figures and data, and the cache
    #[arg(long, short, value_name = "FOLDER", default_value = "report")]
    pub output: PathBuf,
    /// Folder with experiments, records, models and claims as files (default: built in)
    #[arg(long, value_name = "FOLDER")]
    pub experiments: Option<PathBuf>,
    /// Write the built-in files to a folder and exit
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["only", "quick", "experiments"])]
    pub write_experiments: Option<PathBuf>,
    /// List the experiments and exit
    #[arg(long)]
    pub list: bool,
    /// Reuse cached results of other builds of this program; for work on the page only
    #[arg(long)]
    pub ignore_build: bool,
}
