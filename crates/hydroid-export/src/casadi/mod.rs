//! `CasADi`: a Python file that builds the functions of a model, and its definitions for do-mpc and acados.

mod function;

use std::fmt::Write as _;

use hydroid::model::{Model, Port};

use crate::name::{comment, identifier};
use crate::state_space::StateSpace;
use crate::{File, Options};

const HEAD: &str = include_str!("head.py");
const TAIL: &str = include_str!("tail.py");

/// Writes a model as `NAME.py`.
pub(crate) fn export(model: &Model, options: &Options) -> Vec<File> {
    let space = StateSpace::of(model);
    let name = identifier(&options.name);
    let mut text = head(model, &space, &name);
    for index in space.functions() {
        text.push_str(&function::function(&space.module, index));
        text.push_str("\n\n");
    }
    let of = |index: usize| function::name(&space.module, index);
    for (name, index) in
        [("start", space.start), ("step", space.step), ("observe", space.observe), ("output", space.output)]
    {
        let _ = writeln!(text, "{name} = {}", of(index));
    }
    let rates = space.rates.map_or_else(|| String::from("None"), of);
    let _ = writeln!(text, "rates = {rates}");
    match &space.block {
        Some(block) => {
            let _ = writeln!(
                text,
                "HORIZON = {}\npredict = {}\nfollow = {}",
                block.horizon,
                of(block.predict),
                of(block.follow)
            );
        }
        None => text.push_str("HORIZON = 1\npredict = None\nfollow = None\n"),
    }
    text.push_str(TAIL);
    vec![File { name: format!("{name}.py"), content: text.into_bytes() }]
}

/// A string of Python; see [`comment`].
fn string(text: &str) -> String {
    format!("\"{}\"", comment(text))
}

fn list(items: impl Iterator<Item = String>) -> String {
    format!("[{}]", items.collect::<Vec<String>>().join(", "))
}

fn head(model: &Model, space: &StateSpace, name: &str) -> String {
    let d = &model.description;
    let title = format!(
        "{} '{}' as functions of CasADi.",
        comment(model.title()),
        comment(&d.name).trim_end_matches('"')
    );
    let names = |ports: &[Port]| list(ports.iter().map(|port| string(&port.channel.name)));
    let units = |ports: &[Port]| list(ports.iter().map(|port| string(&port.channel.unit)));
    let ranges = |ports: &[Port]| {
        let range = |port: &Port| port.training_range.unwrap_or(port.range);
        list(ports.iter().map(|port| format!("({:?}, {:?})", range(port).low, range(port).high)))
    };
    let places = ["u", "v", "r"].map(|motion| {
        let place = d.outputs.iter().position(|port| port.channel.name == motion);
        place.map_or_else(|| String::from("None"), |place| place.to_string())
    });
    let mut text = format!("\"\"\"{title}\n{HEAD}\nNAME = {}\nDT = {:?}\n", string(name), d.dt);
    for (what, ports) in [("OUTPUT", &d.outputs), ("INPUT", &d.inputs)] {
        let _ = writeln!(text, "{what}S = {}", names(ports));
        let _ = writeln!(text, "{what}_UNITS = {}", units(ports));
        let _ = writeln!(text, "{what}_RANGES = {}", ranges(ports));
    }
    let labels = space.state.iter();
    let _ = writeln!(text, "STATES = {}", list(labels.clone().map(|label| string(&label.name))));
    let _ = writeln!(text, "STATE_UNITS = {}", list(labels.map(|label| string(&label.unit))));
    let _ = writeln!(text, "# Places of surge, sway and yaw rate among the outputs.");
    let _ = writeln!(text, "MOTION = [{}]\n\n", places.join(", "));
    text
}
