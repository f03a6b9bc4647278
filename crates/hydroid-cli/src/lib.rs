//! The `hydroid` command: arguments, progress, exit codes; no mathematics.
//!
//! [`main`] is the command.
//!
//! Exit status: 0 done, 1 done but a stated criterion was missed, 2 wrong input, 130 interrupted.

#![allow(missing_docs, clippy::missing_errors_doc, reason = "its users are the programs of hydroid")]
// In a command, `pub` marks the interface of a module.
#![allow(unreachable_pub)]
// Help texts come from the comments of `args`; backticks would be printed, and brackets are units and sections.
#![allow(clippy::doc_markdown, rustdoc::broken_intra_doc_links)]

#[macro_use]
mod ui;

mod args;
mod commands;
mod global;
mod logs;
mod outputs;

use std::process::ExitCode;

use hydroid_live::program::{interrupt, text};

/// The arguments of the command: the tests compare the documents with them.
#[doc(hidden)]
#[must_use]
pub fn arguments() -> clap::Command {
    <args::Args as clap::CommandFactory>::command()
}

/// Runs the command with the arguments of the process.
pub fn main() -> ExitCode {
    hydroid::key::spell_as_arguments();
    let args = match args::Args::read() {
        Ok(args) => args,
        Err(error) => return failure(&error, std::env::args_os().any(|word| word == "--json")),
    };
    interrupt::catch_interrupt();
    let json = args.global.json;
    match commands::run(args) {
        Ok(outcome) => outcome.into(),
        Err(error) if interrupt::interrupted() => {
            text::print_error(&error);
            ExitCode::from(130)
        }
        Err(error) => failure(&error, json),
    }
}

/// Reports wrong input, with `--json` also as a JSON document.
fn failure(error: &anyhow::Error, json: bool) -> ExitCode {
    if json {
        outln!("{}", serde_json::json!({ "error": text::error_text(error) }));
    }
    text::print_error(error);
    ExitCode::from(2)
}
