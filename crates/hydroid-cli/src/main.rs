//! The `hydroid` command: arguments, progress, exit codes; no mathematics.
//!
//! Exit status: 0 done, 1 done but a stated criterion was missed, 2 wrong input, 130 interrupted.

// A binary has no outside: `pub` says which module offers what to which.
#![allow(unreachable_pub)]
// The comments of `args` are printed as help, where backticks would stand as they are.
#![allow(clippy::doc_markdown)]

#[macro_use]
mod ui;

mod args;
mod commands;
mod config;
mod logs;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let args = args::Args::parse();
    ui::catch_interrupt();
    let json = args.global.json;
    match commands::run(args) {
        Ok(outcome) => outcome.into(),
        Err(error) if ui::interrupted() => {
            ui::complain(&error);
            ExitCode::from(130)
        }
        Err(error) => {
            if json {
                // A program that asked for JSON gets the reason as JSON too.
                outln!("{}", serde_json::json!({ "error": ui::explain(&error) }));
            }
            ui::complain(&error);
            ExitCode::from(2)
        }
    }
}
