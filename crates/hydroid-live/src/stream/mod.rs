//! A model that learns from a live stream: each line that comes in is answered at once.
//!
//! [`Stream`] takes lines, CSV with a header or JSON objects, and writes one JSON line for each: what became of the
//! sample, the outputs as they are estimated, predictions with their bands. It knows the learner as an
//! [`Adapter`] and nothing else, so that whatever learns can be served.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`Lines`] | lines of a source that may send anything |
//! | `layout`, `line` | which columns are what; a line as numbers |
//! | `clock`, `commands` | the place of a sample on the model's grid; which command acts where |
//! | `session` | the walk of the adapter |
//! | `answer`, `latency`, `summary` | what is said of it |
//! | [`Recorder`] | the black box, if there is one |
//! | [`State`], `keep` | the file from which a stream goes on after it was killed |
//!
//! A line that cannot be used is answered as well, and changes nothing.

mod answer;
mod clock;
mod commands;
mod keep;
mod latency;
mod layout;
mod line;
mod lines;
mod session;
mod state;
mod summary;

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Instant;

use hydroid_core::adapt::guard::Action;
use hydroid_core::adapt::{Adapter, Outcome, Rejection};

use crate::black_box::Recorder;
use answer::{Status, Writer};
use clock::{Arrival, Clock};
use commands::Commands;
use hydroid::adapt::Coverage;
use hydroid::adapt::events::{EventText, names};
use hydroid::atomic::WriteError;
use hydroid::fingerprint::Fingerprint;
use hydroid::log::{LogError, Note};
use hydroid::model::{Mismatch, Model, Reading};
use keep::Keeper;
use latency::Latency;
use layout::Layout;
use line::Sample;
use session::{Session, Walked};

pub use lines::{LONGEST_LINE, Line, Lines};
pub use state::State;
pub(crate) use state::differences;
pub use summary::{LineCounts, Summary};

/// Farthest horizon \[samples\].
pub const FARTHEST: usize = 10_000;

/// Gaps \[s\] from which on a time without a unit is doubted to be in seconds.
const DOUBTFUL_S: f64 = 30.0;

/// How to serve.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Where the stream comes from, for messages.
    pub name: String,
    /// Which columns are what, and how commands are aligned.
    pub reading: Reading,
    /// Horizons of the predictions, ascending \[samples\].
    pub horizons: Vec<usize>,
    /// Whether answers say how long they took: they are not the same twice then.
    pub timing: bool,
}

/// Why a stream cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// Header or options.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The stream's channels are not the model's.
    #[error(transparent)]
    Mismatch(#[from] Mismatch),
    /// Horizons do not ascend, or there are too far ones.
    #[error("horizons must ascend from 1 to {FARTHEST} samples at the most")]
    Horizons,
    /// A state file that cannot be gone on from. It is left as it is.
    #[error("the state {} cannot be used: {reason}", path.display())]
    State {
        /// The file.
        path: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
    /// The state cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Answers cannot be written.
    #[error("answers cannot be written: {0}")]
    Output(io::Error),
}

/// The fingerprint of a model file.
pub fn fingerprint(file: &[u8]) -> String {
    let mut hash = Fingerprint::new();
    hash.bytes(file);
    hash.hex()
}

/// A stream that is served.
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
    /// Names of outputs, then inputs.
    names: Vec<String>,
    /// Lines that came, and rows among them.
    line: u64,
    row: u64,
    counts: LineCounts,
    latency: Latency,
    keeper: Option<Keeper>,
    notes: Vec<Note>,
    /// Time up to which an earlier session has answered.
    answered: Option<f64>,
}

impl Stream {
    /// A stream that begins.
    ///
    /// # Errors
    /// If options make no sense.
    pub fn new(model: &Model, adapter: Box<dyn Adapter>, options: Options) -> Result<Self, StreamError> {
        let dt = model.description.dt;
        let horizons = &options.horizons;
        let ascend = horizons.windows(2).all(|pair| pair[0] < pair[1]);
        if !ascend || horizons.iter().any(|h| !(1..=FARTHEST).contains(h)) {
            return Err(StreamError::Horizons);
        }
        let reading = &options.reading.options;
        let clock = Clock::new(dt, reading.max_gap_s.unwrap_or_else(|| (10.0 * dt).max(1.0)))?;
        let commands = Commands::new(adapter.inputs(), dt, reading.command_timing, reading.input_delay)?;
        Ok(Self {
            writer: Writer::new(model.description.outputs.iter().map(|port| port.channel.name.as_str())),
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
            latency: Latency::new(),
            keeper: None,
            notes: Vec::new(),
            answered: None,
        })
    }

    /// Notes the walk in a black box from here on.
    pub fn record(&mut self, recorder: Recorder) {
        self.session.record(recorder);
    }

    /// Takes a line, and writes and flushes its answer if it has one: the header and blank lines have none. Then
    /// keeps the state if it is time.
    ///
    /// # Errors
    /// If the header cannot be used, or nothing can be written.
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
        self.keep_if_due()
    }

    /// Reads and uses a line; says whether there is an answer.
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
            let layout = Layout::new(text, name, &self.model, &self.options.reading, &mut self.notes)?;
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
            return Ok(true);
        }
        if self.answered.is_some_and(|t| self.sample.t <= t) {
            self.counts.skipped += 1;
            return Ok(false);
        }
        self.answered = None;
        let status = self.use_sample();
        self.counts.add(status);
        self.writer.begin(number, Some(self.sample.t), status, &self.note);
        if matches!(status, Status::Used(_) | Status::Reset) {
            self.writer.session(&self.session);
        }
        Ok(true)
    }

    /// Walks to the sample if it has a place, and notes what is to be said of it.
    fn use_sample(&mut self) -> Status {
        let (sample, commands) = (&self.sample, &mut self.commands);
        let (walked, reset) = match self.clock.arrive(sample.t) {
            Arrival::Late(by) => {
                say(&mut self.note, format_args!("{by:.3} s before the last sample that was used"));
                if by > DOUBTFUL_S {
                    say(&mut self.note, format_args!("if the clock began anew, start a new session"));
                }
                return Status::Late;
            }
            Arrival::Between => return Status::Between,
            Arrival::First => (self.session.begin(commands, sample), false),
            Arrival::Gap(gap) => {
                say(
                    &mut self.note,
                    format_args!("no sample for {gap:.3} s: a new run begins, what was learned is kept"),
                );
                if gap > DOUBTFUL_S && self.layout.as_ref().is_some_and(Layout::time_is_unstated) {
                    say(
                        &mut self.note,
                        format_args!("if the time does not count seconds, say so with --time 'NAME [ms]'"),
                    );
                }
                (self.session.begin(commands, sample), true)
            }
            Arrival::Next(steps) => {
                if steps > 1 {
                    say(&mut self.note, format_args!("{} places without a sample were predicted", steps - 1));
                }
                (self.session.walk(steps, commands, sample), false)
            }
        };
        self.tell(walked);
        let outcome = self.session.adapter().outcome();
        match outcome {
            Outcome::Inflated { deviations, weight } => say(
                &mut self.note,
                format_args!("{deviations:.1} standard deviations off, learned from with weight {weight:.2}"),
            ),
            Outcome::Rejected(Rejection::Outlier { deviations }) => {
                say(&mut self.note, format_args!("{deviations:.1} standard deviations off"));
            }
            Outcome::Rejected(Rejection::NotFinite) => {
                say(&mut self.note, format_args!("too large to learn from"));
            }
            Outcome::Waiting | Outcome::Accepted | Outcome::RolledBack => {}
        }
        if let Some(guard) = self.session.adapter().guard() {
            let happened =
                guard.events().iter().filter(|event| !matches!(event.action, Action::SnapshotTaken { .. }));
            for event in happened {
                say(
                    &mut self.note,
                    format_args!("{}", EventText { action: &event.action, names: &self.names }),
                );
            }
        }
        if reset { Status::Reset } else { Status::Used(outcome) }
    }

    fn tell(&mut self, walked: Walked) {
        if walked.held {
            say(&mut self.note, format_args!("a missing command holds the last one"));
        }
        if walked.lost {
            say(&mut self.note, format_args!("the run begins here: the command before is not known"));
        }
        if !self.commands.known() {
            say(&mut self.note, format_args!("the command that acts now is not known yet"));
        }
    }

    /// Whether the header, or the first object, has come.
    pub fn has_begun(&self) -> bool {
        self.layout.is_some()
    }

    /// What was converted or noticed since the last call.
    pub fn take_notes(&mut self) -> Vec<Note> {
        std::mem::take(&mut self.notes)
    }

    /// What came of the lines so far.
    pub fn summary(&self) -> Summary {
        let [all, of_80, of_95] = self.session.banded().map(|n| n as f64);
        Summary {
            lines: self.counts,
            coverage: Coverage { of_80: of_80 / all, of_95: of_95 / all },
            latency: self.latency.times(),
        }
    }

    /// The weights of the moment.
    pub fn weights(&self) -> &[f64] {
        self.session.adapter().weights()
    }
}

/// Adds a remark to a note.
fn say(note: &mut String, remark: std::fmt::Arguments<'_>) {
    if !note.is_empty() {
        note.push_str("; ");
    }
    // Memory takes all that is written into it.
    let _ = note.write_fmt(remark);
}
