//! The variables of an FMU, in one order for the description and for the library.

use hydroid::model::{Model, Port};
use hydroid::plant::{Motion, described_inputs, input_values, rest};

use super::continuous::{Continuous, Hidden};
use crate::name::identifiers;

/// What a variable stands for, with its index among those of its role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Time \[s\].
    Time,
    Input(usize),
    /// An output of the model.
    Output(usize),
    /// Position north, position east \[m\], heading \[rad\].
    Pose(usize),
    /// A hidden state of a model in continuous time.
    Hidden(usize),
    /// Derivative of a state of a model in continuous time: outputs, hidden states, pose.
    Derivative(usize),
    /// Output at the start.
    StartOutput(usize),
    /// Command before the start.
    StartInput(usize),
    /// Pose at the start.
    StartPose(usize),
    /// Velocity of the water, north and east \[m/s\].
    Current(usize),
}

/// A variable. Its value reference is its index.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    pub role: Role,
    /// Identifier, unique in the FMU.
    pub name: String,
    /// Name of the channel, and explanation.
    pub description: String,
    /// Unit; empty without one.
    pub unit: String,
    /// Start value of an input or parameter.
    pub start: Option<f64>,
    /// Typical magnitude of a state.
    pub nominal: f64,
}

/// The variables of a model.
#[derive(Debug)]
pub struct Variables {
    all: Vec<Variable>,
    continuous: Result<Continuous, &'static str>,
    motion: Option<Motion>,
    counts: [usize; 2],
}

/// Names, units and explanations of the pose.
const POSE: [(&str, &str, &str); 3] = [
    ("x", "m", "position north"),
    ("y", "m", "position east"),
    ("psi", "rad", "heading, clockwise from north, not wrapped"),
];

const CURRENT: [&str; 2] = ["north", "east"];

fn nominal(port: &Port) -> f64 {
    let size = port.range.low.abs().max(port.range.high.abs());
    if size.is_finite() && size > 0.0 { size } else { 1.0 }
}

/// Unit of a rate.
fn per_second(unit: &str) -> String {
    match unit {
        "" | "1" => String::from("1/s"),
        "m" | "rad" | "N" => format!("{unit}/s"),
        "m/s" | "rad/s" => format!("{unit}^2"),
        unit => format!("({unit})/s"),
    }
}

impl Variables {
    /// The variables of a model.
    pub fn of(model: &Model) -> Self {
        let continuous = Continuous::of(model);
        let motion = Motion::of(model).ok();
        let d = &model.description;
        let hidden = continuous.as_ref().map_or(&[][..], |continuous| continuous.hidden());
        let mut all = channels(model, hidden, motion.is_some());
        if continuous.is_ok() {
            let of = |role: &dyn Fn(&Role) -> bool| -> Vec<Variable> {
                all.iter().filter(|variable| role(&variable.role)).cloned().collect()
            };
            let states = [
                of(&|role| matches!(role, Role::Output(_))),
                of(&|role| matches!(role, Role::Hidden(_))),
                of(&|role| matches!(role, Role::Pose(_))),
            ];
            all.extend(states.concat().into_iter().enumerate().map(|(index, state)| Variable {
                role: Role::Derivative(index),
                name: format!("der {}", state.name),
                description: format!("rate of {}", state.name),
                unit: per_second(&state.unit),
                start: None,
                nominal: 1.0,
            }));
        }
        let names = identifiers(all.iter().map(|variable| variable.name.as_str()));
        all.iter_mut().zip(names).for_each(|(variable, name)| variable.name = name);
        Self { all, continuous, motion, counts: [d.outputs.len(), d.inputs.len()] }
    }

    /// All variables; the value reference of each is its index.
    pub fn all(&self) -> &[Variable] {
        &self.all
    }

    /// Value reference of a role.
    pub fn reference(&self, role: Role) -> Option<usize> {
        self.all.iter().position(|variable| variable.role == role)
    }

    /// Derivatives in continuous time, or the reason why there are none.
    pub fn continuous(&self) -> Result<&Continuous, &'static str> {
        self.continuous.as_ref().map_err(|reason| *reason)
    }

    /// Indices of the motion in the outputs, if the model is one of the motion.
    pub fn motion(&self) -> Option<&Motion> {
        self.motion.as_ref()
    }

    /// Number of outputs and of inputs of the model.
    pub fn counts(&self) -> [usize; 2] {
        self.counts
    }

    /// The role of a state of a model in continuous time.
    pub fn state(&self, index: usize) -> Role {
        let outputs = self.counts[0];
        let hidden = self.continuous.as_ref().map_or(0, |continuous| continuous.hidden().len());
        match index.checked_sub(outputs) {
            None => Role::Output(index),
            Some(index) if index < hidden => Role::Hidden(index),
            Some(index) => Role::Pose(index - hidden),
        }
    }
}

fn channels(model: &Model, hidden: &[Hidden], moves: bool) -> Vec<Variable> {
    let d = &model.description;
    let variable =
        |role: Role, name: &str, description: String, unit: &str, start: Option<f64>, nominal: f64| {
            Variable { role, name: name.to_owned(), description, unit: unit.to_owned(), start, nominal }
        };
    let water = if moves { ", through the water where it is a velocity" } else { "" };
    // A boat that contradicts itself has no values: they are not given.
    let values = input_values(model).unwrap_or_default();
    let about = described_inputs(model);
    let still = rest(model);
    let mut all = vec![variable(Role::Time, "time", String::from("time"), "s", None, 1.0)];
    for (i, port) in d.inputs.iter().enumerate() {
        let channel = &port.channel;
        let (value, start) = (values.get(i), values.get(i).map_or(0.0, |value| value.neutral));
        let what = if value.is_none_or(|value| value.is_commanded) { "command" } else { "input" };
        let about = about.get(i).map(|(_, about)| format!(": {about}")).unwrap_or_default();
        let text = format!("{what} {}{about}", channel.name);
        all.push(variable(Role::Input(i), &channel.name, text, &channel.unit, Some(start), nominal(port)));
    }
    for (i, port) in d.outputs.iter().enumerate() {
        let channel = &port.channel;
        let text = format!("output {}{water}", channel.name);
        all.push(variable(Role::Output(i), &channel.name, text, &channel.unit, None, nominal(port)));
    }
    if moves {
        for (i, (name, unit, text)) in POSE.into_iter().enumerate() {
            all.push(variable(Role::Pose(i), name, text.to_owned(), unit, None, 1.0));
        }
    }
    for (i, state) in hidden.iter().enumerate() {
        let text = format!("actuator: {}", state.name);
        all.push(variable(Role::Hidden(i), &state.name, text, &state.unit, None, 1.0));
    }
    for (i, (port, start)) in d.outputs.iter().zip(&still).enumerate() {
        let channel = &port.channel;
        let (name, text) =
            (format!("start {}", channel.name), format!("output {} at the start{water}", channel.name));
        all.push(variable(Role::StartOutput(i), &name, text, &channel.unit, Some(*start), nominal(port)));
    }
    for (i, port) in d.inputs.iter().enumerate() {
        let start = values.get(i).map_or(0.0, |value| value.neutral);
        let channel = &port.channel;
        let (name, text) =
            (format!("start {}", channel.name), format!("command {} before the start", channel.name));
        all.push(variable(Role::StartInput(i), &name, text, &channel.unit, Some(start), nominal(port)));
    }
    if moves {
        for (i, (name, unit, text)) in POSE.into_iter().enumerate() {
            let text = format!("{text} at the start");
            all.push(variable(Role::StartPose(i), &format!("start {name}"), text, unit, Some(0.0), 1.0));
        }
        for (i, name) in CURRENT.into_iter().enumerate() {
            let text = format!("velocity of the water {name}");
            all.push(variable(Role::Current(i), &format!("current {name}"), text, "m/s", Some(0.0), 1.0));
        }
    }
    all
}
