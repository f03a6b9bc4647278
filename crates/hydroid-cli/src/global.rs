//! Options of every command.

use clap::Args;

/// Options of every command.
#[derive(Clone, Copy, Debug, Args)]
pub struct Global {
    /// Print one JSON document on standard output, and nothing else
    #[arg(long, global = true)]
    pub json: bool,
    /// Number of threads (default: one per core); the result does not depend on it
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Hide the progress bar and notes; results, warnings and errors remain
    #[arg(long, short, global = true)]
    pub quiet: bool,
}
