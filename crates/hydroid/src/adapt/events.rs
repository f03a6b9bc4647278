//! Texts of the guard's events.

use std::fmt::{self, Write as _};

use hydroid_core::adapt::guard::{Action, Cause, Event};
use serde::Serialize;

use crate::log::Trajectory;
use crate::model::Model;

/// A logged event of the guard.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoggedEvent {
    /// Name of the run.
    pub run: String,
    /// Time in the run \[s\].
    pub t: f64,
    /// Name of the action: `spike`, `switched` ..
    pub action: &'static str,
    /// Action, cause and values.
    pub text: String,
}

/// The description of an event.
pub struct EventText<'a> {
    /// The action of the guard.
    pub action: &'a Action,
    /// Names of the outputs, then of the inputs.
    pub names: &'a [String],
}

impl fmt::Display for EventText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |channel: usize| self.names.get(channel).map_or("?", String::as_str);
        match *self.action {
            Action::Spike { output, deviations } => {
                write!(
                    f,
                    "{} deviates by {deviations:.1} times its usual deviation: rejected until it agrees with the model",
                    name(output)
                )
            }
            Action::Stuck { output, repeats } => {
                write!(f, "{} has repeated its value {repeats} times: not used from now on", name(output))
            }
            Action::Trusted { output, cause } => {
                let cause = match cause {
                    Cause::Evidence => "the model that learns from it without the guard predicts it",
                    Cause::Budget => "the guard has no time left to predict without it",
                };
                write!(f, "{} is trusted from now on: {cause}", name(output))
            }
            Action::Back { output, missing } => {
                write!(
                    f,
                    "{} agrees with the model again and is used, after {missing} samples without it",
                    name(output)
                )
            }
            Action::Switched { to, errors: [adapted, reference, unguarded] } => write!(
                f,
                "the {} model predicts from now on (error of the adapted model {adapted:.4}, of the reference model {reference:.4}, of the unguarded model {unguarded:.4})",
                to.name()
            ),
            Action::RolledBack { errors: [adapted, reference, _] } => write!(
                f,
                "the adapted model starts again from the reference model (error {adapted:.4}, of the reference model {reference:.4})"
            ),
            Action::Restarted => {
                write!(
                    f,
                    "the memory of the adapted model was not sound (not finite, or a negative variance) and was reset"
                )
            }
        }
    }
}

/// Names of a model's outputs, then inputs.
pub fn names(model: &Model) -> Vec<String> {
    let ports = model.description.outputs.iter().chain(&model.description.inputs);
    ports.map(|port| port.channel.name.clone()).collect()
}

pub(super) fn logged(events: &[Event], runs: &[&Trajectory], names: &[String]) -> Vec<LoggedEvent> {
    let place = |sample: u64| {
        let mut before = 0;
        for run in runs {
            let k = usize::try_from(sample).unwrap_or(usize::MAX) - before;
            if k < run.len() {
                return (run.name.clone(), run.t0 + k as f64 * run.dt);
            }
            before += run.len();
        }
        (String::new(), f64::NAN)
    };
    let word = |event: &Event| {
        let (run, t) = place(event.sample);
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = write!(text, "{}", EventText { action: &event.action, names });
        LoggedEvent { run, t, action: event.action.name(), text }
    };
    events.iter().map(word).collect()
}
