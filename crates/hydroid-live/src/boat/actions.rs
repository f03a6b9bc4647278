//! What the operator asks for.

use serde::Deserialize;

use super::steering::Steering;
use super::{Boat, Level};
use crate::link::Link;

/// An action of the operator.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(tag = "action", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Action {
    /// Begins a recording.
    Record {},
    /// Ends it.
    StopRecording {},
    /// The model keeps its weights.
    Freeze {},
    Learn {},
    /// Identifies a model from the recordings of the session.
    Identify {},
    /// Takes the identified model on board.
    Adopt {},
    /// Goes back to the model before.
    RollBack {},
    Experiment {
        name: String,
    },
    /// Follows the path.
    Steer {},
    /// Hands off.
    Stop {},
}

impl<L: Link> Boat<L> {
    /// Names of the actions that are possible now.
    pub(super) fn possible(&self) -> Vec<&'static str> {
        let steering = !matches!(self.steering, Steering::Off);
        let learning = self.active.as_ref().map(|active| active.is_learning);
        [
            ("record", self.recording.is_none()),
            ("stop-recording", self.recording.is_some() && !steering),
            ("freeze", learning == Some(true)),
            ("learn", learning == Some(false)),
            (
                "identify",
                !steering
                    && self.identify.is_some()
                    && self.identifying.is_none()
                    && !self.recordings.is_empty(),
            ),
            ("adopt", self.offered.is_some() && !steering),
            ("roll-back", self.previous.is_some() && !steering),
            ("experiment", !steering && self.link.impossible().is_none()),
            ("steer", !steering && self.link.impossible().is_none() && self.active.is_some()),
            ("stop", true),
        ]
        .into_iter()
        .filter_map(|(name, possible)| possible.then_some(name))
        .collect()
    }

    /// Does what the operator asks for, or says why not.
    ///
    /// # Errors
    /// If it is refused, with the remedy.
    pub fn act(&mut self, action: Action, now_ns: i64) -> Result<String, String> {
        self.now_ns = self.now_ns.max(now_ns);
        let now_ns = self.now_ns;
        let done = self.try_action(action, now_ns);
        if let Err(error) = &done {
            self.say(now_ns, Level::Warning, format!("refused: {error}"));
        }
        done
    }

    fn try_action(&mut self, action: Action, now_ns: i64) -> Result<String, String> {
        match action {
            Action::Record {} => {
                self.record(now_ns);
                let recording = self.recording.as_ref().ok_or("the recording cannot be written")?;
                Ok(format!("recording {}", recording.path().display()))
            }
            Action::StopRecording {} => {
                if self.recording.is_none() {
                    return Err("nothing is recorded".to_owned());
                }
                // To close a file may take the disk a while, and the experiment is made for it.
                self.check_free()?;
                self.stop_recording(now_ns);
                Ok("the recording has ended".to_owned())
            }
            Action::Freeze {} => self.set_learning(false),
            Action::Learn {} => self.set_learning(true),
            Action::Identify {} => self.begin_identification(now_ns),
            Action::Adopt {} => self.adopt(now_ns),
            Action::RollBack {} => self.roll_back(now_ns),
            Action::Experiment { name } => self.begin_experiment(&name, now_ns),
            Action::Steer {} => self.begin_steering(now_ns),
            Action::Stop {} => {
                self.hands_off(now_ns, Level::Info, "stopped by the operator");
                Ok("hands off".to_owned())
            }
        }
    }

    fn set_learning(&mut self, learns: bool) -> Result<String, String> {
        let active = self.active.as_mut().ok_or("there is no model on board")?;
        active.learn(learns);
        Ok(if learns { "the model learns" } else { "the model keeps its weights" }.to_owned())
    }

    fn begin_identification(&mut self, now_ns: i64) -> Result<String, String> {
        if self.identifying.is_some() {
            return Err("a model is being identified: wait for it".to_owned());
        }
        let identify = self.identify.clone().ok_or("this session cannot identify models")?;
        if self.recordings.is_empty() {
            return Err("nothing was recorded: begin a recording".to_owned());
        }
        self.check_free()?;
        // A file of its own goes on, and the last one is complete.
        if self.recording.is_some() {
            self.stop_recording(now_ns);
            self.record(now_ns);
        }
        let complete = self.recordings.len() - usize::from(self.recording.is_some());
        let (files, folder) = (self.recordings[..complete].to_vec(), self.settings.folder.clone());
        let (sender, receiver) = std::sync::mpsc::channel();
        std::thread::Builder::new()
            .name("identification".to_owned())
            .spawn(move || {
                let _ = sender.send(identify(&files, &folder));
            })
            .map_err(|error| format!("there is no thread for it: {error}"))?;
        self.identifying = Some(receiver);
        self.say(now_ns, Level::Info, "a model is being identified from the recordings");
        Ok("a model is being identified".to_owned())
    }

    /// The offered model takes the place of the active one if it predicts better; both have followed the vessel.
    fn adopt(&mut self, now_ns: i64) -> Result<String, String> {
        if !matches!(self.steering, Steering::Off) {
            return Err("the helm is in use: stop it first".to_owned());
        }
        let (offered, _) = self.offered.as_ref().ok_or("no model was identified")?;
        if let Some(active) = &self.active {
            let (new, old) = (offered.score(false), active.score(true));
            if new.is_nan() {
                return Err("it has not predicted long enough to be compared: wait for its longest horizon"
                    .to_owned());
            }
            if new > old {
                return Err(format!(
                    "its error is {:.2} times that of the model on board: sail on, or identify again with more data",
                    new / old
                ));
            }
        }
        let name = offered.name.clone();
        if let Some((offered, _)) = self.offered.take() {
            self.activate(offered).map_err(|error| error.to_string())?;
        }
        self.say(now_ns, Level::Info, format!("{name} is on board, and learns"));
        Ok(format!("{name} is on board"))
    }

    fn roll_back(&mut self, now_ns: i64) -> Result<String, String> {
        if !matches!(self.steering, Steering::Off) {
            return Err("the helm is in use: stop it first".to_owned());
        }
        let previous = self.previous.take().ok_or("there was no model before")?;
        let name = previous.name.clone();
        // The model that was on board is the previous one now.
        self.activate(previous).map_err(|error| error.to_string())?;
        self.say(now_ns, Level::Info, format!("{name} is on board again"));
        Ok(format!("{name} is on board again"))
    }
}
