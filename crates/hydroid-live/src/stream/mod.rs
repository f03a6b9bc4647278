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
use hydroid::closed_loop::longest_gap;
use hydroid::evaluate::DesignRange;
use hydroid::fingerprint::Fingerprint;
use hydroid::log::{CommandTiming, LogError, Note};
use hydroid::model::{Mismatch, Model, Port, Reading};
use latency::Latency;
use layout::Layout;
use line::Sample;
use persistence::{SAVE_INTERVAL_S, StateFile};
use session::{Session, Transition};

pub use hydroid::closed_loop::Pilot;
pub use layout::Position;
pub use lines::{LONGEST_LINE, Line, Lines};
pub use state::State;
pub(crate) use state::differences;
pub use summary::{LineCounts, Summary};

/// Largest horizon \[samples\].
pub const MAX_HORIZON: usize = 10_000;

/// From this gap on \[s\], a time without a unit is probably not in seconds.
const DOUBTFUL_S: f64 = 30.0;

/// Widths of its range by which a command may lie outside it: the limit beyond which a rollout counts as diverged.
const MOST_WIDTHS: f64 = 10.0;

/// The commands that an input accepts. An input that hardly moved in the training has the scale of its values, at least 1
/// in its unit, as the range of a constant channel.
fn bounds(port: &Port) -> [f64; 2] {
    let DesignRange { low, high } = port.range;
    let trained = port.training_range.map_or(0.0, |range| range.high - range.low);
    let scale = [high - low, trained, low.abs(), high.abs(), 1.0].into_iter().fold(0.0, f64::max);
    [low - MOST_WIDTHS * scale, high + MOST_WIDTHS * scale]
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
    /// Fingerprint of the first readable data line; empty before it.
    first: String,
    /// Accepted commands.
    bounds: Vec<[f64; 2]>,
    /// The earlier session of a resumed state, until a line is new.
    earlier: Option<Earlier>,
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
            first: String::new(),
            bounds: model.description.inputs.iter().map(bounds).collect(),
            earlier: None,
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
        // The limits of the actuators are stated, and need not be those of the training.
        for ([low, high], limits) in self.bounds.iter_mut().zip(pilot.limits()) {
            (*low, *high) = (low.min(limits.low), high.max(limits.high));
        }
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
        let read = text.and_then(|text| {
            layout.read(text, number, row, &mut self.sample)?;
            Ok(text)
        });
        let text = match read {
            Ok(text) => text,
            Err(error) => {
                let _ = write!(self.note, "{error}");
                self.answer_unused(number, None, Status::Error);
                return Ok(true);
            }
        };
        if self.is_repeated(row, text, self.sample.t) {
            say(&mut self.note, format_args!("answered before the restart"));
            self.answer_unused(number, Some(self.sample.t), Status::Repeated);
            return Ok(true);
        }
        self.refuse_absurd_commands();
        let status = self.use_sample();
        if !matches!(status, Status::Used(_) | Status::Constant | Status::Reset) {
            self.answer_unused(number, Some(self.sample.t), status);
            return Ok(true);
        }
        self.counts.add(status);
        self.writer.begin(number, Some(self.sample.t), status, &self.note);
        self.write_steering(true);
        self.writer.session(&self.session);
        if self.session.pilot().is_some() {
            self.writer.track(&self.session);
        }
        Ok(true)
    }

    fn answer_unused(&mut self, line: u64, t: Option<f64>, status: Status) {
        self.counts.add(status);
        self.writer.begin(line, t, status, &self.note);
        self.write_steering(false);
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
                self.clock.believe_next();
            }
        }
        let repeated =
            if earlier.is_sent_again { row < earlier.rows } else { self.clock.repeats(t, SAVE_INTERVAL_S) };
        if !repeated {
            self.earlier = None;
        }
        repeated
    }

    /// Commands far outside the range of the model, where a rollout would have diverged, count as missing.
    fn refuse_absurd_commands(&mut self) {
        let inputs = self.bounds.len().max(1);
        let plan = self.sample.plan.chunks_exact_mut(inputs);
        for (row, is_plan) in
            std::iter::once((&mut self.sample.inputs[..], false)).chain(plan.map(|row| (row, true)))
        {
            let ports = self.bounds.iter().zip(&self.model.description.inputs);
            for (command, ([low, high], port)) in row.iter_mut().zip(ports) {
                if *command < *low || *command > *high {
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
                self.wait_for_clock();
                return Status::Late;
            }
            Arrival::Ahead(by) => {
                say(
                    &mut self.note,
                    format_args!(
                        "the sample is {by:.3} s after the last used one: used if the next lines confirm it"
                    ),
                );
                self.wait_for_clock();
                return Status::Ahead;
            }
            Arrival::SetBack(by) => {
                say(
                    &mut self.note,
                    format_args!(
                        "the clock was set back by {by:.3} s: a new run begins, the weights are kept"
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
        let reset = reset || transition.restarted;
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
        self.explain_unknown();
        let constant = self.session.pilot().is_some_and(|pilot| !pilot.adapts());
        match outcome {
            _ if reset => Status::Reset,
            Outcome::Waiting if constant => Status::Constant,
            outcome => Status::Used(outcome),
        }
    }

    /// A second line in a row beside the time grid is no wrong stamp: the command in force is of unknown age.
    fn wait_for_clock(&mut self) {
        if self.clock.set_aside() > 1 && self.session.rest(&mut self.commands) {
            say(&mut self.note, format_args!("the commands rest until the time is known"));
        }
    }

    fn add_remarks(&mut self, transition: Transition) {
        if transition.restarted {
            say(
                &mut self.note,
                format_args!(
                    "the state of the adapter was not finite: it begins again with the weights of the model"
                ),
            );
        }
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

    /// Says why numbers of the answer are null.
    fn explain_unknown(&mut self) {
        let Self { session, sample, names, note, .. } = self;
        let innovations = session.adapter().innovations();
        for (i, (y, estimate)) in sample.outputs.iter().zip(session.estimate()).enumerate() {
            if !estimate.is_finite() {
                say(note, format_args!("{} is not known yet", names[i]));
            } else if y.is_nan() {
                say(note, format_args!("{} was not measured", names[i]));
            } else if innovations.get(i).is_some_and(|innovation| !innovation.value.is_finite()) {
                say(note, format_args!("{} was not used", names[i]));
            }
        }
        let [predictions, bands] = session.unknown();
        if predictions > 0 {
            let all = session.horizons().len();
            say(note, format_args!("no finite prediction at {predictions} of {all} horizons"));
        } else if bands > 0 {
            let all = session.horizons().len();
            say(note, format_args!("no prediction bands at {bands} of {all} horizons"));
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
