//! Arguments of `hydroid study`.

use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args as ClapArgs, Subcommand};

/// Run a measuring campaign
#[derive(Debug, ClapArgs)]
pub struct Study {
    #[command(subcommand)]
    pub campaign: StudyKind,
}

#[derive(Debug, Subcommand)]
pub enum StudyKind {
    Guard(GuardStudy),
}

/// Adaptation with and without the guard on days with drawn faults, and on clean days
#[derive(Debug, ClapArgs)]
#[command(after_help = "Examples:
  hydroid study guard --seeds 1..100                        equations and networks on the built-in vessels
  hydroid study guard --seeds 1..100 --quick                the same with short trainings
  hydroid study guard --seeds 1..50 --model a.safetensors --log b.csv --log c.csv

Each seed is a day: it draws a model, a log, one or two faults, and the options of the learner. FOLDER/days.csv has a row
for each day, FOLDER/cache the built-in models. Exit status 1: a day exceeds the guarantee, judged against the truth.")]
pub struct GuardStudy {
    /// Seeds of the days: the first and the one after the last
    #[arg(long, value_name = "A..B", default_value = "1..101")]
    pub seeds: Seeds,
    /// Models in place of the built-in ones; each follows every log
    #[arg(long, value_name = "MODEL", requires = "logs")]
    pub model: Vec<PathBuf>,
    /// Logs that the models did not learn from
    #[arg(long = "log", value_name = "LOG", requires = "model")]
    pub logs: Vec<PathBuf>,
    /// Only bad days
    #[arg(long)]
    pub no_clean: bool,
    /// Short trainings of the built-in models
    #[arg(long, conflicts_with = "model")]
    pub quick: bool,
    /// Folder of days.csv and of the cache
    #[arg(long, short, value_name = "FOLDER", default_value = "guard-study")]
    pub output: PathBuf,
}

/// A range of seeds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Seeds(pub Range<u64>);

impl FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed =
            text.split_once("..").and_then(|(a, b)| Some(a.trim().parse().ok()?..b.trim().parse().ok()?));
        parsed.filter(|seeds| seeds.start < seeds.end).map(Self).ok_or_else(|| {
            format!("'{text}' is no range of seeds: write the first and the one after the last, as in 1..101")
        })
    }
}
