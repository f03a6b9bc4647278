//! What excites a plant: commands of a kind, or those of a log.

use std::path::Path;

use hydroid_core::vessel::Command;

use super::plan::GivenCommands;
use super::{Simulate, wrong};
use crate::config::SettingError;
use crate::excitation::PropellerRudder;
use crate::key::key;
use crate::log::{self, ChannelSpec, Note, RawLog, Selection, Trajectory};
use crate::model::Model;

/// What excites a plant.
#[derive(Clone, Debug)]
pub enum Drive {
    /// Commands of a kind: `mixed`, `low-speed`, `lawn-mower`, `circle`.
    Kind(String),
    /// The commands of a log.
    Log(RawLog),
}

impl Drive {
    /// A kind by its name, or the log in a file, which has an extension.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn read(text: &str) -> Result<Self, SettingError> {
        Ok(match Path::new(text) {
            file if file.extension().is_some() => Self::Log(log::read(file)?),
            _ => Self::Kind(text.to_owned()),
        })
    }

    pub(super) fn name(&self) -> &str {
        match self {
            Self::Kind(name) => name,
            Self::Log(log) => &log.path,
        }
    }
}

impl Simulate {
    /// The commands of a log with the outputs of the model, from the start on, or of a table without them.
    pub(super) fn commands_of_log(
        &self,
        model: &Model,
        log: &RawLog,
        notes: &mut Vec<Note>,
    ) -> Result<GivenCommands, SettingError> {
        let reading = &model.description.reading;
        if let Ok(prepared) = log::prepare(std::slice::from_ref(log), &reading.selection, &reading.options) {
            notes.extend(prepared.notes);
            model.check_heading(&prepared.runs)?;
            model.check(&prepared.runs)?;
            let time_s = self.start.map_or(0.0, |start| start.0);
            let begin = prepared.runs.first().map_or(0.0, |run| run.t0);
            let sample = |run: &Trajectory| ((begin + time_s - run.t0) / run.dt).round();
            let holds = |run: &&Trajectory| (0.0..(run.len() as f64 - 1.0)).contains(&sample(run));
            let Some(run) = prepared.runs.iter().find(holds) else {
                return wrong(format!(
                    "{}: {} has no samples there, or too few after it",
                    key("start").is(time_s),
                    log.path
                ));
            };
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "an index of the run"
            )]
            let from = sample(run) as usize;
            let end = match self.duration {
                Some(duration) => from.saturating_add(samples(duration, run.dt)?).min(run.len()),
                None => run.len(),
            };
            return Ok(GivenCommands::Log { run: Box::new(run.slice(0, end)), from });
        }
        if self.start.is_some() {
            return wrong(format!(
                "{} needs a log with the outputs of the model: {} has only commands",
                key("start"),
                log.path
            ));
        }
        self.held_rows(model, log).map(GivenCommands::Rows)
    }

    /// Rows of commands, each held until the next, at the sample time of the model.
    fn held_rows(&self, model: &Model, log: &RawLog) -> Result<Vec<f64>, SettingError> {
        // A table has outputs and inputs: the first input, and the others.
        let mut inputs: Vec<ChannelSpec> = model.description.reading.selection.inputs.clone();
        let first = inputs.drain(..inputs.len().min(1)).collect::<Vec<_>>();
        if inputs.is_empty() {
            inputs.extend(
                first.iter().map(|spec| ChannelSpec { name: format!("{} again", spec.name), ..spec.clone() }),
            );
        }
        let selection = Selection { outputs: first, inputs, ..Selection::default() };
        let names: Vec<&str> =
            model.description.inputs.iter().map(|port| port.channel.name.as_str()).collect();
        let rows = log::rows(log, &selection).map_err(|source| SettingError::Commands {
            file: log.path.clone(),
            needed: format!("the inputs of the model, {}", names.join(", ")),
            source: Box::new(source),
        })?;
        let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
            return wrong(format!("{}: no rows", log.path));
        };
        let (count, dt) = (names.len(), model.description.dt);
        let steps = samples(self.duration.unwrap_or(last.0 - first.0 + dt), dt)?;
        let mut held = Vec::with_capacity(steps * count);
        let mut row = 0;
        for k in 0..steps {
            let t = first.0 + k as f64 * dt + 1e-6 * dt;
            while row + 1 < rows.len() && rows[row + 1].0 <= t {
                row += 1;
            }
            held.extend_from_slice(&rows[row].1[..count]);
        }
        match held.iter().position(|value| !value.is_finite()) {
            Some(k) => wrong(format!(
                "{}: a command of '{}' is missing: fill the cell, or leave the row out",
                log.path,
                names[k % count]
            )),
            None => Ok(held),
        }
    }
}

fn samples(duration_s: f64, dt: f64) -> Result<usize, SettingError> {
    let samples = (duration_s / dt).round();
    if !(1.0..=5e7).contains(&samples) {
        return wrong(format!(
            "the duration {duration_s} s must hold between one and 50 million samples of {dt} s"
        ));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded by the check")]
    Ok(samples as usize)
}

/// Commands from a log with time and the two commands of a vessel.
pub(super) fn commands_of(
    log: &RawLog,
    vessel: &PropellerRudder,
) -> Result<Vec<(f64, Command)>, SettingError> {
    let [propeller, rudder] = [vessel.propeller(), vessel.rudder()];
    let spec = |name: &str| vec![ChannelSpec::named(name)];
    let selection =
        Selection { outputs: spec(&propeller.name), inputs: spec(&rudder.name), ..Selection::default() };
    let table = log::rows(log, &selection).map_err(|source| SettingError::Commands {
        file: log.path.clone(),
        needed: format!("the commands '{}' and '{}'", propeller.name, rudder.name),
        source: Box::new(source),
    })?;
    Ok(table.into_iter().map(|(t, row)| (t, Command { pp: row[0], rd: row[1] })).collect())
}
