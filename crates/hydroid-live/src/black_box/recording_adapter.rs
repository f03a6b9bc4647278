//! Wrapper that records the calls of an adapter.

use hydroid_core::adapt::{Adapter, Learning, Rehearsing, SaveState};
use hydroid_core::memory::Memory;
use hydroid_core::predict::{Predictor, Workspace, delegate, plain};

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
        recorder.settle(self.adapter.as_mut(), held);
        recorder.write_if_due(self.adapter.as_mut());
        recorder.take_write_error()
    }

    /// Writes the rest of the recording.
    pub fn finish(&mut self) -> Result<(), BlackBoxError> {
        match &mut self.recorder {
            Some(recorder) => recorder.finish(self.adapter.as_mut()),
            None => Ok(()),
        }
    }

    fn changed(&mut self) {
        if let Some(recorder) = &mut self.recorder {
            recorder.changed(self.adapter.as_mut());
        }
    }
}

impl Predictor for RecordingAdapter<'_> {
    plain!(advance_observe);
    delegate!(adapter: outputs inputs warm_up current output output_through_water rollout rollout_batch);
    delegate!(adapter: snapshot_len snapshot fork);

    fn reset(&mut self) {
        if let Some(recorder) = &mut self.recorder {
            recorder.reset(self.adapter.as_mut());
        }
        self.adapter.reset();
    }

    fn observe_heading(&mut self, heading: f64) {
        self.heading = heading;
    }

    fn observe(&mut self, y: &[f64]) {
        let heading = std::mem::replace(&mut self.heading, f64::NAN);
        if let Some(recorder) = &mut self.recorder {
            recorder.observe(self.adapter.as_mut(), heading, y);
        }
        self.adapter.observe_heading(heading);
        self.adapter.observe(y);
        if let Some(recorder) = &mut self.recorder {
            recorder.observed(self.adapter.as_ref());
        }
    }

    fn advance(&mut self, c: &[f64]) {
        if let Some(recorder) = &mut self.recorder {
            recorder.advance(self.adapter.as_mut(), c);
        }
        self.adapter.advance(c);
    }

    fn restore(&mut self, from: &[f64]) {
        self.changed();
        self.adapter.restore(from);
    }

    fn rollout_snapshots(
        &mut self,
        count: usize,
        snapshots: &[f64],
        commands: &[f64],
        work: &mut Workspace,
        y: &mut [f64],
    ) {
        self.changed();
        self.adapter.rollout_snapshots(count, snapshots, commands, work, y);
    }
}

impl Learning for RecordingAdapter<'_> {
    delegate!(adapter: outcome innovations weights health guard deviations);

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
}

impl SaveState for RecordingAdapter<'_> {
    delegate!(adapter: is_sound);

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        if memory.is_loading() {
            self.changed();
        }
        self.adapter.visit_state(memory);
    }
}

impl Rehearsing for RecordingAdapter<'_> {
    delegate!(adapter: rehearsal);

    fn store_window(&mut self, outputs: &[f64], commands: &[f64]) {
        self.changed();
        self.adapter.store_window(outputs, commands);
    }
}
