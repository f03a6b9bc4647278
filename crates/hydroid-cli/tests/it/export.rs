//! `hydroid export`: files, names, refusals.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{MODEL, done, run, simple_vessel, text};

fn refused(folder: &Path, args: &str, words: &[&str]) {
    let output = run(folder, args);
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{args}: {error}");
    assert!(words.iter().all(|word| error.contains(word)), "{args}: {error}");
}

fn files(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_vessel_becomes_a_header_and_a_source() {
    let folder = TempDir::new().unwrap();
    let output = done(folder.path(), "export hydrofoil --to c --dt 0.02 -o boat.c --json");
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(document["name"], "boat");
    assert_eq!(document["files"], serde_json::json!(["./boat.h", "./boat.c"]));
    assert_eq!(files(folder.path()), ["boat.c", "boat.h"]);
    let header = fs::read_to_string(folder.path().join("boat.h")).unwrap();
    assert!(
        header.contains("#define BOAT_DT 0.02") && header.contains("typedef double boat_real"),
        "{header}"
    );
    assert!(header.contains("BOAT_INPUT_PP_CMD = 0, /* PP_cmd [N], -130 to 350 */"), "{header}");

    let again = TempDir::new().unwrap();
    done(again.path(), "export hydrofoil --to c --dt 0.02 -o boat.h");
    for file in ["boat.h", "boat.c"] {
        let read = |folder: &TempDir| fs::read(folder.path().join(file)).unwrap();
        assert_eq!(read(&folder), read(&again), "the same model gives the same bytes");
    }

    let output =
        done(folder.path(), "export hydrofoil --to c --precision float --name 7-seas -o new/firmware");
    assert!(text(&output.stdout).contains("new/firmware/x7_seas.h"), "{}", text(&output.stdout));
    let source = fs::read_to_string(folder.path().join("new/firmware/x7_seas.c")).unwrap();
    assert!(source.contains("x7_seas_logistic(float x)"), "{source}");
}

#[test]
fn wrong_arguments_are_refused() {
    let folder = TempDir::new().unwrap();
    refused(folder.path(), "export nothing.safetensors --to c -o boat.c", &["nothing.safetensors"]);
    refused(folder.path(), "export hydrofoil --to c -o boat.txt", &["boat.txt", ".c"]);
    refused(folder.path(), "export hydrofoil --to c --dt -1 -o boat.c", &["sample time"]);
    let none = "export hydrofoil --to fmu --library nowhere.so -o boat.fmu";
    refused(folder.path(), none, &["nowhere.so", "cargo build --release -p hydroid-fmu"]);
    fs::write(folder.path().join("other.so"), b"no library").unwrap();
    refused(folder.path(), "export hydrofoil --to fmu --library other.so -o boat.fmu", &["other.so"]);
    fs::remove_file(folder.path().join("other.so")).unwrap();
    refused(folder.path(), "export hydrofoil --to cobol -o boat.c", &["cobol", "possible values"]);
    for (options, format, word) in [
        ("--precision float", "casadi", "c, onnx"),
        ("--adapter", "fmu", "of c"),
        ("--fmi 2", "c", "of fmu"),
        ("--library a.so", "c", "of fmu"),
        ("--speed 1", "mss", "sdf, latex"),
        ("--length 1", "sdf", "of latex"),
        ("--vessel a.toml", "c", "sdf, mss, latex"),
        ("--link hull", "latex", "of sdf"),
        ("--forgetting 10", "c", "need --adapter"),
        ("--adapter", "c", "without --adapter"),
    ] {
        refused(folder.path(), &format!("export hydrofoil --to {format} {options} -o new"), &[word]);
    }
    assert!(files(folder.path()).is_empty());
}

#[test]
fn a_vessel_goes_to_python_simulators_and_papers() {
    let folder = TempDir::new().unwrap();
    let otter = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vessels/otter.toml");
    let otter = otter.display();
    done(folder.path(), &format!("export {otter} --to casadi -o nmpc.py"));
    let casadi = fs::read_to_string(folder.path().join("nmpc.py")).unwrap();
    assert!(casadi.contains("\nDT = 0.1\n"), "{casadi}");
    done(folder.path(), &format!("export {otter} --to sdf --link hull -o otter.sdf"));
    done(folder.path(), &format!("export {otter} --to mss -o otter.py"));
    done(folder.path(), &format!("export {otter} --to latex --speed 1.5 -o otter.tex"));
    let found = files(folder.path());
    for file in ["otter_inertial.sdf", "otter_gz.sdf", "otter_vrx.sdf", "otter.py", "otter.m", "otter.tex"] {
        assert!(found.iter().any(|name| name == file), "{file}: {found:?}");
    }
    let plugin = fs::read_to_string(folder.path().join("otter_gz.sdf")).unwrap();
    assert!(plugin.contains("<link_name>hull</link_name>") && plugin.contains("<xU>-77.55</xU>"), "{plugin}");
    refused(folder.path(), "export hydrofoil --to latex --speed -1 -o t.tex", &["--speed", "positive"]);
    refused(folder.path(), "export hydrofoil --to latex --vessel nothing.toml -o t.tex", &["nothing.toml"]);
}

/// A program that learns from rows of a log and prints what it learned.
const LEARNS: &str = "#include \"boat.h\"
#include <stdio.h>
int main(void)
{
    static boat_state state;
    static boat_adapter adapter;
    double command[BOAT_INPUTS], held[BOAT_INPUTS], outputs[BOAT_OUTPUTS];
    int i, started = 0;
    for (;;) {
        for (i = 0; i < BOAT_INPUTS + BOAT_OUTPUTS; ++i) {
            if (scanf(\"%lf\", i < BOAT_INPUTS ? &command[i] : &outputs[i - BOAT_INPUTS]) != 1) {
                for (i = 0; i < BOAT_WEIGHTS; ++i) {
                    printf(\"%.17g\\n\", state.x[BOAT_FIRST_WEIGHT + i]);
                }
                return 0;
            }
        }
        if (started) {
            boat_adapter_step(&adapter, &state, held);
            boat_adapter_observe(&adapter, &state, outputs);
        } else {
            boat_adapter_init(&adapter, &state, outputs, command);
            started = 1;
        }
        for (i = 0; i < BOAT_INPUTS; ++i) {
            held[i] = command[i];
        }
    }
}
";

#[test]
fn exported_c_learns_from_a_log_what_the_command_learns() {
    let vessel = simple_vessel();
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let (model, log) = (vessel.join(MODEL), vessel.join("c.csv"));
    let (model, log_name) = (model.display(), log.display());
    let adapted =
        run(at, &format!("adapt {model} {log_name} --no-guard --forgetting 30 -o adapted.safetensors -q"));
    assert!(matches!(adapted.status.code(), Some(0 | 1)), "{}", text(&adapted.stderr));
    done(at, &format!("export {model} --to c --adapter --forgetting 30 -o boat.c"));

    let adapted = hydroid::model::read(&at.join("adapted.safetensors")).unwrap();
    let learned = adapted.equations().unwrap().equations().coefficients().to_vec();
    let names: Vec<String> = adapted
        .description
        .inputs
        .iter()
        .chain(&adapted.description.outputs)
        .map(|port| port.channel.name.clone())
        .collect();
    let text_of_log = fs::read_to_string(&log).unwrap();
    let mut lines = text_of_log.lines().map(|line| line.split(',').collect::<Vec<&str>>());
    let header = lines.next().unwrap();
    let places: Vec<usize> = names
        .iter()
        .map(|name| header.iter().position(|column| column.split(' ').next() == Some(name)).unwrap())
        .collect();
    let rows: String = lines
        .map(|row| places.iter().map(|&place| row[place]).collect::<Vec<&str>>().join(" ") + "\n")
        .collect();
    fs::write(at.join("rows.txt"), rows).unwrap();
    fs::write(at.join("main.c"), LEARNS).unwrap();
    let built = Command::new("cc")
        .current_dir(at)
        .args(["-std=c99", "-O2", "main.c", "boat.c", "-o", "main", "-lm"])
        .output()
        .unwrap();
    assert!(built.status.success(), "{}", text(&built.stderr));
    let rows = fs::File::open(at.join("rows.txt")).unwrap();
    let output = Command::new(at.join("main")).stdin(rows).output().unwrap();
    let found: Vec<f64> = text(&output.stdout).lines().map(|line| line.parse().unwrap()).collect();
    let learned: Vec<f64> = learned.into_iter().filter(|xi| *xi != 0.0).collect();
    assert_eq!(found.len(), learned.len());
    let largest = learned.iter().fold(0.0_f64, |largest, xi| largest.max(xi.abs()));
    let far = found.iter().zip(&learned).map(|(a, b)| (a - b).abs() / largest).fold(0.0, f64::max);
    assert!(far < 1e-9, "{far}");
}
