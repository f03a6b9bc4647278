//! Subcommands, one file each.

mod adapt;
mod control;
mod convert;
mod evaluate;
mod export;
mod identify;
mod inspect;
mod live;
mod manoeuvre;
mod previous_output;
mod report;
mod simulate;
mod table;
mod thesis;

use std::process::ExitCode;

use anyhow::Context;

use crate::args::{Args, Command};

/// Outcome of a completed command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    Done,
    /// Done, but a stated criterion was missed.
    Missed,
}

impl From<Outcome> for ExitCode {
    fn from(outcome: Outcome) -> Self {
        match outcome {
            Outcome::Done => Self::SUCCESS,
            Outcome::Missed => Self::from(1),
        }
    }
}

pub fn run(args: Args) -> anyhow::Result<Outcome> {
    if let Some(threads) = args.global.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.into())
            .build_global()
            .context("the thread pool cannot be started")?;
    }
    match args.command {
        Command::Simulate(simulate) => simulate::run(&simulate, args.global),
        Command::Inspect(inspect) => inspect::run(&inspect, args.global),
        Command::Convert(convert) => convert::run(&convert, args.global),
        Command::Identify(identify) => identify::run(&identify, args.global),
        Command::Evaluate(evaluate) => evaluate::run(&evaluate, args.global),
        Command::Adapt(adapt) => adapt::run(&adapt, args.global),
        Command::Manoeuvre(manoeuvre) => manoeuvre::run(&manoeuvre, args.global),
        Command::Control(control) => control::run(&control, args.global),
        Command::Export(export) => export::run(&export, args.global),
        Command::Report(report) => report::run(&report, args.global),
        Command::Live(live) => live::run(&live, args.global),
        Command::Thesis(thesis) => thesis::run(&thesis, args.global),
    }
}

fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    outln!("{}", serde_json::to_string_pretty(value)?);
    Ok(())
}
