//! The Python file.

use std::fmt::Write as _;

use hydroid::model::{Model, Port};
use hydroid::plant::Simulation;

use super::function::{Printer, literal, symbols};
use crate::graph::{Op, Unary};
use crate::name::{comment, identifiers};
use crate::state_space::StateSpace;

const HEAD: &str = include_str!("head.py");
const TAIL: &str = include_str!("tail.py");

/// Units of the velocities in the kinematics of the pose.
const MOTION: [(&str, &str); 3] = [("u", "m/s"), ("v", "m/s"), ("r", "rad/s")];

pub(super) struct Text<'a> {
    /// Name of the exported model, an identifier.
    pub(super) name: &'a str,
    pub(super) model: &'a Model,
    pub(super) space: &'a StateSpace,
}

/// A literal of a text: printable ASCII, other characters escaped.
fn string(text: &str) -> String {
    let mut literal = String::from("\"");
    for c in text.chars() {
        let _ = match c {
            '"' | '\\' => write!(literal, "\\{c}"),
            ' '..='~' => write!(literal, "{c}"),
            _ => write!(literal, "\\U{:08x}", u32::from(c)),
        };
    }
    literal + "\""
}

/// A tuple of literals.
fn tuple(items: impl IntoIterator<Item = String>) -> String {
    let items: Vec<String> = items.into_iter().map(|item| format!("{item},")).collect();
    format!("({})", items.join(" "))
}

fn strings<'a>(texts: impl IntoIterator<Item = &'a str>) -> String {
    tuple(texts.into_iter().map(string))
}

impl Text<'_> {
    /// The content of the file.
    pub(super) fn module(&self) -> String {
        let mut text = self.about();
        text.push('\n');
        text.push_str(HEAD);
        text.push_str("\n\n");
        text.push_str(&self.constants());
        for helper in self.helpers() {
            text.push_str("\n\n");
            text.push_str(helper);
        }
        let printer = Printer { space: self.space, symbols: symbols(self.space) };
        for index in self.space.functions() {
            text.push_str("\n\n");
            text.push_str(&printer.function(index));
        }
        text.push_str("\n\n");
        if self.space.rates.is_none() {
            text.push_str("# The model is in discrete time.\nrates = None\n\n\n");
        }
        if self.space.block.is_none() {
            text.push_str("# The model predicts sample by sample.\npredict = follow = None\n\n\n");
        }
        text.push_str(TAIL);
        text
    }

    /// The description of the module.
    fn about(&self) -> String {
        let d = &self.model.description;
        let motion = if d.current.is_some() { "Velocities are relative to the water. " } else { "" };
        let block = match &self.space.block {
            Some(block) => format!(
                "predict(state, commands) and follow(state, commands, outputs): {} samples at once, row by row.\n",
                block.horizon
            ),
            None => String::new(),
        };
        let rates = match self.space.rates {
            Some(_) => "rates(state, command) are the rates of the state in continuous time.",
            None => "The model has no rates (rates is None).",
        };
        format!(
            "\"\"\"{title} '{name}': dynamics of a vessel for CasADi.

Written by hydroid {version}. Training runs: {training}.
Units are those of the channels; angles in rad. {motion}The sample time is DT seconds. Functions:

start(outputs, command)    state of a steady motion
step(state, command)       state after a sample with the command held
observe(state, outputs)    state after a measurement of the outputs; NaN is a missing value
output(state)              outputs in a state

{rates}
{block}rollout(samples), jacobians(), do_mpc_model() and acados_model() build on them; with_pose=True adds the position north
and east [m] and the heading [rad], clockwise from north, at the end of the state, in still water.
\"\"\"
",
            title = comment(self.model.title()),
            name = comment(&d.name).replace('\'', "_"),
            version = comment(&d.provenance.hydroid),
            training = comment(&d.provenance.training.join(", ")),
        )
    }

    fn constants(&self) -> String {
        let d = &self.model.description;
        let states = &self.space.state;
        let mut text =
            format!("NAME = {}\n\n# Sample time [s].\nDT = {}\n", string(self.name), literal(d.dt));
        for (what, ports) in [("OUTPUT", &d.outputs), ("INPUT", &d.inputs)] {
            text.push_str(&channels(what, ports));
        }
        // Names of the pose come first, so that they stay.
        let pose = ["x", "y", "psi"];
        let names = pose.into_iter().chain(states.iter().map(|label| label.name.as_str()));
        let identifiers = identifiers(names).split_off(pose.len());
        let _ = write!(
            text,
            "
# Numbers of the state: names, units, and names as identifiers.
STATES = {}
STATE_UNITS = {}
STATE_IDS = {}
POSE = (\"x\", \"y\", \"psi\")
",
            strings(states.iter().map(|label| label.name.as_str())),
            strings(states.iter().map(|label| label.unit.as_str())),
            strings(identifiers.iter().map(String::as_str)),
        );
        let (motion, missing) = self.motion();
        let horizon = self.space.block.as_ref().map(|block| block.horizon.to_string());
        let _ = write!(
            text,
            "
# Indices of u, v and r in the outputs, or the reason why there are none.
MOTION = {motion}
NO_MOTION = {missing}

# Samples that are predicted at once.
HORIZON = {}
",
            horizon.as_deref().unwrap_or("None")
        );
        text
    }

    /// Indices of the velocities, and the reason why they are missing.
    fn motion(&self) -> (String, String) {
        if let Err(error) = Simulation::new(self.model) {
            return (String::from("None"), string(&error.to_string()));
        }
        let outputs = &self.model.description.outputs;
        let place = |name: &str| {
            let place = outputs.iter().position(|port| port.channel.name == name);
            place.map_or(String::from("None"), |place| place.to_string())
        };
        (tuple(MOTION.map(|(name, _)| place(name))), String::from("None"))
    }

    /// Functions that those of the model call.
    fn helpers(&self) -> Vec<&'static str> {
        let uses = |test: &dyn Fn(&Op) -> bool| {
            let functions = self.space.functions();
            let mut nodes = functions.iter().flat_map(|&index| &self.space.function(index).nodes);
            nodes.any(|node| test(&node.op))
        };
        let gru = uses(&|op| matches!(op, Op::Gru { .. }));
        let lstm = uses(&|op| matches!(op, Op::Lstm { .. }));
        let logistic = gru || lstm || uses(&|op| matches!(op, Op::Unary(Unary::Logistic, _)));
        let helpers = [
            (logistic, include_str!("logistic.py")),
            (uses(&|op| matches!(op, Op::Unary(Unary::Sqrt, _))), include_str!("sqrt.py")),
            (gru, include_str!("gru.py")),
            (lstm, include_str!("lstm.py")),
            (uses(&|op| matches!(op, Op::Median { .. })), include_str!("median.py")),
            (uses(&|op| matches!(op, Op::Repeat { .. })), include_str!("repeat.py")),
        ];
        helpers.into_iter().filter(|(needed, _)| *needed).map(|(_, text)| text).collect()
    }
}

/// Constants of the outputs or inputs.
fn channels(what: &str, ports: &[Port]) -> String {
    let names = || ports.iter().map(|port| port.channel.name.as_str());
    let ids = identifiers(names());
    let range = |port: &Port| {
        let range = port.training_range.unwrap_or(port.range);
        format!("({}, {})", literal(range.low), literal(range.high))
    };
    format!(
        "
# {what}S: names, units, names as identifiers, and ranges in training.
{what}S = {}
{what}_UNITS = {}
{what}_IDS = {}
{what}_RANGES = {}
",
        strings(names()),
        strings(ports.iter().map(|port| port.channel.unit.as_str())),
        strings(ids.iter().map(String::as_str)),
        tuple(ports.iter().map(range)),
    )
}
