//! The example, as the documents show it.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use hydroid::adapt::{self, Options};
use hydroid::model::{Model, encode, read, write};
use hydroid_core::craft::Craft;
use tempfile::TempDir;

use crate::models::{commands, drawn};
use crate::program::{GCC, Program};

const SAMPLES: usize = 1500;

/// A run of a heavier vessel: rows of outputs and commands.
fn rows(model: &Model) -> Vec<[f64; 5]> {
    let mut params = Craft::hydrofoil();
    params.hull.mass *= 1.5;
    let plant = Model::of_vessel(&params, model.description.dt).unwrap();
    let mut session = plant.session();
    session.observe(&[1.0, 0.0, 0.0]);
    let commands = commands(model, SAMPLES, 0.7);
    let noise: Vec<f64> = model.description.outputs.iter().map(|port| port.noise.unwrap()).collect();
    let mut rows = Vec::new();
    for (k, c) in commands.chunks_exact(2).enumerate() {
        let mut y = [0.0; 3];
        session.output(&mut y);
        for ((y, e), std) in y.iter_mut().zip(drawn(3, k as f64)).zip(&noise) {
            *y += std * e;
        }
        if k % 50 == 7 {
            y[1] = f64::NAN;
        }
        rows.push([y[0], y[1], y[2], c[0], c[1]]);
        session.advance(c);
    }
    rows
}

fn log(model: &Model, rows: &[[f64; 5]]) -> String {
    let inputs = &model.description.inputs;
    let mut text =
        format!("time [s],{} [1],{},r [rad/s],u [m/s],v\r\n", inputs[1].channel.name, inputs[0].channel.name);
    for (k, [u, v, r, first, second]) in rows.iter().enumerate() {
        let v = if v.is_nan() { String::new() } else { format!("{v:?}") };
        let _ = writeln!(text, "{:?},{second:?},{first:?},{r:?},{u:?},{v}", 0.1 * k as f64);
    }
    text
}

#[test]
fn the_example_adapts_along_a_log() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/adapt.c");
    let program = Program::of(&GCC, &source);
    let model = read(Path::new("hydrofoil")).unwrap();
    let rows = rows(&model);
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("log.csv"), log(&model, &rows)).unwrap();
    let printed = program.run(&["hydrofoil", &path("log.csv"), &path("learned.toml")]);
    let lines: Vec<&str> = printed.lines().collect();
    assert_eq!(lines.len(), SAMPLES / 100 + 1, "{printed}");
    assert!(
        lines[0].contains("11.9 s:") && lines[0].contains(" +- ") && lines[0].ends_with("rad/s"),
        "{printed}"
    );
    assert!(lines[15].starts_with("1500 samples, "), "{printed}");
    // The same in Rust.
    let options = Options::of(&model).guarded(&model);
    let (mut adapter, used) = adapt::adapter(&model, &options, &[]).unwrap();
    for [u, v, r, first, second] in rows {
        adapter.observe(&[u, v, r]);
        adapter.advance(&[first, second]);
    }
    let learned = adapt::learned(&model, &options, adapter.weights(), &[&path("log.csv")], &used).unwrap();
    assert!(std::fs::read(path("learned.toml")).unwrap() == encode(&learned).unwrap());
    let mass = |model: &Model| model.craft().unwrap().hull.mass;
    assert_ne!(mass(&learned), mass(&model));
    // The learned model is a model.
    write(&learned, Path::new(&path("again.toml"))).unwrap();
    program.run(&[&path("learned.toml"), &path("log.csv")]);
}

#[test]
fn the_program_of_the_document_runs() {
    let document = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/c-library.md");
    let text = std::fs::read_to_string(document).unwrap();
    let source = text.split("```c\n").nth(1).unwrap().split("```").next().unwrap();
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("boat.c");
    std::fs::write(&path, source).unwrap();
    let program = Program::of(&GCC, &path);
    let printed = program.run(&["hydrofoil"]);
    assert_eq!(printed.lines().count(), 6, "{printed}");
    assert!(printed.lines().all(|line| line.starts_with("u = ") && line.ends_with(" m/s")), "{printed}");
}

/// Names of functions in a text.
fn names(text: &str) -> BTreeSet<String> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let words = text.split(|c| !is_part(c)).filter(|word| word.starts_with("hydroid_"));
    words.map(str::to_owned).collect()
}

#[test]
fn the_document_lists_each_function() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let header = std::fs::read_to_string(folder.join("include/hydroid.h")).unwrap();
    let functions: BTreeSet<String> =
        names(&header).into_iter().filter(|name| header.contains(&format!("{name}("))).collect();
    assert!(functions.len() > 60, "{functions:?}");
    let text = std::fs::read_to_string(folder.join("../../docs/c-library.md")).unwrap();
    let table = text.split("## Functions").nth(1).unwrap().split("\n\n**").next().unwrap();
    let mut listed = names(&text);
    for row in table.lines().filter(|line| line.starts_with("| ")) {
        let handle = match row {
            row if row.contains("| `hydroid_model`:") => "hydroid_model",
            row if row.contains("| `hydroid_simulation`:") => "hydroid_simulation",
            _ => "hydroid_session",
        };
        let short = row.split('`').filter(|word| word.starts_with('_'));
        listed.extend(short.map(|word| format!("{handle}{word}")));
    }
    let missing: Vec<_> = functions.difference(&listed).collect();
    assert!(missing.is_empty(), "{missing:?}");
    let known = |name: &String| functions.contains(name) || header.contains(&format!("}} {name};"));
    let unknown: Vec<_> = listed.iter().filter(|name| !known(name)).collect();
    let others = ["hydroid_c", "hydroid_model", "hydroid_session", "hydroid_simulation", "hydroid_"];
    assert!(unknown.iter().all(|name| others.contains(&name.as_str())), "{unknown:?}");
}
