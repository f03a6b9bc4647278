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
//! | `session` | the adapter along the stream |
//! | [`Pilot`] | optional controller on a track: each answer has a command |
//! | `answer`, `latency`, `summary` | answers and statistics |
//! | [`Recorder`] | optional black box |
//! | [`State`], `persistence` | state file for a restart |
//!
//! A line that cannot be used is answered too, and does not change the state.

mod answer;
#[doc(hidden)]
pub mod clock;
#[doc(hidden)]
pub mod commands;
#[doc(hidden)]
pub mod latency;
mod layout;
mod line;
mod lines;
mod persistence;
mod pilot;
mod session;
mod state;
mod summary;

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Instant;

use hydroid_core::adapt::{Adapter, Outcome, Rejection};

use crate::black_box::Recorder;
use answer::{Status, Writer};
use clock::{Arrival, Clock};
use commands::Commands;
use hydroid::adapt::Coverage;
use hydroid::adapt::events::{EventText, names};
use hydroid::atomic::WriteError;
use hydroid::fingerprint::Fingerprint;
use hydroid::log::{CommandTiming, LogError, Note};
use hydroid::model::{Mismatch, Model, Port, Reading};
use latency::Latency;
use layout::Layout;
use line::Sample;
use persistence::{SAVE_INTERVAL_S, StateFile};
use session::{Session, Transition};

pub use layout::Position;
pub use lines::{LONGEST_LINE, Line, Lines};
pub use pilot::Pilot;
pub use state::State;
pub(crate) use state::differences;
pub use summary::{LineCounts, Summary};

/// Largest horizon \[samples\].
pub const MAX_HORIZON: usize = 10_000;

/// From this gap on \[s\], a time without a unit is probably not in seconds.
const DOUBTFUL_S: f64 = 30.0;

/// Widths of its range by which a command may lie outside it: the limit beyond which a rollout counts as diverged.
const MOST_WIDTHS: f64 = 10.0;

/// Default of the longest gap of a run \[s\].
fn longest_gap(dt: f64) -> f64 {
    (10.0 * dt).max(1.0)
}

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
    /// Invalid header or options.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The channels of the stream are not those of the model.
    #[error(transparent)]
    Mismatch(#[from] Mismatch),
    /// The horizons do not ascend, or are too large.
    #[error("the horizons must be ascending numbers of samples from 1 to {MAX_HORIZON}")]
    Horizons,
    /// The state file cannot be resumed. It is not changed.
    #[error("the state {} cannot be used: {reason}", path.display())]
    State {
        /// The file.
        path: PathBuf,
        /// Cause and remedy.
        reason: String,
    },
    /// The state cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Answers cannot be written.
    #[error("answers cannot be written: {0}")]
    Output(io::Error),
}

/// Hash of a model file.
pub fn fingerprint(file: &[u8]) -> String {
    let mut hash = Fingerprint::new();
    hash.bytes(file);
    hash.hex()
}

/// A live stream with its adapter.
pub struct Stream {
    model: Model,
    options: Options,
    layout: Option<Layout>,
    session: Session,
    clock: Clock,
    commands: Commands,
    writer: Writer,
    sample: Sample,
    note: String,
    names: Vec<String>,
    /// Numbers of lines and of data rows.
    line: u64,
    row: u64,
    counts: LineCounts,
    latency: Latency,
    state_file: Option<StateFile>,
    notes: Vec<Note>,
    /// Time of the last sample of an earlier session.
    answered: Option<f64>,
    /// How the pose of a steered vessel is read.
    position: Option<Position>,
}

impl Stream {
    /// A stream before its first line.
    ///
    /// # Errors
    /// If an option is invalid.
    pub fn new(model: &Model, adapter: Box<dyn Adapter>, options: Options) -> Result<Self, StreamError> {
        let dt = model.description.dt;
        let horizons = &options.horizons;
        let ascend = horizons.windows(2).all(|pair| pair[0] < pair[1]);
        if !ascend || horizons.iter().any(|h| !(1..=MAX_HORIZON).contains(h)) {
            return Err(StreamError::Horizons);
        }
        let reading = &options.reading.options;
        let clock = Clock::new(dt, reading.max_gap_s.unwrap_or_else(|| longest_gap(dt)))?;
        let commands = Commands::new(adapter.inputs(), dt, reading.command_timing, reading.input_delay)?;
        Ok(Self {
            writer: Writer::new(
                model.description.outputs.iter().map(|port| port.channel.name.as_str()),
                model.description.inputs.iter().map(|port| port.channel.name.as_str()),
            ),
            session: Session::new(adapter, options.horizons.clone(), dt),
            model: model.clone(),
            options,
            layout: None,
            clock,
            commands,
            sample: Sample::default(),
            note: String::new(),
            names: names(model),
            line: 0,
            row: 0,
            counts: LineCounts::default(),
            latency: Latency::default(),
            state_file: None,
            notes: Vec::new(),
            answered: None,
            position: None,
        })
    }

    /// Answers with commands from now on. The lines then hold the pose, read by `position`; commands in them are those
    /// that have acted.
    ///
    /// # Errors
    /// If the delay of the commands is invalid.
    pub fn steer(&mut self, pilot: Pilot, position: Position) -> Result<(), StreamError> {
        let inputs = self.session.adapter().inputs();
        let dt = self.model.description.dt;
        let reading = &mut self.options.reading;
        reading.options.command_timing = CommandTiming::After;
        self.commands = Commands::new(inputs, dt, CommandTiming::After, reading.options.input_delay)?;
        self.session.steer_by(pilot, reading.options.max_gap_s.unwrap_or_else(|| longest_gap(dt)));
        self.position = Some(position);
        Ok(())
    }

    /// Records the adapter in a black box from now on.
    pub fn record(&mut self, recorder: Recorder) {
        self.session.record(recorder);
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
            let answer = self.writer.end(us);
            out.write_all(answer).and_then(|()| out.flush()).map_err(StreamError::Output)?;
            self.latency.add(elapsed_us());
            self.notes.extend(self.session.settle(&self.commands));
        }
        self.save_if_due()
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
            return Ok(false);
        }
        let text = if self.layout.is_some() {
            text
        } else {
            let text = text?;
            let layout = Layout::new(
                text,
                name,
                &self.model,
                &self.options.reading,
                self.position.as_ref(),
                &mut self.notes,
            )?;
            let is_header = matches!(layout.format, layout::Format::Csv { .. });
            self.layout = Some(layout);
            if is_header {
                return Ok(false);
            }
            Ok(text)
        };
        let Some(layout) = &self.layout else { return Ok(false) };
        let row = self.row;
        self.row = self.row.saturating_add(1);
        self.note.clear();
        let read = text.and_then(|text| layout.read(text, number, row, &mut self.sample));
        if let Err(error) = read {
            self.counts.add(Status::Error);
            self.writer.begin(number, None, Status::Error, &error.to_string());
            self.write_steering(false);
            return Ok(true);
        }
        if self.answered.is_some_and(|t| self.sample.t <= t)
            && (self.counts.skipped > 0 || self.clock.repeats(self.sample.t, SAVE_INTERVAL_S))
        {
            self.counts.skipped += 1;
            return Ok(false);
        }
        self.answered = None;
        self.refuse_absurd_commands();
        let status = self.use_sample();
        self.counts.add(status);
        self.writer.begin(number, Some(self.sample.t), status, &self.note);
        let used = matches!(status, Status::Used(_) | Status::Constant | Status::Reset);
        self.write_steering(used);
        if used {
            self.writer.session(&self.session);
            if self.session.pilot().is_some() {
                self.writer.track(&self.session);
            }
        }
        Ok(true)
    }

    /// Commands far outside the range of the model, where a rollout would have diverged, count as missing.
    fn refuse_absurd_commands(&mut self) {
        let ports = &self.model.description.inputs;
        let bounds = |port: &Port| {
            let widest = port.training_range.map_or(port.range.high - port.range.low, |range| {
                (range.high - range.low).max(port.range.high - port.range.low)
            });
            [port.range.low - MOST_WIDTHS * widest, port.range.high + MOST_WIDTHS * widest]
        };
        let plan = self.sample.plan.chunks_exact_mut(ports.len().max(1));
        for (row, is_plan) in
            std::iter::once((&mut self.sample.inputs[..], false)).chain(plan.map(|row| (row, true)))
        {
            for (command, port) in row.iter_mut().zip(ports) {
                let [low, high] = bounds(port);
                if *command < low || *command > high {
                    let what = if is_plan { "planned command" } else { "command" };
                    say(
                        &mut self.note,
                        format_args!(
                            "the {what} {} = {command:e} is far outside its range of {} to {} and was refused",
                            port.channel.name, port.range.low, port.range.high
                        ),
                    );
                    *command = f64::NAN;
                }
            }
        }
    }

    fn write_steering(&mut self, used: bool) {
        if let Some(pilot) = self.session.pilot() {
            self.writer.steering(pilot, used);
        }
    }

    /// Advances to a sample on the grid, and collects remarks.
    fn use_sample(&mut self) -> Status {
        let dt = self.model.description.dt;
        let max_gap = self.options.reading.options.max_gap_s.unwrap_or_else(|| longest_gap(dt));
        let (sample, commands) = (&self.sample, &mut self.commands);
        let (transition, reset) = match self.clock.arrive(sample.t) {
            Arrival::Late(by) => {
                say(&mut self.note, format_args!("the sample is {by:.3} s before the last used one"));
                if by > DOUBTFUL_S {
                    say(
                        &mut self.note,
                        format_args!("if the clock was set back, the next lines will show it"),
                    );
                }
                return Status::Late;
            }
            Arrival::Jump(by) => {
                say(
                    &mut self.note,
                    format_args!("the time jumps by {by:.0} s: not used unless the next lines confirm it"),
                );
                return Status::Late;
            }
            Arrival::Stepped(by) => {
                say(
                    &mut self.note,
                    format_args!(
                        "the clock was set by {by:.3} s, which the last lines confirm: a new run begins, the weights are kept"
                    ),
                );
                // The true time since the last sample of a clock that was set is not known.
                (self.session.begin(commands, sample, Some(max_gap)), true)
            }
            Arrival::Between => return Status::Between,
            Arrival::First => (self.session.begin(commands, sample, None), false),
            Arrival::Gap(gap) => {
                say(
                    &mut self.note,
                    format_args!("no sample for {gap:.3} s: a new run begins, the weights are kept"),
                );
                if gap > DOUBTFUL_S && self.layout.as_ref().is_some_and(Layout::time_is_unstated) {
                    say(
                        &mut self.note,
                        format_args!(
                            "if the time is not in seconds, state its unit, as in --time 'NAME [ms]'"
                        ),
                    );
                }
                (self.session.begin(commands, sample, Some(gap)), true)
            }
            Arrival::Next(steps) => {
                if steps > 1 {
                    say(&mut self.note, format_args!("{} missing samples were predicted", steps - 1));
                }
                (self.session.advance_to(steps, commands, sample), false)
            }
        };
        self.add_remarks(transition);
        let outcome = self.session.adapter().outcome();
        match outcome {
            Outcome::Inflated { deviations, weight } => say(
                &mut self.note,
                format_args!(
                    "innovation of {deviations:.1} standard deviations, accepted with weight {weight:.2}"
                ),
            ),
            Outcome::Rejected(Rejection::Outlier { deviations }) => {
                say(&mut self.note, format_args!("innovation of {deviations:.1} standard deviations"));
            }
            Outcome::Rejected(Rejection::NotFinite) => {
                say(&mut self.note, format_args!("value too large for the filter"));
            }
            Outcome::Waiting | Outcome::Accepted | Outcome::RolledBack => {}
        }
        if let Some(guard) = self.session.adapter().guard() {
            for event in guard.events() {
                say(
                    &mut self.note,
                    format_args!("{}", EventText { action: &event.action, names: &self.names }),
                );
            }
        }
        let constant = self.session.pilot().is_some_and(|pilot| !pilot.adapts());
        match outcome {
            _ if reset => Status::Reset,
            Outcome::Waiting if constant => Status::Constant,
            outcome => Status::Used(outcome),
        }
    }

    fn add_remarks(&mut self, transition: Transition) {
        if transition.held {
            say(&mut self.note, format_args!("a missing command was replaced by the last one"));
        }
        if transition.lost {
            say(&mut self.note, format_args!("a new run begins because the previous command is unknown"));
        }
        if !self.commands.known() {
            say(&mut self.note, format_args!("the current command is not known yet"));
        }
    }

    /// Whether the header or the first object has arrived.
    pub fn has_begun(&self) -> bool {
        self.layout.is_some()
    }

    /// Notes since the last call.
    pub fn take_notes(&mut self) -> Vec<Note> {
        std::mem::take(&mut self.notes)
    }

    /// Summary of the lines so far.
    pub fn summary(&self) -> Summary {
        let [all, of_80, of_95] = self.session.banded().map(|n| n as f64);
        Summary {
            lines: self.counts,
            coverage: Coverage { of_80: of_80 / all, of_95: of_95 / all },
            latency: self.latency.times(),
        }
    }

    /// Current weights of the adapter.
    pub fn weights(&self) -> &[f64] {
        self.session.adapter().weights()
    }
}

fn say(note: &mut String, remark: std::fmt::Arguments<'_>) {
    if !note.is_empty() {
        note.push_str("; ");
    }
    let _ = note.write_fmt(remark);
}
