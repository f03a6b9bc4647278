//! Saving and resuming the state of a stream.

use std::path::{Path, PathBuf};

use hydroid_core::memory::Memory;
use serde::Serialize;
use serde_json::Value;

use super::follower::Follower;
use super::{Earlier, State, Stream, StreamError};
use hydroid::atomic;
use hydroid::log::Note;

/// Longest stream time that a kill loses \[s\].
pub(super) const SAVE_INTERVAL_S: f64 = 1.0;

pub(super) struct StateFile {
    path: PathBuf,
    model: String,
    settings: Value,
    /// Time of the last sample in the file; NaN before the first.
    saved: f64,
    /// Time of the last sample at which it was to be written.
    tried: f64,
    failed: bool,
}

impl Stream {
    /// Saves the state in a file at least once per stream second, and resumes from an existing file, after which lines
    /// that were answered before are not used again. `model` is the [`fingerprint`](super::fingerprint) of the model's file, `settings`
    /// are those of the adapter. Returns the time of the resumed state.
    ///
    /// # Errors
    /// If the file exists and is not a state of this model with these settings, or its folder cannot be written.
    pub fn persist_in(
        &mut self,
        path: &Path,
        model: String,
        settings: &impl Serialize,
    ) -> Result<Option<f64>, StreamError> {
        let wrong = |reason: String| StreamError::State { path: path.to_owned(), reason };
        let settings = serde_json::json!({ "learning": settings, "reading": self.options.reading });
        let state = State::read(path)?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        atomic::probe(folder.unwrap_or(Path::new(".")))?;
        if let Some(state) = &state {
            state.fits(&model, &settings).map_err(wrong)?;
            let Follower { commands, session, clock, .. } = &mut self.follower;
            if state.commands.len() != Memory::len_of(|memory| commands.visit_state(memory))
                || state.memory.len() != Memory::len_of(|memory| session.visit_state(memory))
            {
                return Err(wrong("it has another size; remove it to start again".to_owned()));
            }
            if !clock.restore(state.clock) {
                return Err(wrong("its clock is not that of a stream; remove it to start again".to_owned()));
            }
            commands.visit_state(&mut Memory::Loading(&state.commands));
            session.visit_state(&mut Memory::Loading(&state.memory));
            if state.commands.iter().any(|x| x.is_infinite()) || !session.is_sound() {
                let reason = "it holds numbers that no service has: weights or states that are not finite, or variances below zero; remove it to start again";
                return Err(wrong(reason.to_owned()));
            }
            self.earlier =
                Some(Earlier { first: state.first.clone(), rows: state.rows, is_sent_again: false });
        }
        let resumed = state.is_some().then(|| self.follower.clock.taken());
        let (path, saved) = (path.to_owned(), self.follower.clock.taken());
        self.state_file = Some(StateFile { path, model, settings, saved, tried: saved, failed: false });
        Ok(resumed)
    }

    /// Saves the state if the next sample might come after the interval. A disk that is full must not stop the answers: the
    /// failure is a note, and the next attempt is after the interval.
    pub(super) fn save_if_due(&mut self) {
        let (t, dt) = (self.follower.clock.taken(), self.follower.model.description.dt);
        let Some(state_file) = &mut self.state_file else { return };
        // A sample may be half a step off its grid point, and a clock may have been set back.
        let is_due = (t - state_file.tried).abs() + 1.5 * dt > SAVE_INTERVAL_S && t != state_file.tried;
        let is_first = state_file.tried.is_nan() && !t.is_nan();
        if !(is_due || is_first) {
            return;
        }
        state_file.tried = t;
        let failed = std::mem::replace(&mut state_file.failed, true);
        match self.save_state() {
            Err(error) if !failed => self.notes.push(Note::warning(error.to_string())),
            _ => {}
        }
    }

    fn save_state(&mut self) -> Result<(), StreamError> {
        let Some(state_file) = &mut self.state_file else { return Ok(()) };
        let Follower { commands, session, clock, .. } = &mut self.follower;
        let state = State {
            model: state_file.model.clone(),
            settings: state_file.settings.clone(),
            first: self.first.clone(),
            rows: self.row,
            clock: clock.memory(),
            commands: Memory::saved(|memory| commands.visit_state(memory)),
            memory: Memory::saved(|memory| session.visit_state(memory)),
        };
        state.write(&state_file.path)?;
        (state_file.saved, state_file.failed) = (self.follower.clock.taken(), false);
        Ok(())
    }

    /// Saves the state and the rest of the recording, at the end or after an interruption.
    pub fn finish(&mut self) -> Result<(), StreamError> {
        // The state is saved even if the recording fails.
        if let Err(error) = self.follower.session.finish() {
            self.notes.push(Note::warning(error.to_string()));
        }
        let behind = |state_file: &StateFile| self.follower.clock.taken() != state_file.saved;
        if !self.follower.clock.is_new() && self.state_file.as_ref().is_some_and(behind) {
            self.save_state()
        } else {
            Ok(())
        }
    }
}
