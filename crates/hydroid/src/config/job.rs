//! From logs and settings to the job of an identification.

use super::Config;
use crate::boat::{Boat, BoatError, Evidence, Property};
use crate::craft::CraftFile;
use crate::identify::{HORIZON, Job, Method, NetworkTrainingOptions, default_horizon, input_ranges};
use crate::key::key;
use crate::log::line::locate;
use crate::log::pulses::{Pulses, is_stated};
use crate::log::units::Unit;
use crate::log::{
    self, Channel, ChannelSpec, InputDelay, LogError, Note, PrepareOptions, RawColumn, RawLog, Selection,
    Split, Trajectory, split_named,
};
use crate::model::Reading;
use crate::recording::is_speed;

/// Origins of a cross-validation: more of them change the errors in the third digit only.
const CROSS_VALIDATION_ORIGINS: usize = 10_000;

/// The logs of an identification.
#[derive(Clone, Debug, Default)]
pub struct Logs<T> {
    /// Logs to learn from. Without logs for validation, all runs are cross-validated if all methods can be.
    pub train: Vec<T>,
    /// Logs that choose models.
    pub validate: Vec<T>,
    /// Logs that judge the models.
    pub test: Vec<T>,
}

impl<T> Logs<T> {
    /// All logs: training, validation, test.
    pub fn all(&self) -> impl Iterator<Item = &T> + Clone {
        self.train.iter().chain(&self.validate).chain(&self.test)
    }

    /// Logs made from these, in the order of [`all`](Self::all).
    #[must_use]
    pub fn map<U>(&self, mut make: impl FnMut(&T) -> U) -> Logs<U> {
        let mut each = |logs: &[T]| logs.iter().map(&mut make).collect();
        Logs { train: each(&self.train), validate: each(&self.validate), test: each(&self.test) }
    }
}

impl Config {
    /// Prepares all logs together, with common channels and sample time, and makes a job of them. `reading` has the
    /// options of [`log`](Self::log), as far as they are not replaced by others. `vessel` adds the method grey-box.
    ///
    /// # Errors
    /// If the logs cannot be prepared or do not fit together.
    pub fn job(
        self,
        mut reading: Reading,
        logs: &Logs<RawLog>,
        vessel: Option<CraftFile>,
    ) -> Result<(Job, Vec<Note>), LogError> {
        let mut methods = self.identify.methods();
        if let Some(vessel) = &vessel {
            // The commands of a vessel have their own neutral values and gains.
            let commands = vessel.craft.commands.iter();
            if let Some(command) = commands
                .map(|command| &command.name)
                .find(|name| self.boat.inputs.get(*name).is_some_and(|input| input.scale.is_some()))
            {
                let error = BoatError::OfVessel { name: command.clone() };
                return Err(LogError::Unusable {
                    path: logs.train.first().map(|log| log.path.clone()).unwrap_or_default(),
                    reason: error.to_string(),
                    remedy: format!(
                        "remove scale from [boat.inputs.{command}], so that the vessel reads raw values"
                    ),
                });
            }
            select(vessel, &mut reading);
            methods.push(Method::GreyBox);
        }
        let of_boat = |error: BoatError, remedy: &str| LogError::Unusable {
            path: logs.train.first().map(|log| log.path.clone()).unwrap_or_default(),
            reason: error.to_string(),
            remedy: remedy.to_owned(),
        };
        if reading.selection.inputs.is_empty() && self.boat.is_scaled() {
            return Err(of_boat(BoatError::NoColumns, "`hydroid inspect LOG --write-config` proposes both"));
        }
        let cross_validated =
            logs.validate.is_empty() && methods.iter().all(|method| method.is_cross_validated());
        let (split, reading, mut notes) = split(logs, &reading, cross_validated)?;
        let Self { mut boat, identify, sindy, network, lstm, gru, rnn, direct, affine, ranges, .. } = self;
        identify.state(&mut boat).map_err(|error| of_boat(error, "correct the option"))?;
        if let Some(first) = split.train.first() {
            let names: Vec<&str> = first.inputs.channels().iter().map(|c| c.name.as_str()).collect();
            if let Some(log) = logs.train.first() {
                state_columns(&mut boat, log, &reading.selection, first.inputs.channels());
            }
            for (name, range) in identify.limit.iter().filter(|(_, range)| range.unit.is_some()) {
                let channel = first.inputs.channels().iter().find(|channel| channel.name == *name);
                let channel = channel.cloned().unwrap_or_else(|| Channel::new(name.as_str(), ""));
                let limits = ([range.low, range.high], range.unit.as_deref());
                boat.state_values(&channel, None, Some(limits))
                    .map_err(|error| of_boat(error, &format!("correct {}", key("limit"))))?;
            }
            let refused = |error| of_boat(error, "correct it in [boat.inputs], or name it among the inputs");
            boat.check(&names).map_err(refused)?;
            let mut known = boat.clone();
            known.find(first.inputs.channels());
            let all: Vec<&Trajectory> =
                split.train.iter().chain(&split.validation).chain(&split.test).collect();
            let seen = input_ranges(&all).into_iter().map(|range| [range.low, range.high]);
            known.check_values(first.inputs.channels().iter().zip(seen)).map_err(refused)?;
        }
        let dt = split.train.first().map_or(1.0, |run| run.dt);
        let horizon = match identify.horizon {
            Some(horizon) => horizon.samples(dt),
            None => default_horizon(&split, cross_validated),
        };
        if identify.horizon.is_none() && horizon < HORIZON {
            notes.push(Note::info(format!(
                "the logs are short: blocks and horizon are shorter, and models are judged {:.4} s ahead ({horizon} samples in place of {HORIZON})",
                horizon as f64 * dt
            )).with_remedy(format!("log for longer, or set {}", key("horizon"))));
        }
        let job = Job {
            methods,
            origin_stride: identify
                .origin_stride
                .unwrap_or_else(|| default_origin_stride(&split, cross_validated)),
            split,
            reading,
            boat,
            horizon,
            seed: identify.seed.unwrap_or(0),
            ranges,
            motion: identify.motion.unwrap_or_default(),
            rate_limits: identify.rate_limit.unwrap_or_default(),
            allow_feedback: identify.allow_feedback,
            sindy,
            networks: NetworkTrainingOptions {
                all: network,
                lstm,
                gru,
                rnn,
                direct,
                affine,
                budget_s: identify.budget.map(|budget| budget.0),
                checkpoints: None,
                resume: false,
            },
            vessel,
        };
        Ok((job, notes))
    }
}

/// States the units of the columns that are not those of the model, as of a rudder in degrees, and the neutral positions of pulse
/// widths, where the boat has none.
fn state_columns(boat: &mut Boat, log: &RawLog, selection: &Selection, channels: &[Channel]) {
    for channel in channels {
        let named = selection.inputs.iter().find(|spec| spec.name == channel.name).cloned();
        let spec = named.unwrap_or_else(|| ChannelSpec::named(&channel.name));
        if spec.offset != 0.0 || spec.scale != 1.0 || spec.is_number {
            continue;
        }
        let Some((column, spec)) = locate(log, &spec) else { continue };
        let RawColumn { name, unit, values, .. } = &log.columns[column];
        let neutral = Pulses::of(values).neutral(is_stated(name, unit.as_deref()));
        if let Some(neutral) =
            neutral.filter(|_| boat.inputs.get(&channel.name).is_none_or(|of| of.neutral.is_none()))
        {
            let input = boat.inputs.entry(channel.name.clone()).or_default();
            input.neutral = Some(neutral.value);
            input.found.insert(Property::Neutral, Evidence::Log(neutral.words().to_owned()));
        }
        let text = spec.unit.as_ref().or(log.columns[column].unit.as_ref());
        let Some(unit) = text.and_then(|text| Unit::parse(text).ok()) else { continue };
        if unit.is_known() && unit.factor != 1.0 && unit.si == channel.unit {
            let input = boat.inputs.entry(channel.name.clone()).or_default();
            input.unit.get_or_insert(unit.text);
        }
    }
}

/// The channels of a vessel, where the options name none.
fn select(vessel: &CraftFile, reading: &mut Reading) {
    let selection = &mut reading.selection;
    if selection.outputs.is_empty() {
        selection.outputs = ["u", "v", "r"].map(ChannelSpec::named).to_vec();
    }
    if selection.inputs.is_empty() {
        selection.inputs = vessel.craft.commands.iter().map(|c| ChannelSpec::named(&c.name)).collect();
    }
}

/// Default samples between two origins: every sample is one on test runs; in a cross-validation, the origins are spread over all runs.
pub fn default_origin_stride(split: &Split, cross_validated: bool) -> usize {
    let samples: usize = split.train.iter().map(Trajectory::len).sum();
    if cross_validated { (samples / CROSS_VALIDATION_ORIGINS).max(1) } else { 1 }
}

/// All runs but those of test logs are training runs of a cross-validation.
fn split(
    logs: &Logs<RawLog>,
    reading: &Reading,
    cross_validated: bool,
) -> Result<(Split, Reading, Vec<Note>), LogError> {
    let prepared = log::prepare(logs.all(), &reading.selection, &reading.options)?;
    let mut notes = prepared.notes;
    notes.extend(unsigned_speed(&prepared.selection, &prepared.runs));
    let mut steps = Vec::new();
    for log in logs.all() {
        let inspection = log::inspect(log, &reading.selection, &reading.options)?;
        steps.extend(inspection.clock.map(|clock| clock.step_s));
        for note in inspection.notes {
            // Skips notes of the preparation; those may differ in the step in brackets.
            let start = |note: &Note| note.message.split(" (").next().unwrap_or_default().to_owned();
            let known = notes.iter().any(|other| start(other) == start(&note));
            if note.is_warning() && !known {
                notes.push(note);
            }
        }
    }
    let input_delay = in_seconds(reading.options.input_delay, &steps)?;
    let options = PrepareOptions { input_delay, ..reading.options };
    let reading = Reading { selection: prepared.selection, options };
    let [mut train, mut validate, mut test] = [(); 3].map(|()| Vec::new());
    for (run, source) in prepared.runs.into_iter().zip(prepared.sources) {
        if source < logs.train.len() {
            train.push(run);
        } else if source < logs.train.len() + logs.validate.len() {
            validate.push(run);
        } else {
            test.push(run);
        }
    }
    let split = if cross_validated {
        Split { train, validation: Vec::new(), test, notes: Vec::new() }
    } else {
        split_named(train, validate, test)?
    };
    Ok((split, reading, notes))
}

/// A warning of a surge that is a speed, which has no sign.
fn unsigned_speed(selection: &Selection, runs: &[Trajectory]) -> Option<Note> {
    let (at, spec) = selection.outputs.iter().enumerate().find(|(_, spec)| spec.name == "u")?;
    let is_signed = || runs.iter().flat_map(|run| run.outputs.column(at)).any(|u| u < 0.0);
    (is_speed(&spec.column) && !is_signed()).then(|| {
        Note::warning(format!(
            "`u` is the speed `{}`, which is never below 0: it does not tell astern from ahead, and contains the sway",
            spec.column
        ))
        .with_remedy("with a position or a course, and a heading or a yaw rate, name them in the section [log.sensors]; otherwise use the model ahead only, and without sway")
    })
}

/// Converts an input delay from samples to seconds, so that the model applies to logs of any rate.
fn in_seconds(delay: InputDelay, steps: &[f64]) -> Result<InputDelay, LogError> {
    let (InputDelay::Samples(n), Some(&step)) = (delay, steps.first()) else { return Ok(delay) };
    if n == 0 {
        return Ok(delay);
    }
    if steps.iter().any(|other| (other / step - 1.0).abs() > 0.01) {
        return Err(LogError::BadOption {
            what: "an input delay",
            value: format!("{n} samples"),
            reason: format!(
                "the logs have different sample times: write it in seconds, as in {}",
                key("input_delay").is("0.3s")
            ),
        });
    }
    Ok(InputDelay::Seconds(n as f64 * step))
}
