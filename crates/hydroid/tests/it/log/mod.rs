//! The reader and the preparation on small logs, on arbitrary bytes, and on the real logs.

#![allow(
    clippy::format_push_string,
    clippy::format_collect,
    clippy::cast_lossless,
    clippy::cast_possible_wrap,
    reason = "tests write small logs in the plainest way"
)]

mod bad_input;
mod clock;
mod clocks;
mod inspect_file;
mod inspecting;
mod parts;
mod pose;
mod properties;
mod reading;
mod real_logs;
mod rules;
mod selection;
mod split;
mod stamp;
mod towed;
mod units;

use hydroid::log::{LogError, PrepareOptions, Prepared, RawLog, Selection, prepare, read_from};

/// A log from its text.
fn log(text: &str) -> RawLog {
    log_as("log.csv", text)
}

fn log_as(name: &str, text: &str) -> RawLog {
    read_from(text.as_bytes(), name).unwrap()
}

/// Prepared log; by default u is the only output and n the only input.
fn prepared(text: &str) -> Prepared {
    prepared_with(text, &PrepareOptions::default())
}

fn prepared_with(text: &str, options: &PrepareOptions) -> Prepared {
    prepare(&[log(text)], &Selection::of("u", "n").unwrap(), options).unwrap()
}

fn error(text: &str) -> String {
    error_of(
        read_from(text.as_bytes(), "log.csv")
            .and_then(|log| prepare(&[log], &Selection::of("u", "n").unwrap(), &PrepareOptions::default())),
    )
}

fn error_of<T>(result: Result<T, LogError>) -> String {
    match result {
        Ok(_) => panic!("expected an error"),
        Err(e) => e.to_string(),
    }
}

/// Rows `t,u,n` at 10 Hz from functions of the sample number.
fn table(rows: usize, mut u: impl FnMut(usize) -> String, n: impl Fn(usize) -> String) -> String {
    let mut text = "t,u [m/s],n\n".to_owned();
    for k in 0..rows {
        text += &format!("{:.1},{},{}\n", k as f64 * 0.1, u(k), n(k));
    }
    text
}

/// All values of an output of a run.
fn output(prepared: &Prepared, run: usize, channel: usize) -> Vec<f64> {
    prepared.runs[run].outputs.column(channel).collect()
}

fn input(prepared: &Prepared, run: usize, channel: usize) -> Vec<f64> {
    prepared.runs[run].inputs.column(channel).collect()
}

fn has_note(prepared: &Prepared, part: &str) -> bool {
    prepared.notes.iter().any(|n| n.message.contains(part))
}
