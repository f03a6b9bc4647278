//! Online adaptation to a live stream, and its protocol: each line is answered at once.
//!
//! [`Stream`] reads lines (CSV with a header, or JSON objects) and writes one line of JSON for each: status of the sample,
//! estimate of the outputs, predictions with bands. The model is any [`Adapter`].
//!
//! | part | content |
//! | --- | --- |
//! | [`Lines`] | lines of an untrusted source |
//! | `layout`, `line` | assignment of columns; a line as numbers |
//! | `clock`, `commands` | time grid of the model; alignment of the commands |
//! | `follower`, `session` | from each sample to its answer; the adapter along the stream |
//! | [`Pilot`] | optional controller on a track: each answer has a command |
//! | `answer`, `latency`, `summary` | answers and statistics |
//! | [`Recorder`] | optional black box |
//! | [`State`], `persistence` | state file for a restart |
//!
//! A line that cannot be used is answered too, and does not change the state of the model. A command rests while a
//! measurement on which it depends is too old ([`Pilot::liveness`]); [`Stream::wait`] says so while no line arrives.

mod answer;
#[doc(hidden)]
pub mod clock;
#[doc(hidden)]
pub mod commands;
mod follower;
#[doc(hidden)]
pub mod latency;
mod layout;
mod line;
mod lines;
mod persistence;
mod session;
mod state;
mod summary;

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Instant;

use hydroid_core::adapt::Adapter;
use hydroid_core::control::Mode;

use crate::black_box::Recorder;
use answer::Status;
use follower::say;
use hydroid::adapt::Coverage;
use hydroid::adapt::events::names;
use hydroid::atomic::WriteError;
use hydroid::fingerprint::Fingerprint;
use hydroid::log::{CommandTiming, LogError, Note};
use hydroid::model::{Mismatch, Model, Reading};
use latency::Latency;
use layout::Layout;
use persistence::{SAVE_INTERVAL_S, StateFile};

pub(crate) use follower::Follower;
pub use hydroid::closed_loop::Pilot;
pub use layout::Position;
pub(crate) use line::Sample;
pub use lines::{LONGEST_LINE, Line, Lines};
pub use state::State;
pub(crate) use state::differences;
pub use summary::{LineCounts, Summary};

/// Largest horizon \[samples\].
pub const MAX_HORIZON: usize = 10_000;

/// Time after which it is said again that measurements are too old \[s\].
const SAY_AGAIN_S: f64 = 1.0;

/// Options of a stream.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Name of the stream, for messages.
    pub name: String,
    /// Selection of columns, and alignment of commands.
    pub reading: Reading,
    /// Horizons of the predictions, ascending \[samples\].
    pub horizons: Vec<usize>,
    /// Whether answers contain their computing time, which is not reproducible.
    pub timing: bool,
}

/// Errors of a stream.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Mismatch(#[from] Mismatch),
    #[error("the horizons must be ascending numbers of samples from 1 to {MAX_HORIZON}")]
    Horizons,
    /// The state file cannot be resumed. It is not changed.
    #[error("the state {} cannot be used: {reason}", path.display())]
    State { path: PathBuf, reason: String },
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("answers cannot be written: {0}")]
    Output(io::Error),
}

/// Hash of a model file.
pub fn fingerprint(file: &[u8]) -> String {
    let mut hash = Fingerprint::new();
    hash.bytes(file);
    hash.hex()
}

/// The session before a restart.
struct Earlier {
    /// Fingerprint of its first readable data line.
    first: String,
    /// Number of its data lines up to the state.
    rows: u64,
    is_sent_again: bool,
}

/// A live stream with its adapter.
pub struct Stream {
    follower: Follower,
    options: Options,
    layout: Option<Layout>,
    sample: Sample,
    /// Numbers of lines and of data rows.
    line: u64,
    row: u64,
    counts: LineCounts,
    latency: Latency,
    state_file: Option<StateFile>,
    notes: Vec<Note>,
    /// Fingerprint of the first readable data line; empty before it.
    first: String,
    /// The earlier session of a resumed state, until a line is new.
    earlier: Option<Earlier>,
    /// How the pose of a steered vessel is read.
    position: Option<Position>,
    /// Time since the last answer in which no line arrived \[s\].
    silent_s: f64,
    /// Whether the last answer says that measurements are too old.
    said_lost: bool,
}

impl Stream {
    /// A stream before its first line.
    pub fn new(model: &Model, adapter: Box<dyn Adapter>, options: Options) -> Result<Self, StreamError> {
        let horizons = &options.horizons;
        let ascend = horizons.windows(2).all(|pair| pair[0] < pair[1]);
        if !ascend || horizons.iter().any(|h| !(1..=MAX_HORIZON).contains(h)) {
            return Err(StreamError::Horizons);
        }
        Ok(Self {
            follower: Follower::new(model, adapter, horizons, options.reading.options)?,
            options,
            layout: None,
            sample: Sample::default(),
            line: 0,
            row: 0,
            counts: LineCounts::default(),
            latency: Latency::default(),
            state_file: None,
            notes: Vec::new(),
            first: String::new(),
            earlier: None,
            position: None,
            silent_s: 0.0,
            said_lost: false,
        })
    }

    /// Answers with commands from now on. The lines then hold the pose, read by `position`; commands in them are those
    /// that have acted.
    pub fn steer(&mut self, pilot: Pilot, position: Position) -> Result<(), StreamError> {
        self.options.reading.options.command_timing = CommandTiming::After;
        self.follower.steer(pilot)?;
        self.position = Some(position);
        Ok(())
    }

    /// Records the adapter in a black box from now on.
    pub fn record(&mut self, recorder: Recorder) {
        self.follower.session.record(recorder);
    }

    /// Processes a line, writes and flushes its answer (the header and blank lines have none), and saves the state if due.
    ///
    /// # Errors
    /// If the header is invalid, or a file cannot be written.
    pub fn serve(&mut self, line: Line<'_>, out: &mut dyn Write) -> Result<(), StreamError> {
        let start = Instant::now();
        self.line = self.line.saturating_add(1);
        let elapsed_us = || start.elapsed().as_secs_f64() * 1e6;
        if self.take(line)? {
            let us = self.options.timing.then(elapsed_us);
            let answer = self.follower.writer.end(us);
            out.write_all(answer).and_then(|()| out.flush()).map_err(StreamError::Output)?;
            self.speak();
            self.latency.add(elapsed_us());
            self.notes.extend(self.follower.session.settle(&self.follower.commands));
        }
        self.save_if_due();
        Ok(())
    }

    /// States that no line has arrived for some more time \[s\]. If a measurement on which the command depends is too old and
    /// nothing was said for a second, a line with the status `lost` is written and flushed: it is not the answer to a line.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn wait(&mut self, seconds: f64, out: &mut dyn Write) -> Result<(), StreamError> {
        self.follower.note.clear();
        self.follower.wait(seconds);
        self.silent_s += seconds;
        if self.due_s().is_none_or(|due| due > 0.0) {
            return Ok(());
        }
        self.speak();
        self.follower.explain_lost();
        self.answer_unused(self.line, None, Status::Lost);
        let line = self.follower.writer.end(None);
        out.write_all(line).and_then(|()| out.flush()).map_err(StreamError::Output)
    }

    /// States that no line will follow, for a reason in words. While commands are not at their neutral values, a line with the status
    /// `lost` and the next ones on the way there is written and flushed. Returns the time to the next call \[s\]; `None` if none is
    /// needed.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn end(&mut self, reason: &str, out: &mut dyn Write) -> Result<Option<f64>, StreamError> {
        let rests_in_s = |stream: &Self| stream.follower.session.pilot().and_then(Pilot::rests_in_s);
        if self.row == 0 || rests_in_s(self).is_none() {
            return Ok(None);
        }
        self.follower.note.clear();
        self.follower.wait(f64::INFINITY);
        say(&mut self.follower.note, format_args!("{reason}: the commands rest"));
        self.answer_unused(self.line, None, Status::Lost);
        let line = self.follower.writer.end(None);
        out.write_all(line).and_then(|()| out.flush()).map_err(StreamError::Output)?;
        Ok(rests_in_s(self))
    }

    /// States that the next line has arrived after some more time \[s\] without one.
    pub fn arrive_after(&mut self, seconds: f64) {
        self.follower.arrive_after(seconds);
        self.silent_s += seconds;
    }

    /// Time without a line after which [`wait`](Self::wait) says that measurements are too old \[s\]; `None` before the first
    /// answer and without a controller.
    pub fn due_s(&self) -> Option<f64> {
        let pilot = self.follower.session.pilot().filter(|_| self.row > 0)?;
        let liveness = pilot.liveness();
        Some(if liveness.is_alive() {
            // The limit itself is not beyond it.
            liveness.remaining_s() + 1e-3
        } else if self.said_lost {
            (pilot.rests_in_s().unwrap_or(SAY_AGAIN_S) - self.silent_s).max(0.0)
        } else {
            0.0
        })
    }

    /// An answer is written.
    fn speak(&mut self) {
        self.silent_s = 0.0;
        self.said_lost = self.follower.session.pilot().is_some_and(|pilot| !pilot.liveness().is_alive());
    }

    fn take(&mut self, line: Line<'_>) -> Result<bool, StreamError> {
        let (name, number) = (&self.options.name, self.line);
        let bad = |reason: String| LogError::BadLine { path: name.clone(), line: number, reason };
        let text = match line {
            Line::TooLong => {
                Err(bad(format!("longer than {LONGEST_LINE} bytes; is an end of line missing?")))
            }
            Line::Whole(bytes) => std::str::from_utf8(bytes).map_err(|_| LogError::NotUtf8 {
                path: name.clone(),
                line: number,
                remedy: "send the stream as UTF-8",
            }),
        };
        if matches!(text, Ok(text) if text.trim().is_empty()) {
            self.follower.await_on();
            return Ok(false);
        }
        let text = if self.layout.is_some() {
            text
        } else {
            let text = text?;
            let layout = Layout::new(
                text,
                name,
                &self.follower.model,
                &self.options.reading,
                self.position.as_ref(),
                &mut self.notes,
            )?;
            let is_header = matches!(layout.format, layout::Format::Csv { .. });
            self.follower.time_is_unstated = layout.time_is_unstated();
            self.layout = Some(layout);
            if is_header {
                return Ok(false);
            }
            Ok(text)
        };
        let Some(layout) = &self.layout else { return Ok(false) };
        let row = self.row;
        self.row = self.row.saturating_add(1);
        self.follower.note.clear();
        let read = text.and_then(|text| {
            layout.read(text, number, row, &mut self.sample)?;
            Ok(text)
        });
        let text = match read {
            Ok(text) => text,
            Err(error) => {
                let _ = write!(self.follower.note, "{error}");
                self.follower.pass_line();
                self.answer_unused(number, None, Status::Error);
                return Ok(true);
            }
        };
        if self.is_repeated(row, text, self.sample.t) {
            say(&mut self.follower.note, format_args!("answered before the restart"));
            self.follower.pass_repeated();
            self.answer_unused(number, Some(self.sample.t), Status::Repeated);
            return Ok(true);
        }
        self.follower.refuse_absurd_commands(&mut self.sample);
        self.follower.screen(&mut self.sample);
        let status = self.follower.follow(&self.sample);
        if !matches!(status, Status::Used(_) | Status::Constant | Status::Reset) {
            self.answer_unused(number, Some(self.sample.t), status);
            return Ok(true);
        }
        self.counts.add(status);
        self.follower.write(number, self.sample.t, status);
        Ok(true)
    }

    fn answer_unused(&mut self, line: u64, t: Option<f64>, status: Status) {
        self.counts.add(status);
        self.follower.writer.begin(line, t, status, &self.follower.note);
        self.follower.write_steering(false);
    }

    /// Whether the readable data line `row` with time `t` was answered before the restart. If the first readable line is
    /// that of the earlier session, the source is sent again from its start, and the lines are counted. Otherwise the source
    /// goes on, and repeats at most what the state may lack. The first line that is new ends the search; its stamp is
    /// believed, as at the start of a session.
    fn is_repeated(&mut self, row: u64, text: &str, t: f64) -> bool {
        let is_first = self.first.is_empty();
        if is_first {
            self.first = fingerprint(text.trim().as_bytes());
        }
        let Some(earlier) = &mut self.earlier else { return false };
        if is_first {
            earlier.is_sent_again = earlier.first == self.first;
            if !earlier.is_sent_again {
                self.follower.clock.believe_next();
            }
        }
        let repeated = if earlier.is_sent_again {
            row < earlier.rows
        } else {
            self.follower.clock.repeats(t, SAVE_INTERVAL_S)
        };
        if !repeated {
            self.earlier = None;
        }
        repeated
    }

    /// Whether the header or the first object has arrived.
    pub fn has_begun(&self) -> bool {
        self.layout.is_some()
    }

    /// Whether a steered vessel was left before the end of its task with neutral commands: stopped, or blind.
    pub fn is_left_without_task(&self) -> bool {
        self.follower.pilot().is_some_and(|pilot| matches!(pilot.mode(), Mode::Stopped | Mode::Blind))
    }

    /// Notes since the last call.
    pub fn take_notes(&mut self) -> Vec<Note> {
        std::mem::take(&mut self.notes)
    }

    /// Summary of the lines so far.
    pub fn summary(&self) -> Summary {
        let [all, of_80, of_95] = self.follower.session.banded().map(|n| n as f64);
        Summary {
            lines: self.counts,
            coverage: Coverage { of_80: of_80 / all, of_95: of_95 / all },
            latency: self.latency.times(),
        }
    }

    /// Current weights of the adapter.
    pub fn weights(&self) -> &[f64] {
        self.follower.session.adapter().weights()
    }
}
