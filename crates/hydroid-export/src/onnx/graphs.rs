//! The graphs of the files of a model.

use hydroid::model::{Model, Port};

use super::function;
use super::nodes::{Dim, Nodes, graph, integer, real, size, value};
use super::proto::{Graph, Value};
use crate::Precision;
use crate::name::comment;
use crate::state_space::{Block, StateSpace};

/// Name of the number of samples of a rollout.
const SAMPLES: Dim = Dim::Any("samples");

/// The graph of a file.
pub(super) struct FileGraph {
    /// The end of the name of the file.
    pub(super) name: &'static str,
    /// What the graph computes, in one line of plain text.
    pub(super) about: &'static str,
    pub(super) graph: Graph,
    /// Indices of the functions that it calls.
    pub(super) roots: Vec<usize>,
}

pub(super) struct Graphs<'a> {
    space: &'a StateSpace,
    precision: Precision,
    /// Channels of the outputs and inputs.
    outputs: String,
    inputs: String,
}

fn described(ports: &[Port]) -> String {
    let of = |port: &Port| format!("{} [{}]", comment(&port.channel.name), comment(&port.channel.unit));
    ports.iter().map(of).collect::<Vec<_>>().join(", ")
}

/// Names of the arguments of a call, without vectors that have no elements.
fn given<'a>(arguments: &[(&'a str, usize)]) -> Vec<&'a str> {
    arguments.iter().filter(|(_, len)| *len > 0).map(|(name, _)| *name).collect()
}

impl<'a> Graphs<'a> {
    pub(super) fn new(model: &Model, space: &'a StateSpace, precision: Precision) -> Self {
        let d = &model.description;
        Self { space, precision, outputs: described(&d.outputs), inputs: described(&d.inputs) }
    }

    fn states(&self) -> usize {
        self.space.state.len()
    }

    fn value(&self, name: &str, dims: &[Dim], about: &str) -> Value {
        value(name, real(self.precision), dims, about)
    }

    fn state(&self, name: &str) -> Value {
        self.value(name, &[Dim::Of(self.states())], "The whole memory of a run")
    }

    fn command(&self) -> Value {
        self.value("command", &[Dim::Of(self.space.inputs())], &self.inputs)
    }

    fn outputs(&self, about: &str) -> Value {
        let about =
            if about.is_empty() { self.outputs.clone() } else { format!("{}; {about}", self.outputs) };
        self.value("outputs", &[Dim::Of(self.space.outputs())], &about)
    }

    fn name(&self, index: usize) -> String {
        function::name(&self.space.module, index)
    }

    /// A graph of one call of a function.
    fn one_call(
        &self,
        about: (&'static str, &'static str),
        index: usize,
        input: [Value; 2],
        output: Value,
    ) -> FileGraph {
        let (name, about) = about;
        let mut nodes = Nodes::new("n", self.precision);
        let names: Vec<&str> = input.iter().filter_map(|value| value.name.as_deref()).collect();
        let lens = self.space.function(index).arguments.iter().map(|argument| argument.len);
        let arguments: Vec<(&str, usize)> = names.into_iter().zip(lens).collect();
        nodes.call_into(&self.name(index), &given(&arguments), output.name.as_deref().unwrap_or_default());
        let graph = Graph {
            node: nodes.finish(),
            name: Some(name.to_owned()),
            doc_string: Some(about.to_owned()),
            input: input.into(),
            output: vec![output],
        };
        FileGraph { name, about, graph, roots: vec![index] }
    }

    pub(super) fn start(&self) -> FileGraph {
        let about = "state of a steady motion: outputs and command have been constant for a long time";
        let input = [self.outputs(""), self.command()];
        self.one_call(("start", about), self.space.start, input, self.state("state"))
    }

    pub(super) fn observe(&self) -> FileGraph {
        let about = "state after a measurement of the outputs";
        let input = [self.state("state"), self.outputs("NaN for a missing value")];
        self.one_call(("observe", about), self.space.observe, input, self.state("next_state"))
    }

    pub(super) fn rates(&self, rates: usize) -> FileGraph {
        let about = "rates of the state in continuous time, per second";
        let dims = [Dim::Of(self.states())];
        let output = self.value("rates", &dims, "Per second, in the order of the state");
        self.one_call(("rates", about), rates, [self.state("state"), self.command()], output)
    }

    pub(super) fn step(&self) -> FileGraph {
        let (name, about) = ("step", "state and outputs after a sample with the command held");
        let mut nodes = Nodes::new("n", self.precision);
        self.sample(&mut nodes, ["state", "command"], ["next_state", "outputs"]);
        let graph = Graph {
            node: nodes.finish(),
            name: Some(name.to_owned()),
            doc_string: Some(about.to_owned()),
            input: vec![self.state("state"), self.command()],
            output: vec![self.state("next_state"), self.outputs("")],
        };
        FileGraph { name, about, graph, roots: vec![self.space.step, self.space.output] }
    }

    /// Next state and outputs, from state and command.
    fn sample(&self, nodes: &mut Nodes, [state, command]: [&str; 2], [next, outputs]: [&str; 2]) {
        let arguments = [(state, self.states()), (command, self.space.inputs())];
        nodes.call_into(&self.name(self.space.step), &given(&arguments), next);
        nodes.call_into(&self.name(self.space.output), &[next], outputs);
    }

    pub(super) fn rollout(&self) -> FileGraph {
        let name = "rollout";
        let mut nodes = Nodes::new("n", self.precision);
        let (about, roots) = match &self.space.block {
            None => {
                let body = self.body(1, |nodes, row| {
                    self.sample(nodes, ["x", row], ["x_next", "y"]);
                });
                scan(&mut nodes, body, "commands", "outputs");
                ("outputs of the next samples", vec![self.space.step, self.space.output])
            }
            Some(block) => {
                self.horizons(&mut nodes, block);
                (
                    "outputs of the next samples, predicted in whole horizons; behind the last command, it is held to the end \
                     of its horizon, where the last state is",
                    vec![block.predict, block.follow],
                )
            }
        };
        let (n, m) = (self.space.outputs(), self.space.inputs());
        let graph = Graph {
            node: nodes.finish(),
            name: Some(name.to_owned()),
            doc_string: Some(about.to_owned()),
            input: vec![self.state("state"), self.value("commands", &[SAMPLES, Dim::Of(m)], &self.inputs)],
            output: vec![
                self.value("outputs", &[SAMPLES, Dim::Of(n)], &self.outputs),
                self.state("last_state"),
            ],
        };
        FileGraph { name, about, graph, roots }
    }

    /// The body of a scan over rows of commands, `samples` in each row: `(x, c) -> x_next, y`.
    fn body(&self, samples: usize, write: impl Fn(&mut Nodes, &str)) -> Graph {
        let mut nodes = Nodes::new("b", self.precision);
        write(&mut nodes, "c");
        let (m, n) = (samples * self.space.inputs(), samples * self.space.outputs());
        let value = |name: &str, len: usize| self.value(name, &[Dim::Of(len)], "");
        Graph {
            node: nodes.finish(),
            name: Some(String::from("body")),
            doc_string: None,
            input: vec![value("x", self.states()), value("c", m)],
            output: vec![value("x_next", self.states()), value("y", n)],
        }
    }

    /// The rollout of a model that predicts horizons of `h` samples:
    ///
    /// ```text
    /// row k of a horizon, k = 0 .. h ceil(T / h) - 1: command min(k, T - 1)
    /// ```
    fn horizons(&self, nodes: &mut Nodes, block: &Block) {
        let (h, n, m) = (block.horizon, self.space.outputs(), self.space.inputs());
        let body = self.body(h, |nodes, ahead| {
            let arguments = [("x", self.states()), (ahead, h * m), ("y", h * n)];
            nodes.call_into(&self.name(block.predict), &given(&arguments[..2]), "y");
            nodes.call_into(&self.name(block.follow), &given(&arguments), "x_next");
        });
        let shape = nodes.op("Shape", &["commands"]);
        let [zero, one, horizon] = [0, 1, size(h)].map(|number| nodes.integers(&[], &[number]));
        let rest = nodes.integers(&[], &[size(h) - 1]);
        let samples = nodes.op_with("Gather", &[&shape, &zero], vec![integer("axis", 0)]);
        let more = nodes.op("Add", &[&samples, &rest]);
        let count = nodes.op("Div", &[&more, &horizon]);
        let padded = nodes.op("Mul", &[&count, &horizon]);
        let rows = nodes.op("Range", &[&zero, &padded, &one]);
        let last = nodes.op("Sub", &[&samples, &one]);
        let rows = nodes.op("Min", &[&rows, &last]);
        let commands = nodes.op_with("Gather", &["commands", &rows], vec![integer("axis", 0)]);
        let commands = nodes.reshape(&commands, &[-1, size(h * m)]);
        let predicted = nodes.fresh();
        scan(nodes, body, &commands, &predicted);
        let predicted = nodes.reshape(&predicted, &[-1, size(n)]);
        let (first, end) = (nodes.sizes(&[0]), nodes.reshape(&samples, &[1]));
        let axis = nodes.sizes(&[0]);
        nodes.push("Slice", &[&predicted, &first, &end, &axis], &["outputs"], Vec::new());
    }
}

/// The scan of a body over rows, from `state` to `last_state`.
fn scan(nodes: &mut Nodes, body: Graph, rows: &str, outputs: &str) {
    let attributes = vec![graph("body", body), integer("num_scan_inputs", 1)];
    nodes.push("Scan", &["state", rows], &["last_state", outputs], attributes);
}
