//! Proposal of commands: one for each actuator.

use super::actuators::{self, Actuator};
use super::propose::spec;
use super::survey::{FieldSurvey, Survey, TopicSurvey};
use super::words::{Name, Quantity};
use crate::boat::{FUNCTIONS, Output};
use crate::key::key;
use crate::log::units::{self, Unit};
use crate::log::{ChannelSpec, Selection};

/// Names of channels that a table from sensors, or one with velocities, already contains.
const TAKEN: &[&str] = &["t", "x", "y", "psi", "u", "v", "r", "wind_x", "wind_y"];
/// Rank of the set-points of controllers.
const CONTROLLER: u32 = 3;

/// A field that looks like a command.
pub(super) struct Command<'a> {
    rank: u32,
    /// The quantity of the motion that it states.
    motion: Option<Quantity>,
    /// Name of the channel.
    name: String,
    pub(super) topic: &'a TopicSurvey,
    pub(super) field: &'a FieldSurvey,
    actuator: Actuator,
}

impl Command<'_> {
    /// Order among fields of one actuator: what is said of them, then how often a command is held.
    fn order(&self, other: &Self) -> std::cmp::Ordering {
        let held = |command: &Self| command.field.held.unwrap_or(0.0);
        self.actuator.stage.cmp(&other.actuator.stage).then(held(other).total_cmp(&held(self)))
    }

    /// Whether the message has a value for each output.
    fn is_of_outputs(&self) -> bool {
        self.topic.rank().is_some_and(|rank| rank < 2)
    }
}

impl Survey {
    /// Fields that look like commands, of the topics of the best rank that contains one, one for each actuator, with the
    /// specifications of their channels. The others are named in remarks.
    pub(super) fn commands(
        &self,
        selection: &Selection,
        remarks: &mut Vec<String>,
    ) -> Vec<(ChannelSpec, Command<'_>)> {
        let sensors =
            selection.sensors.iter().flat_map(|sensors| sensors.columns().map(|(_, spec)| &spec.column));
        let used: Vec<&String> = sensors.chain(selection.outputs.iter().map(|spec| &spec.column)).collect();
        let mut found = self.named_commands(&used, remarks);
        if found.is_empty() {
            found = self.pulses(&used);
            for command in &found {
                remarks.push(format!("{}: its values are those of pulse widths", command.field.column));
            }
        }
        let best = found.iter().map(|found| found.rank).min();
        let (found, others): (Vec<_>, Vec<_>) = found.into_iter().partition(|found| Some(found.rank) == best);
        let of = |other: &Command<'_>| match self.topics.len() {
            1 => other.field.column.clone(),
            _ => other.topic.name.clone(),
        };
        let mut others: Vec<String> = others.iter().map(of).collect();
        others.dedup();
        if !others.is_empty() {
            let what = if self.topics.len() == 1 { "" } else { "fields of " };
            remarks.push(format!("not proposed beside these commands: {what}{}", others.join(", ")));
        }
        let found = one_each(found, remarks);
        let names: Vec<String> = found.iter().map(|found| found.name.clone()).collect();
        let repeated = |name: &str| names.iter().filter(|of| *of == name).count() > 1;
        let is_taken = |name: &str| TAKEN.contains(&name) || name.starts_with("deviation_");
        let mut commands = Vec::new();
        for command in found {
            let is_free = !repeated(&command.name) && !is_taken(&command.name);
            let name = if is_free { command.name.clone() } else { words_of(&command.field.column) };
            let name = if is_taken(&name) { format!("command_{name}") } else { name };
            let spec = spec(&format!("{name}={}", command.field.column));
            commands.extend(spec.map(|spec| (spec, command)));
        }
        commands
    }

    /// Fields with the words of commands.
    fn named_commands(&self, used: &[&String], remarks: &mut Vec<String>) -> Vec<Command<'_>> {
        let mut found = Vec::new();
        for topic in &self.topics {
            // The name of a single table is that of the whole recording.
            let is_named = self.topics.len() > 1 || !topic.type_name.is_empty();
            let Some(rank) = (if is_named { topic.rank() } else { Some(0) }) else { continue };
            for field in &topic.fields {
                let local = topic.local(field);
                let is_of_topic = is_named && (rank < 2 || actuators::is_topic(topic));
                let is_command = (is_of_topic && !actuators::is_none(local))
                    || actuators::is_command(local, is_rotation(field));
                if is_command
                    && topic.type_name.is_empty()
                    && let (Some(value), false) = (field.low, field.varies())
                {
                    let column = &field.column;
                    remarks.push(format!(
                        "`{column}` is constant ({value}), and is not proposed: a model holds for this value only"
                    ));
                }
                if !is_command || !field.varies() || used.contains(&&field.column) {
                    continue;
                }
                let motion = if is_of_topic { None } else { Name::of(local).motion() };
                let named = if is_named { &field.column } else { local };
                found.push(Command {
                    rank,
                    motion,
                    name: self.name(topic, local),
                    topic,
                    field,
                    actuator: Actuator::of(named),
                });
            }
        }
        // A set-point of the motion is that of a controller, beside an actuator that has this effect.
        let actuators: Vec<Actuator> =
            found.iter().filter(|of| of.motion.is_none()).map(|of| of.actuator.clone()).collect();
        let propels = |of: &&Actuator| !of.steers;
        let several = || actuators.iter().filter(propels).any(|of| of.which != actuators[0].which);
        let can_steer = actuators.iter().any(|of| of.steers) || several();
        for command in &mut found {
            let is_given = match command.motion {
                None => false,
                Some(Quantity::Speed | Quantity::Surge) => actuators.iter().any(|of| !of.steers),
                Some(_) => can_steer,
            };
            if is_given {
                command.rank = command.rank.max(CONTROLLER);
            }
        }
        found
    }

    /// Fields of tables without such words, whose values are pulse widths that rest or begin at the neutral position.
    fn pulses(&self, used: &[&String]) -> Vec<Command<'_>> {
        let tables = self.topics.iter().filter(|topic| topic.type_name.is_empty() && topic.rank().is_some());
        let fields = tables.flat_map(|topic| topic.fields.iter().map(move |field| (topic, field)));
        let is_pulse =
            |field: &FieldSurvey| field.is_pulse && field.varies() && !used.contains(&&field.column);
        fields
            .filter(|(topic, field)| is_pulse(field) && !actuators::is_none(topic.local(field)))
            .map(|(topic, field)| Command {
                rank: 0,
                motion: None,
                name: self.name(topic, topic.local(field)),
                topic,
                field,
                actuator: Actuator::of(&field.column),
            })
            .collect()
    }

    /// Name of the channel of a command.
    fn name(&self, topic: &TopicSurvey, local: &str) -> String {
        if let Some(Output::ArduPilot(n)) = output(topic, local)
            && let Some(number) = self.parameters.get(&format!("SERVO{n}_FUNCTION"))
            && let Some(function) = FUNCTIONS.iter().find(|function| function.number == *number)
        {
            return function.name.to_owned();
        }
        // Names in the message itself, in an array beside that of the values.
        if let Some((_, index)) = local.strip_suffix(']').and_then(|inner| inner.rsplit_once('['))
            && let Some((_, text)) = topic.texts.iter().find(|(name, _)| *name == format!("name[{index}]"))
        {
            return words_of(text);
        }
        match topic.name.get(..3) {
            Some("RSA") if local == "starboard" => return "rudder".to_owned(),
            Some("RPM") if local == "speed" => return "shaft_speed".to_owned(),
            _ => {}
        }
        let last = local.rsplit('.').next().unwrap_or(local);
        words_of(last)
    }
}

/// Whether a field is in a unit of rotation.
fn is_rotation(field: &FieldSurvey) -> bool {
    let stated =
        field.unit.as_deref().or_else(|| units::from_name(&field.column, false).map(|(_, unit)| unit));
    let unit = stated.and_then(|unit| Unit::parse(unit).ok());
    unit.is_some_and(|unit| unit.quantity == Some(units::Quantity::Rotation))
}

/// The best field of each actuator, in the order of the file. A topic of outputs has one for each.
fn one_each<'a>(found: Vec<Command<'a>>, remarks: &mut Vec<String>) -> Vec<Command<'a>> {
    let is_best = |k: usize, command: &Command<'_>| {
        let rivals = found.iter().enumerate().filter(|(_, other)| {
            other.actuator.is(&command.actuator) && !(command.is_of_outputs() && other.is_of_outputs())
        });
        rivals.min_by(|a, b| a.1.order(b.1)).filter(|(at, _)| *at != k).map(|(at, _)| at)
    };
    let best: Vec<Option<usize>> = found.iter().enumerate().map(|(k, command)| is_best(k, command)).collect();
    for (command, best) in found.iter().zip(&best) {
        let Some(best) = best.map(|at| &found[at]) else { continue };
        let (left, taken) = (&command.field.column, &best.field.column);
        let (stage, taken_stage) = (command.actuator.stage, best.actuator.stage);
        remarks.push(format!(
            "`{left}` ({}) is not proposed: by its name it is of the same actuator as `{taken}` ({}); to take it, write it in place of `{taken}` in {}",
            stage.text(),
            taken_stage.text(),
            key("inputs")
        ));
    }
    let mut best = best.into_iter();
    found.into_iter().filter(|_| best.next() == Some(None)).collect()
}

/// The output of an autopilot that a field contains.
pub(super) fn output(topic: &TopicSurvey, local: &str) -> Option<Output> {
    if topic.name.starts_with("RCO") {
        return Some(Output::ArduPilot(local.strip_prefix('C')?.parse().ok()?));
    }
    let index =
        |name: &str| local.strip_prefix(name)?.strip_prefix('[')?.strip_suffix(']')?.parse::<u32>().ok();
    match topic.name.as_str() {
        // The first instance is that of the main outputs.
        "actuator_outputs" => Some(Output::Px4(index("output")?.checked_add(1)?)),
        "actuator_motors" => Some(Output::Px4Motor(index("control").filter(|index| *index < 32)? + 1)),
        _ => None,
    }
}

/// A name of letters, digits and underscores.
fn words_of(text: &str) -> String {
    let name: String = text.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
    name.trim_matches('_').to_owned()
}
