//! Vessel files with any set of actuators from end to end: simulate, identify, manoeuvre, control.

use std::fs;
use std::path::Path;
use std::process::Output;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{hydroid, text};

fn vessel(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../vessels/{name}.toml"));
    path.to_str().unwrap().to_owned()
}

fn ran(folder: &Path, args: &[&str]) -> Output {
    let output = hydroid(folder, args).output().unwrap();
    assert!(output.status.success(), "{args:?}: {}{}", text(&output.stderr), text(&output.stdout));
    output
}

fn json(folder: &Path, args: &[&str]) -> Value {
    serde_json::from_slice(&ran(folder, args).stdout).unwrap()
}

/// The way of a team with a boat of its own: a file for the boat, logs, the numbers of the file from the logs, a turning
/// circle and a controller that steers another copy of the boat.
#[test]
fn a_boat_is_identified_manoeuvred_and_steered() {
    for (name, dt, task) in [
        ("otter", "0.1", ["--speed", "1.5", "--radius", "8"]),
        ("tug", "0.5", ["--speed", "3", "--radius", "60"]),
    ] {
        let folder = TempDir::new().unwrap();
        let at = folder.path();
        let boat = vessel(name);
        for seed in ["1", "2", "3"] {
            let log = format!("{seed}.csv");
            ran(at, &["simulate", &boat, "--duration", "200", "--dt", dt, "--seed", seed, "-o", &log]);
        }
        // A start that is wrong in one number of the hull.
        let file = fs::read_to_string(&boat).unwrap();
        let start = file.replace("i_z = 16.3025", "i_z = 22.0").replace("i_z = 1.58e7", "i_z = 2.2e7");
        assert_ne!(file, start);
        fs::write(at.join("start.toml"), start).unwrap();
        let identify = [
            "identify",
            "1.csv",
            "2.csv",
            "3.csv",
            "--vessel",
            "start.toml",
            "--methods",
            "grey-box",
            "-o",
            "out",
        ];
        let summary = json(at, &[&identify[..], &["--json"]].concat());
        let models = summary["models"].as_array().unwrap();
        let grey_box = models.iter().find(|model| model["name"] == "grey-box").unwrap();
        assert_eq!(grey_box["kind"], "craft");
        assert_eq!(grey_box["file"], "out/grey-box.toml");
        let numbers = json(at, &["inspect", "out/grey-box.toml", "--json"]);
        let found = numbers["numbers"]["rigid_body.i_z"]["value"].as_f64().unwrap();
        let truth = if name == "otter" { 16.3025 } else { 1.58e7 };
        assert!((found / truth - 1.0).abs() < 0.1, "{name}: {found}");
        let trials = json(at, &["manoeuvre", "out/grey-box.toml", "--trials", "turning-circle", "--json"]);
        assert!(trials["trials"].as_array().unwrap().len() == 2, "{trials}");
        let control = [
            &[
                "control",
                "out/grey-box.toml",
                "--plant",
                &boat,
                "--controller",
                "cem",
                "--task",
                "lawn-mower",
            ][..],
            &task,
            &["--dt", dt, "--json"],
        ];
        let steered = json(at, &control.concat());
        let error = steered["rms_cross_track"].as_f64().unwrap();
        let length = if name == "otter" { 2.0 } else { 30.0 };
        println!("{name}: cross-track RMS {error:.3} m");
        assert!(error < 0.05 * length + 0.2, "{name}: {error}");
    }
}

/// A tug with two azimuths holds a point and a heading in a current; a ship with one rudder is refused.
#[test]
fn a_station_is_kept_where_the_actuators_suffice() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let [tug, mariner] = ["tug", "mariner"].map(vessel);
    // The azimuths begin at rest, and turn for some seconds.
    let station =
        ["--task", "station", "--points", "20,-5", "--heading", "30", "--dt", "0.5", "--evaluate-from", "40"];
    let held = [&["control", &tug][..], &station, &["--current", "0.2,0.1", "-o", "out", "--json"]].concat();
    let result = json(at, &held);
    let error = result["rms_position"].as_f64().unwrap();
    println!("tug: position RMS {error:.3} m");
    assert!(error < 1.0, "{error}");
    let track = fs::read_to_string(at.join("out/track.csv")).unwrap();
    let header: Vec<&str> = track.lines().next().unwrap().split(',').collect();
    let psi = header.iter().position(|name| *name == "psi [rad]").unwrap();
    let last: f64 = track.lines().last().unwrap().split(',').nth(psi).unwrap().parse().unwrap();
    assert!((last.to_degrees() - 30.0).abs() < 15.0, "{last}");
    for (args, words) in [
        (&["control", &mariner, "--task", "station"][..], "pushes it sideways"),
        (&["control", &tug, "--task", "station", "--controller", "pid"], "needs --controller cem"),
        (&["control", &tug, "--task", "station", "--points", "0,0;1,1"], "a station is one point"),
        (&["control", &tug, "--task", "station", "--speed", "1"], "--speed: a station has no speed"),
        (&["control", &tug, "--task", "circle", "--heading", "10"], "--heading needs --task station"),
    ] {
        let output = hydroid(at, args).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(text(&output.stderr).contains(words), "{args:?}: {}", text(&output.stderr));
    }
}

/// The numbers that a file marks are adapted along a log, or all but places and directions.
#[test]
fn vessel_files_are_adapted_along_a_log() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for (name, path) in [
        ("otter", "thruster.port.forward"),
        ("tug", "thruster.port.lag"),
        ("mariner", "rudder.rudder.lift_slope"),
    ] {
        let (file, log, learned) = (vessel(name), format!("{name}.csv"), format!("{name}.toml"));
        ran(at, &["simulate", &file, "--duration", "300", "-o", &log]);
        let said = text(&ran(at, &["adapt", &file, &log, "-o", &learned]).stdout);
        assert!(said.contains(path) && !said.contains("position"), "{said}");
        let written = fs::read_to_string(at.join(&learned)).unwrap();
        assert!(written.starts_with("# Numbers adapted by `hydroid adapt`"), "{written}");
        ran(at, &["manoeuvre", &learned, "--trial", "turning-circle"]);
    }
}

#[test]
fn a_vessel_file_is_printed_and_read_again() {
    let folder = TempDir::new().unwrap();
    let printed = text(&ran(folder.path(), &["simulate", &vessel("mariner"), "--print-vessel"]).stdout);
    fs::write(folder.path().join("again.toml"), &printed).unwrap();
    let again = text(&ran(folder.path(), &["simulate", "again.toml", "--print-vessel"]).stdout);
    assert_eq!(printed, again);
}

#[test]
fn wrong_vessel_files_are_refused_with_place_and_remedy() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let boat = fs::read_to_string(vessel("otter")).unwrap();
    fs::write(at.join("heavy.toml"), boat.replace("mass = 80.0", "mass = -80.0")).unwrap();
    fs::write(at.join("far.toml"), boat.replace("[-0.9, 0.395]", "[-9.0, 0.395]")).unwrap();
    fs::write(at.join("former.toml"), "name = \"boat\"\n[propeller]\nlag = 1.0\n").unwrap();
    ran(at, &["simulate", &vessel("otter"), "--duration", "60", "-o", "run.csv"]);
    for (args, words) in [
        (&["manoeuvre", "heavy.toml"][..], "heavy.toml, line 29: rigid_body.mass is -80"),
        (&["control", "far.toml", "--controller", "cem"], "outside the hull"),
        (&["simulate", "far.toml"], "correct position, hull.length or hull.beam"),
        (&["simulate", "former.toml"], "former.toml: this form of vessel files"),
        (
            &["control", &vessel("otter"), "--controller", "fl"],
            "cannot invert this model: thruster.port has the quadratic law",
        ),
        (&["adapt", &vessel("otter"), "run.csv", "-o", "learned.safetensors"], "a name that ends in .toml"),
        (
            &[
                "identify",
                "run.csv",
                "--inputs",
                "pwm_left,pwm_right",
                "--methods",
                "grey-box",
                "--horizon",
                "20",
                "-o",
                "out",
            ],
            "--vessel boat.toml",
        ),
    ] {
        let output = hydroid(at, args).output().unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
        assert!(said.contains(words), "{args:?}: {said}");
    }
}
