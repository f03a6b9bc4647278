//! The exported Python, read by Python's own parser. tests/export/casadi runs it.

use std::fs;
use std::path::Path;
use std::process::Command;

use hydroid::model::Model;
use hydroid_export::{Format, Options, export};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::TestRunner;
use serde_json::json;
use tempfile::TempDir;

use crate::models::all;

fn write(model: &Model, name: &str, folder: &Path) {
    let files = export(model, &Format::Casadi, &Options { name: name.to_owned() }).unwrap();
    assert_eq!(files.len(), 1);
    fs::write(folder.join(&files[0].name), &files[0].content).unwrap();
}

/// Lines that a program prints in Python; `HYDROID_PYTHON` is the interpreter. `None`, with a message, without Python.
fn python(program: &str, folder: &Path) -> Option<usize> {
    let python = std::env::var("HYDROID_PYTHON").unwrap_or_else(|_| String::from("python3"));
    let output = Command::new(&python).args(["-c", program]).current_dir(folder).output();
    let Ok(output) = output else {
        println!("skipped: no {python}; HYDROID_PYTHON names another one");
        return None;
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap().lines().count())
}

/// Names that each function uses must be defined: constants, helpers, functions, arguments and variables.
const NAMES: &str = "
import ast, builtins, glob
for path in sorted(glob.glob('*.py')):
    tree = ast.parse(open(path, encoding='utf-8').read())
    known = set(dir(builtins))
    for node in ast.walk(tree):
        match node:
            case ast.Name(ctx=ast.Store()): known.add(node.id)
            case ast.FunctionDef(): known.add(node.name)
            case ast.arg(): known.add(node.arg)
            case ast.alias(): known.add(node.asname or node.name)
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert used <= known, (path, used - known)
    print(path)
";

#[test]
fn files_of_all_models_define_the_names_that_they_use() {
    let folder = TempDir::new().unwrap();
    let models = all();
    for (k, model) in models.iter().enumerate() {
        write(model, &format!("model{k}"), folder.path());
    }
    let found = python(NAMES, folder.path());
    assert!(found.is_none_or(|found| found == models.len()), "{found:?}");
}

/// The structure of each file, with texts left out, is that of the file of harmless names; the names are whole.
const STRUCTURE: &str = "
import ast, glob, json
def read(path):
    tree = ast.parse(open(path, encoding='utf-8').read())
    values = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and node.targets[0].id in ('OUTPUTS', 'INPUTS', 'OUTPUT_UNITS', 'INPUT_UNITS'):
            values[node.targets[0].id] = list(ast.literal_eval(node.value))
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            node.value = ''
    return ast.dump(tree), values
harmless, _ = read('harmless.py')
for path in sorted(glob.glob('hostile*.py')):
    found, values = read(path)
    expected = json.load(open(path[:-3] + '.json', encoding='utf-8'))
    assert found == harmless, expected
    assert values == expected, (values, expected)
    print(path)
";

fn renamed(base: &Model, names: &[String]) -> Model {
    let mut model = base.clone();
    model.description.name.clone_from(&names[0]);
    model.description.provenance.training = names.to_vec();
    let d = &mut model.description;
    for (port, name) in d.outputs.iter_mut().chain(&mut d.inputs).zip(names) {
        // Never the name of a velocity, so that no file has a pose.
        port.channel.name = format!("{name}!");
        port.channel.unit.clone_from(name);
    }
    model
}

#[test]
fn hostile_names_do_not_leave_their_place() {
    const CASES: usize = 64;
    let hostile = prop_oneof![
        "\\PC{0,30}",
        any::<String>(),
        "(\"\"\"|'''|\"|'|\\\\|\r|\n|\u{2028}|\u{c}|\\{|\\}|#|\\)|import os; os\\.abort\\(\\)){1,8}",
    ];
    let strategy = vec(hostile, 5);
    let folder = TempDir::new().unwrap();
    let base = all().remove(1);
    let harmless = ["a", "b", "c", "d", "e"].map(String::from);
    write(&renamed(&base, &harmless), "harmless", folder.path());
    let mut runner = TestRunner::deterministic();
    for case in 0..CASES {
        let names = strategy.new_tree(&mut runner).unwrap().current();
        let model = renamed(&base, &names);
        let name = format!("hostile{case}");
        write(&model, &name, folder.path());
        let of = |ports: &[hydroid::model::Port], unit: bool| -> Vec<String> {
            let channels = ports.iter().map(|port| &port.channel);
            channels.map(|channel| if unit { channel.unit.clone() } else { channel.name.clone() }).collect()
        };
        let d = &model.description;
        let expected = json!({
            "OUTPUTS": of(&d.outputs, false), "INPUTS": of(&d.inputs, false),
            "OUTPUT_UNITS": of(&d.outputs, true), "INPUT_UNITS": of(&d.inputs, true),
        });
        fs::write(folder.path().join(format!("{name}.json")), expected.to_string()).unwrap();
    }
    let found = python(STRUCTURE, folder.path());
    assert!(found.is_none_or(|found| found == CASES), "{found:?}");
}

#[test]
fn the_name_of_the_file_is_an_identifier_and_hides_no_module() {
    for (given, name) in [("../\"x\n", "x"), ("casadi", "casadi_model"), ("NumPy", "NumPy_model")] {
        let options = Options { name: given.to_owned() };
        let files = export(&all()[0], &Format::Casadi, &options).unwrap();
        assert_eq!(files[0].name, format!("{name}.py"));
        let text = String::from_utf8(files[0].content.clone()).unwrap();
        assert!(text.contains(&format!("\nNAME = \"{name}\"\n")), "{name}");
    }
}
