//! Arguments of `hydroid thesis`.

use std::path::PathBuf;

use clap::Args as ClapArgs;

/// Reproduce the thesis: simulation, identification, adaptation, control; all figures and claims on one page
#[derive(Debug, ClapArgs)]
#[command(after_help = "Examples:
  hydroid thesis --quick                        the short version, one to two minutes: report/index.html
  hydroid thesis                                the complete study
  hydroid thesis fig5 fig6                      only these experiments
  hydroid thesis --list                         names of the experiments
  hydroid thesis --write-experiments mine       experiment files for editing
  hydroid thesis --experiments mine -o mine/report

FOLDER/cache stores the results. A result is reused if its experiment, its inputs and this program have not changed. The same
command continues an interrupted study.")]
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
