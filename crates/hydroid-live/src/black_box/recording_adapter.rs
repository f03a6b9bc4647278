//! Wrapper that records the calls of an adapter.

use hydroid_core::adapt::guard::Guard;
use hydroid_core::adapt::{Adapter, Health, Innovation, Learning, Outcome, Rehearsing, SaveState};
use hydroid_core::predict::{Current, Predictor, Workspace};

use super::{BlackBoxError, Recorder};
use hydroid::log::Note;

/// An adapter with an optional recorder of its calls.
pub struct RecordingAdapter<'a> {
    adapter: Box<dyn Adapter + 'a>,
    recorder: Option<Recorder>,
    /// Heading of the sample that is observed next.
    heading: f64,
}

impl<'a> RecordingAdapter<'a> {
    /// Wraps an adapter.
    pub fn new(adapter: Box<dyn Adapter + 'a>, recorder: Option<Recorder>) -> Self {
        Self { adapter, recorder, heading: f64::NAN }
    }

    pub(crate) fn record(&mut self, recorder: Recorder) {
        self.recorder = Some(recorder);
    }

    /// Sets the time of the sample that is observed `steps` steps later.
    pub(crate) fn to(&mut self, t: f64, steps: usize, dt: f64) {
        if let Some(recorder) = &mut self.recorder {
            recorder.at(t - steps as f64 * dt);
        }
    }

    /// Completes the step with the next command, and writes if due. Called when no answer is pending.
    pub(crate) fn settle(&mut self, held: &[f64]) -> Option<Note> {
        let recorder = self.recorder.as_mut()?;
        recorder.settle(self.adapter.as_ref(), held);
        recorder.write_if_due(self.adapter.as_ref());
        recorder.take_write_error()
    }

    /// Writes the rest of the recording.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(&mut self) -> Result<(), BlackBoxError> {
        match &mut self.recorder {
            Some(recorder) => recorder.finish(self.adapter.as_ref()),
            None => Ok(()),
        }
    }

    fn changed(&mut self) {
        if let Some(recorder) = &mut self.recorder {
            recorder.changed(self.adapter.as_ref());
        }
    }
}

impl Predictor for RecordingAdapter<'_> {
    fn outputs(&self) -> usize {
        self.adapter.outputs()
    }

    fn inputs(&self) -> usize {
        self.adapter.inputs()
    }

    fn warm_up(&self) -> usize {
        self.adapter.warm_up()
    }

    fn reset(&mut self) {
        if let Some(recorder) = &mut self.recorder {
            recorder.reset(self.adapter.as_ref());
        }
        self.adapter.reset();
    }

    fn observe_heading(&mut self, heading: f64) {
        self.heading = heading;
    }

    fn current(&self) -> Option<&Current> {
        self.adapter.current()
    }

    fn output_through_water(&self, y: &mut [f64]) {
        self.adapter.output_through_water(y);
    }

    fn observe(&mut self, y: &[f64]) {
        let heading = std::mem::replace(&mut self.heading, f64::NAN);
        if let Some(recorder) = &mut self.recorder {
            recorder.observe(self.adapter.as_ref(), heading, y);
        }
        self.adapter.observe_heading(heading);
        self.adapter.observe(y);
        if let Some(recorder) = &mut self.recorder {
            recorder.observed(self.adapter.as_ref());
        }
    }

    fn advance(&mut self, c: &[f64]) {
        if let Some(recorder) = &mut self.recorder {
            recorder.advance(self.adapter.as_ref(), c);
        }
        self.adapter.advance(c);
    }

    fn output(&self, y: &mut [f64]) {
        self.adapter.output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.adapter.rollout(commands, work, y);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.adapter.rollout_batch(count, commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        self.adapter.snapshot_len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        self.adapter.snapshot(into);
    }

    fn restore(&mut self, from: &[f64]) {
        self.changed();
        self.adapter.restore(from);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        self.adapter.fork()
    }
}

impl Learning for RecordingAdapter<'_> {
    fn outcome(&self) -> Outcome {
        self.adapter.outcome()
    }

    fn innovations(&self) -> &[Innovation] {
        self.adapter.innovations()
    }

    fn weights(&self) -> &[f64] {
        self.adapter.weights()
    }

    fn freeze(&mut self, frozen: bool) {
        self.changed();
        self.adapter.freeze(frozen);
    }

    fn scale_noise(&mut self, factor: f64) {
        self.changed();
        self.adapter.scale_noise(factor);
    }

    fn restart(&mut self) {
        self.changed();
        self.adapter.restart();
    }

    fn health(&self) -> Health {
        self.adapter.health()
    }

    fn guard(&self) -> Option<&Guard> {
        self.adapter.guard()
    }

    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    ) {
        self.adapter.deviations(commands, horizons, work, deviations);
    }
}

impl SaveState for RecordingAdapter<'_> {
    fn memory_len(&self) -> usize {
        self.adapter.memory_len()
    }

    fn save(&self, into: &mut [f64]) {
        self.adapter.save(into);
    }

    fn is_sound(&self) -> bool {
        self.adapter.is_sound()
    }

    fn load(&mut self, from: &[f64]) {
        self.changed();
        self.adapter.load(from);
    }
}

impl Rehearsing for RecordingAdapter<'_> {}
