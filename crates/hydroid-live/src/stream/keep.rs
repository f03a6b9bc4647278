//! Keeping the state of a stream, and going on from it.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;

use super::{State, Stream, StreamError};
use hydroid::log::Note;

/// Log time \[s\] that a kill may cost at the most.
const KEPT_EVERY_S: f64 = 1.0;

/// Where the state is kept, and of what.
pub(super) struct Keeper {
    path: PathBuf,
    model: String,
    settings: Value,
    /// Time of the last sample in the file; NaN before the first.
    kept: f64,
    failed: bool,
}

impl Stream {
    /// Keeps the state in a file from now on, once in a second of the stream at the least, and goes on from it if
    /// it is there: lines up to its time are then skipped. `model` is the [`fingerprint`](super::fingerprint) of the model's file,
    /// `settings` are those of the adapter. Gives the time that it goes on from.
    ///
    /// # Errors
    /// If the file is there and is not a state of this model with these settings.
    pub fn keep_in(
        &mut self,
        path: &Path,
        model: String,
        settings: &impl Serialize,
    ) -> Result<Option<f64>, StreamError> {
        let wrong = |reason: String| StreamError::State { path: path.to_owned(), reason };
        let settings = serde_json::json!({ "learning": settings, "reading": self.options.reading });
        let state = State::read(path)?;
        if let Some(state) = &state {
            state.fits(&model, &settings).map_err(wrong)?;
            let lens = (state.commands.len(), state.memory.len());
            if lens != (self.commands.memory_len(), self.session.adapter().memory_len()) {
                return Err(wrong("it has another size; remove it to start anew".to_owned()));
            }
            self.clock.recall(state.clock);
            self.commands.recall(&state.commands);
            self.session.adapter_mut().load(&state.memory);
            self.answered = Some(self.clock.taken());
        }
        let (path, kept) = (path.to_owned(), self.clock.taken());
        self.keeper = Some(Keeper { path, model, settings, kept, failed: false });
        Ok(self.answered)
    }

    /// Writes the state where the next sample might come too late for it.
    pub(super) fn keep_if_due(&mut self) -> Result<(), StreamError> {
        let (t, dt) = (self.clock.taken(), self.model.description.dt);
        match &mut self.keeper {
            // Half a step more: a sample may be so far from its place.
            Some(keeper) if keeper.kept.is_nan() && !t.is_nan() => self.keep(),
            Some(keeper) if t - keeper.kept + 1.5 * dt > KEPT_EVERY_S && t > keeper.kept => {
                let failed = keeper.failed;
                // A full disk must not stop a vessel from being predicted; a place that never could be written is
                // told at the first sample.
                let result = self.keep();
                if let (Err(error), Some(keeper)) = (&result, &mut self.keeper) {
                    keeper.failed = true;
                    if !failed {
                        self.notes.push(Note::warning(error.to_string()));
                    }
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn keep(&mut self) -> Result<(), StreamError> {
        let Some(keeper) = &mut self.keeper else { return Ok(()) };
        let adapter = self.session.adapter();
        let mut memory = vec![0.0; adapter.memory_len()];
        adapter.save(&mut memory);
        let state = State {
            model: keeper.model.clone(),
            settings: keeper.settings.clone(),
            clock: self.clock.memory(),
            commands: self.commands.memory(),
            memory,
        };
        state.write(&keeper.path)?;
        (keeper.kept, keeper.failed) = (self.clock.taken(), false);
        Ok(())
    }

    /// Keeps the state at the end, or where the work is interrupted, and writes what the black box has noted.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(&mut self) -> Result<(), StreamError> {
        // What could not be noted does not keep the rest from being written.
        if let Err(error) = self.session.finish() {
            self.notes.push(Note::warning(error.to_string()));
        }
        let behind = |keeper: &Keeper| self.clock.taken() > keeper.kept || keeper.kept.is_nan();
        if !self.clock.is_new() && self.keeper.as_ref().is_some_and(behind) { self.keep() } else { Ok(()) }
    }
}
