//! What notes the calls of a walk, and writes them once in a second of it.

use hydroid_core::adapt::Adapter;
use serde::Serialize;

use super::head::Head;
use super::record::{ADVANCE, FORESEEN, Gatherer, OBSERVE, Part, RESET};
use super::ring::{Ring, step_sum};
use super::{BlackBoxError, FEWEST_MINUTES, MOST_MINUTES, Settings};
use hydroid::adapt::Options;
use hydroid::atomic::WriteError;
use hydroid::log::{Note, Trajectory};
use hydroid::model::Model;

/// What is walked along.
#[derive(Clone, Copy, Debug)]
pub enum Source<'a> {
    /// A live stream of this name. An earlier box of the same stream is gone on with, and what is written is on the disk.
    Stream(&'a str),
    /// Runs, one after the other, each begun by a reset.
    Runs(&'a [&'a Trajectory]),
}

/// Notes the calls that an adapter gets, and what came of them. After the first step nothing in it allocates.
#[derive(Debug)]
pub struct Recorder {
    ring: Ring,
    gatherer: Gatherer,
    /// Where each run begins \[s\]; none for a stream.
    starts: Vec<f64>,
    run: Option<usize>,
    /// Time of a sample, and samples observed since.
    t: f64,
    since: f64,
    dt: f64,
    /// The step that is being made.
    row: Vec<f64>,
    calls: u8,
    /// The memory that the segment begins from.
    memory: Vec<f64>,
    segment: Phase,
    goes_on: bool,
    /// Steps closed so far, those before the segment, and those that a segment holds.
    steps: u64,
    before: u64,
    most: u64,
    pending: Vec<u8>,
    waiting: usize,
    /// Steps of a second, and those that wait at the most.
    every: usize,
    room: usize,
    trouble: Option<WriteError>,
    told: bool,
}

/// What there is of a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// It begins with the next call.
    None,
    /// Its memory was taken.
    Taken,
    /// It is in the file.
    Begun,
}

impl Recorder {
    /// A box of an adapter that [`adapter`](hydroid::adapt::adapter) has made of a model, options and the runs of the source
    /// (none for a stream); `described` is what is to be said of its settings.
    ///
    /// # Errors
    /// If it cannot be written there, or a file is there that cannot be gone on with.
    pub fn new(
        settings: &Settings,
        model: &Model,
        adapter: &dyn Adapter,
        options: &Options,
        described: &impl Serialize,
        source: Source<'_>,
    ) -> Result<Self, BlackBoxError> {
        let minutes = settings.minutes;
        if !(FEWEST_MINUTES..=MOST_MINUTES).contains(&minutes) {
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
                Ring::go_on(&settings.path, &head, true)?
            }
            Source::Runs(runs) => {
                head.runs = runs.iter().map(|run| run.name.clone()).collect();
                Ring::create(&settings.path, &head, false)?
            }
        };
        let gatherer = Gatherer::new(&head);
        let len = gatherer.places.len();
        let room = head.room();
        Ok(Self {
            ring,
            gatherer,
            starts: runs.iter().map(|run| run.t0).collect(),
            run: None,
            t: f64::NAN,
            since: 0.0,
            dt: head.dt,
            row: vec![f64::NAN; len],
            calls: 0,
            memory: vec![0.0; head.memory],
            segment: Phase::None,
            goes_on: false,
            steps: 0,
            before: 0,
            most: head.steps as u64,
            pending: Vec::with_capacity(room * 8 * (len + 1)),
            waiting: 0,
            every: head.every(),
            room,
            trouble: None,
            told: false,
        })
    }

    /// The next sample is observed at this time, those behind it one step after the other.
    pub(super) fn at(&mut self, t: f64) {
        (self.t, self.since) = (t, 0.0);
    }

    /// The adapter became another one than its walk would have made it: a segment begins.
    pub(super) fn changed(&mut self, adapter: &dyn Adapter) {
        self.close(adapter);
        self.end_segment(adapter, false);
    }

    /// Before the adapter is reset.
    pub(super) fn reset(&mut self, adapter: &dyn Adapter) {
        self.begin_call(adapter, RESET);
        // The first reset begins the first run.
        let run = self.run.map_or(0, |run| run + 1);
        self.run = Some(run);
        if let Some(&t) = self.starts.get(run) {
            self.at(t);
        }
    }

    /// Before the adapter advances.
    pub(super) fn advance(&mut self, adapter: &dyn Adapter, c: &[f64]) {
        self.settle(adapter, c);
        self.begin_call(adapter, ADVANCE);
        self.row[self.gatherer.places.range(Part::Command)].copy_from_slice(c);
    }

    /// Before the adapter observes.
    pub(super) fn observe(&mut self, adapter: &dyn Adapter, y: &[f64]) {
        self.begin_call(adapter, OBSERVE);
        self.row[self.gatherer.places.range(Part::Measured)].copy_from_slice(y);
    }

    /// After it did.
    pub(super) fn observed(&mut self, adapter: &dyn Adapter) {
        self.row[self.gatherer.places.range(Part::Time)][0] = self.t + self.since * self.dt;
        self.since += 1.0;
        self.gatherer.observed(adapter, &mut self.row);
    }

    /// The sample that was observed last is done with, and this is the command that acts from here on: predictions are made
    /// under it.
    pub(super) fn settle(&mut self, adapter: &dyn Adapter, held: &[f64]) {
        if self.calls & OBSERVE != 0 {
            self.gatherer.foreseen(adapter, held, &mut self.row);
            self.calls |= FORESEEN;
            self.close(adapter);
        }
    }

    /// Writes what waits, where it is time: between an answer and the next call.
    pub(super) fn write_if_due(&mut self, adapter: &dyn Adapter) {
        // A place that cannot be written is told at once.
        if self.waiting >= self.every || self.segment == Phase::Taken {
            self.write(adapter);
        }
        if self.segment == Phase::None && self.steps > 0 {
            self.take_memory(adapter);
            self.write(adapter);
        }
    }

    /// Writes all that there is.
    ///
    /// # Errors
    /// If it, or something before, could not be written and nobody was told.
    pub(super) fn finish(&mut self, adapter: &dyn Adapter) -> Result<(), BlackBoxError> {
        self.close(adapter);
        self.write(adapter);
        self.trouble.take().filter(|_| !self.told).map_or(Ok(()), |error| Err(error.into()))
    }

    /// What could not be written, once.
    pub(super) fn take_trouble(&mut self) -> Option<Note> {
        let error = self.trouble.take()?;
        let told = std::mem::replace(&mut self.told, true);
        (!told).then(|| Note::warning(format!("of the black box: {error}")))
    }

    /// A call that cannot be in the same step as those before begins another.
    fn begin_call(&mut self, adapter: &dyn Adapter, call: u8) {
        if self.calls >= call {
            self.close(adapter);
            // Of a log nobody tells when there is time to write.
            if !self.starts.is_empty() && self.waiting >= self.every {
                self.write(adapter);
            }
        }
        if self.segment == Phase::None {
            self.take_memory(adapter);
        }
        self.calls |= call;
    }

    fn take_memory(&mut self, adapter: &dyn Adapter) {
        adapter.save(&mut self.memory);
        (self.segment, self.before) = (Phase::Taken, self.steps);
    }

    /// Puts the step that is being made to those that wait.
    fn close(&mut self, adapter: &dyn Adapter) {
        if self.calls == 0 {
            return;
        }
        let places = self.gatherer.places;
        self.row[places.range(Part::Calls)][0] = f64::from(self.calls);
        self.row[places.range(Part::Run)][0] =
            if self.starts.is_empty() { 0.0 } else { self.run.unwrap_or(0) as f64 };
        let sequence =
            if self.segment == Phase::Begun { self.ring.sequence() } else { self.ring.sequence() + 1 };
        let sum = step_sum(sequence, self.steps - self.before, &self.row);
        for x in &self.row {
            self.pending.extend_from_slice(&x.to_le_bytes());
        }
        self.pending.extend_from_slice(&sum.to_le_bytes());
        self.row.fill(f64::NAN);
        (self.calls, self.steps, self.waiting) = (0, self.steps + 1, self.waiting + 1);
        if self.steps - self.before == self.most {
            self.end_segment(adapter, true);
        } else if self.waiting == self.room {
            self.write(adapter);
        }
    }

    fn end_segment(&mut self, adapter: &dyn Adapter, goes_on: bool) {
        self.write(adapter);
        // After trouble the next one has begun already, from here.
        if self.segment == Phase::Begun || !goes_on {
            (self.segment, self.goes_on) = (Phase::None, goes_on);
        }
    }

    fn write(&mut self, adapter: &dyn Adapter) {
        let mut result = Ok(());
        if self.segment == Phase::Taken {
            result = self.ring.begin(self.ring.sequence() + 1, self.before, self.goes_on, &self.memory);
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
            // What is lost leaves a hole: the next segment begins behind it, in its place or the next.
            self.trouble = Some(error);
            self.goes_on = false;
            self.take_memory(adapter);
        }
    }
}
