//! What a guard did, in words.

use std::fmt::{self, Write as _};

use hydroid_core::adapt::guard::{Action, Cause, Event};
use serde::Serialize;

use crate::log::Trajectory;
use crate::model::Model;

/// Something that the guard did at a sample.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Happened {
    /// The run.
    pub run: String,
    /// Its time \[s\].
    pub t: f64,
    /// One word: `spike`, `switched` ..
    pub action: &'static str,
    /// What, why, and the numbers.
    pub text: String,
}

/// The description of an event.
pub struct Worded<'a> {
    /// The action of the guard.
    pub action: &'a Action,
    /// Names of the outputs, then of the inputs.
    pub names: &'a [String],
}

impl fmt::Display for Worded<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |channel: usize| self.names.get(channel).map_or("?", String::as_str);
        match *self.action {
            Action::Spike { output, deviations } => {
                write!(f, "{} is {deviations:.1} usual deviations off: not used", name(output))
            }
            Action::Inflated { output, deviations, factor } => write!(
                f,
                "{} is {deviations:.1} usual deviations off: used as {factor:.1} times as noisy",
                name(output)
            ),
            Action::Stuck { output, repeats } => {
                write!(f, "{} has repeated itself {repeats} times: not used from here on", name(output))
            }
            Action::Offset { output, offset } => {
                write!(
                    f,
                    "{} has jumped: an offset of {offset:.4} is taken from it from here on",
                    name(output)
                )
            }
            Action::Believed { output, deviations } => {
                write!(f, "{} is {deviations:.1} usual deviations off, and moves: believed", name(output))
            }
            Action::Back { output, missing } => {
                write!(f, "{} is used again, after {missing} samples", name(output))
            }
            Action::Outside { channel, distance } => write!(
                f,
                "{} is outside its design range by {:.0} % of its width: nothing is learned there",
                name(channel),
                100.0 * distance
            ),
            Action::Inside => write!(f, "inside the design range again: learning goes on"),
            Action::Switched { to, cause, errors: [used, shore] } => {
                let cause = match cause {
                    Cause::Record => "by the record of late",
                    Cause::Test => "the one in use failed a test",
                    Cause::Guarantee => "what the guarantee leaves is nearly used up",
                    Cause::NotFinite => "the one in use gave no numbers",
                };
                write!(
                    f,
                    "the {} model predicts from here on: {cause} (error {used:.4}, frozen {shore:.4})",
                    to.name()
                )
            }
            Action::RolledBack { to, errors: [learner, better] } => write!(
                f,
                "the weights went back to those of the {} model (error {learner:.4}, its {better:.4})",
                to.name()
            ),
            Action::Restarted => write!(f, "the covariance was not sound and starts again"),
            Action::SnapshotTaken { error } => write!(f, "a snapshot was taken (error {error:.4})"),
        }
    }
}

/// Names of a model's outputs, then inputs.
pub fn names(model: &Model) -> Vec<String> {
    let ports = model.description.outputs.iter().chain(&model.description.inputs);
    ports.map(|port| port.channel.name.clone()).collect()
}

/// What happened along runs that were walked one after the other, from their first sample to their last.
pub(super) fn happened(events: &[Event], runs: &[&Trajectory], names: &[String]) -> Vec<Happened> {
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
        // Memory takes all that is written into it.
        let _ = write!(text, "{}", Worded { action: &event.action, names });
        Happened { run, t, action: event.action.name(), text }
    };
    events.iter().map(word).collect()
}
