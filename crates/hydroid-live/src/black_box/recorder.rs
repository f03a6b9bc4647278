//! Recorder of the calls of an adapter; it writes once per recorded second.

use hydroid_core::adapt::Adapter;
use serde::Serialize;

use super::head::Head;
use super::record::{ADVANCE, OBSERVE, PREDICTED, Part, RESET, RowBuilder};
use super::ring::{Ring, step_sum};
use super::{BlackBoxError, MAX_MINUTES, MIN_MINUTES, RecordingOptions};
use hydroid::adapt::Options;
use hydroid::atomic::WriteError;
use hydroid::log::{Note, Trajectory};
use hydroid::model::Model;

/// Source of the samples.
#[derive(Clone, Copy, Debug)]
pub enum Source<'a> {
    /// A live stream of this name. An earlier recording of the stream is continued, and writes are synchronized with the disk.
    Stream(&'a str),
    /// Runs one after the other; each begins with a reset.
    Runs(&'a [&'a Trajectory]),
}

/// Records the calls of an adapter and their results. It does not allocate after the first step.
#[derive(Debug)]
pub struct Recorder {
    ring: Ring,
    builder: RowBuilder,
    /// Start time of each run \[s\]; empty for a stream.
    starts: Vec<f64>,
    run: Option<usize>,
    /// Time of a sample, and number of samples since.
    t: f64,
    since: f64,
    dt: f64,
    row: Vec<f64>,
    calls: u8,
    /// State of the adapter at the start of the segment.
    memory: Vec<f64>,
    segment: Phase,
    continues: bool,
    /// Completed steps, steps before the segment, and capacity of a segment.
    steps: u64,
    before: u64,
    max_steps: u64,
    pending: Vec<u8>,
    waiting: usize,
    /// Steps in a write interval, and capacity of the buffer.
    every: usize,
    buffer_steps: usize,
    write_error: Option<WriteError>,
    reported: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The next call begins a segment.
    None,
    /// The state of the adapter has been copied.
    Taken,
    /// The start of the segment is in the file.
    Begun,
}

impl Recorder {
    /// Recorder of an adapter that [`adapter`](hydroid::adapt::adapter) created from a model, options and the runs of the source
    /// (none for a stream); `described` are the settings for the header.
    pub fn new(
        settings: &RecordingOptions,
        model: &Model,
        adapter: &mut dyn Adapter,
        options: &Options,
        described: &impl Serialize,
        source: Source<'_>,
    ) -> Result<Self, BlackBoxError> {
        let minutes = settings.minutes;
        if !(MIN_MINUTES..=MAX_MINUTES).contains(&minutes) {
            return Err(BlackBoxError::Minutes { minutes });
        }
        let runs = match source {
            Source::Stream(_) => &[],
            Source::Runs(runs) => runs,
        };
        let file = settings.model.clone();
        let mut head = Head::of(model, file, adapter, (options, runs), described, minutes)
            .map_err(|reason| BlackBoxError::unusable(&settings.path, reason))?;
        let ring = match source {
            Source::Stream(name) => {
                head.runs = vec![name.to_owned()];
                Ring::resume(&settings.path, &head, true)?
            }
            Source::Runs(runs) => {
                head.runs = runs.iter().map(|run| run.name.clone()).collect();
                Ring::create(&settings.path, &head, false)?
            }
        };
        let builder = RowBuilder::new(&head);
        let len = builder.layout.len();
        let buffer_steps = head.buffer_steps();
        Ok(Self {
            ring,
            builder,
            starts: runs.iter().map(|run| run.t0).collect(),
            run: None,
            t: f64::NAN,
            since: 0.0,
            dt: head.dt,
            row: vec![f64::NAN; len],
            calls: 0,
            memory: vec![0.0; head.memory],
            segment: Phase::None,
            continues: false,
            steps: 0,
            before: 0,
            max_steps: head.steps as u64,
            pending: Vec::with_capacity(buffer_steps * 8 * (len + 1)),
            waiting: 0,
            every: head.every(),
            buffer_steps,
            write_error: None,
            reported: false,
        })
    }

    /// Sets the time of the next sample; later samples follow at the sample time.
    pub(super) fn at(&mut self, t: f64) {
        (self.t, self.since) = (t, 0.0);
    }

    /// Begins a segment after an external change of the state.
    pub(super) fn changed(&mut self, adapter: &mut dyn Adapter) {
        self.close(adapter);
        self.end_segment(adapter, false);
    }

    pub(super) fn reset(&mut self, adapter: &mut dyn Adapter) {
        self.begin_call(adapter, RESET);
        let run = self.run.map_or(0, |run| run + 1);
        self.run = Some(run);
        if let Some(&t) = self.starts.get(run) {
            self.at(t);
        }
    }

    pub(super) fn advance(&mut self, adapter: &mut dyn Adapter, c: &[f64]) {
        self.settle(adapter, c);
        self.begin_call(adapter, ADVANCE);
        self.row[self.builder.layout.range(Part::Command)].copy_from_slice(c);
    }

    pub(super) fn observe(&mut self, adapter: &mut dyn Adapter, heading: f64, y: &[f64]) {
        self.begin_call(adapter, OBSERVE);
        self.row[self.builder.layout.range(Part::Heading)][0] = heading;
        self.row[self.builder.layout.range(Part::Measured)].copy_from_slice(y);
    }

    pub(super) fn observed(&mut self, adapter: &dyn Adapter) {
        self.row[self.builder.layout.range(Part::Time)][0] = self.t + self.since * self.dt;
        self.since += 1.0;
        self.builder.observed(adapter, &mut self.row);
    }

    /// Completes the last step with predictions under the next command.
    pub(super) fn settle(&mut self, adapter: &mut dyn Adapter, held: &[f64]) {
        if self.calls & OBSERVE != 0 {
            self.builder.predicted(adapter, held, &mut self.row);
            self.calls |= PREDICTED;
            self.close(adapter);
        }
    }

    pub(super) fn write_if_due(&mut self, adapter: &mut dyn Adapter) {
        // A file that cannot be written is reported at once.
        if self.waiting >= self.every || self.segment == Phase::Taken {
            self.write(adapter);
        }
        if self.segment == Phase::None && self.steps > 0 {
            self.take_memory(adapter);
            self.write(adapter);
        }
    }

    /// Writes the buffer.
    ///
    /// # Errors
    /// If a write failed without being reported.
    pub(super) fn finish(&mut self, adapter: &mut dyn Adapter) -> Result<(), BlackBoxError> {
        self.close(adapter);
        self.write(adapter);
        self.write_error.take().filter(|_| !self.reported).map_or(Ok(()), |error| Err(error.into()))
    }

    /// Note on the first failed write, once.
    pub(super) fn take_write_error(&mut self) -> Option<Note> {
        let error = self.write_error.take()?;
        let reported = std::mem::replace(&mut self.reported, true);
        (!reported).then(|| Note::warning(format!("the black box cannot be written: {error}")))
    }

    /// Begins another step if the call cannot follow those of the current one.
    fn begin_call(&mut self, adapter: &mut dyn Adapter, call: u8) {
        if self.calls >= call {
            self.close(adapter);
            // A log has no pauses in which to write.
            if !self.starts.is_empty() && self.waiting >= self.every {
                self.write(adapter);
            }
        }
        if self.segment == Phase::None {
            self.take_memory(adapter);
        }
        self.calls |= call;
    }

    fn take_memory(&mut self, adapter: &mut dyn Adapter) {
        adapter.save(&mut self.memory);
        (self.segment, self.before) = (Phase::Taken, self.steps);
    }

    fn close(&mut self, adapter: &mut dyn Adapter) {
        if self.calls == 0 {
            return;
        }
        let layout = self.builder.layout;
        self.row[layout.range(Part::Calls)][0] = f64::from(self.calls);
        self.row[layout.range(Part::Run)][0] =
            if self.starts.is_empty() { 0.0 } else { self.run.unwrap_or(0) as f64 };
        let sequence = if self.segment == Phase::Begun {
            self.ring.sequence()
        } else {
            self.ring.next_sequence(self.continues)
        };
        let sum = step_sum(sequence, self.steps - self.before, &self.row);
        for x in &self.row {
            self.pending.extend_from_slice(&x.to_le_bytes());
        }
        self.pending.extend_from_slice(&sum.to_le_bytes());
        self.row.fill(f64::NAN);
        (self.calls, self.steps, self.waiting) = (0, self.steps + 1, self.waiting + 1);
        if self.steps - self.before == self.max_steps {
            self.end_segment(adapter, true);
        } else if self.waiting == self.buffer_steps {
            self.write(adapter);
        }
    }

    fn end_segment(&mut self, adapter: &mut dyn Adapter, continues: bool) {
        self.write(adapter);
        // After a failed write the next segment has begun already.
        if self.segment == Phase::Begun || !continues {
            (self.segment, self.continues) = (Phase::None, continues);
        }
    }

    fn write(&mut self, adapter: &mut dyn Adapter) {
        let mut result = Ok(());
        if self.segment == Phase::Taken {
            let sequence = self.ring.next_sequence(self.continues);
            result = self.ring.begin(sequence, self.before, self.continues, &self.memory);
            if result.is_ok() {
                self.segment = Phase::Begun;
            }
        }
        if result.is_ok() && self.waiting > 0 {
            result = self.ring.add(&self.pending);
        }
        self.pending.clear();
        self.waiting = 0;
        if let Err(error) = result {
            // The lost steps form a gap: the next segment begins after it.
            self.write_error = Some(error);
            self.continues = false;
            self.take_memory(adapter);
        }
    }
}
