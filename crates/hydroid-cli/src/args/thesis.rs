//! What can be said to `hydroid thesis`.

use std::path::PathBuf;

use clap::Args as ClapArgs;

/// Repeat the study that hydroid began with: simulate, learn, adapt, steer; every figure, table 1, every claim judged, one page
#[derive(Debug, ClapArgs)]
#[command(after_help = "Examples:
  hydroid thesis --quick                        the story in a minute or two: report/index.html
  hydroid thesis                                the whole study
  hydroid thesis fig5 fig6                      these experiments alone
  hydroid thesis --list                         what there is
  hydroid thesis --write-experiments mine       the experiments as files, to be edited
  hydroid thesis --experiments mine -o mine/report

What was made is kept in FOLDER/cache and used again where nothing that it depends on has changed, this program included; a
study that was interrupted goes on where it stopped.")]
pub struct Thesis {
    /// Experiments to make (default: all)
    #[arg(value_name = "EXPERIMENT")]
    pub only: Vec<String>,
    /// The small version: short records, few epochs, few seeds
    #[arg(long)]
    pub quick: bool,
    /// Folder of the page, its figures and numbers, and of what is kept
    #[arg(long, short, value_name = "FOLDER", default_value = "report")]
    pub output: PathBuf,
    /// Folder with experiments, records, models and claims as files (default: those that are built in)
    #[arg(long, value_name = "FOLDER")]
    pub experiments: Option<PathBuf>,
    /// Write those that are built in to a folder and stop
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["only", "quick", "experiments"])]
    pub write_experiments: Option<PathBuf>,
    /// List the experiments and stop
    #[arg(long)]
    pub list: bool,
    /// Keep results without regard to the build of this program, and take those that were kept so: for work on the page, not for
    /// figures
    #[arg(long)]
    pub any_program: bool,
}
