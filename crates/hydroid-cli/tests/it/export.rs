//! `hydroid export`: files, names, refusals.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{done, run, text};

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
