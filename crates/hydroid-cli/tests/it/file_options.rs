//! Options of `adapt` and `control` in a TOML file, and both levels of their help.

use std::fs;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{MODEL, done, run, simple_vessel, text};

const CIRCLE: &str =
    "[control]\ncontroller = \"fl\"\nspeed = 4\nradius = 30\nduration = \"30s\"\nevaluate_from = \"20s\"\n";

/// The JSON document without computing times.
fn document(bytes: &[u8]) -> Value {
    let mut document: Value = serde_json::from_slice(bytes).unwrap();
    for key in ["us_per_command", "us_per_sample"] {
        document.as_object_mut().unwrap().remove(key);
    }
    document
}

#[test]
fn control_reads_its_options_from_a_file() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    fs::write(at.join("circle.toml"), CIRCLE).unwrap();
    let options = "--controller fl --speed 4 --radius 30 --duration 30 --evaluate-from 20";
    let expected = document(&done(at, &format!("control hydrofoil {options} --json")).stdout);
    let from_file = done(at, "control hydrofoil -c circle.toml --json");
    assert_eq!(document(&from_file.stdout), expected);
    // The command line takes precedence.
    let faster = document(
        &done(at, &format!("control hydrofoil {options} --speed 3 --json").replace("--speed 4 ", "")).stdout,
    );
    let overridden = done(at, "control hydrofoil -c circle.toml --speed 3 --json");
    assert_eq!(document(&overridden.stdout), faster);
    assert_ne!(faster, expected);
    // `hydroid.toml` in the current folder is read by default; sections of other commands are ignored.
    fs::write(at.join("hydroid.toml"), format!("{CIRCLE}[identify]\nseed = 3\n[adapt]\nstream = true\n"))
        .unwrap();
    assert_eq!(document(&done(at, "control hydrofoil --json").stdout), expected);
}

#[test]
fn adapt_reads_its_options_from_a_file() {
    let at = simple_vessel();
    let section = "[adapt]\nlearner = \"kalman\"\nnoise = { u = 0.01, v = 0.01, r = 0.01, P_f = 1 }\nhorizon = 20\norigin_stride = 10\nno_guard = true\n";
    fs::write(at.join("kalman.toml"), section).unwrap();
    let options =
        "--learner kalman --noise u=0.01,v=0.01,r=0.01,P_f=1 --horizon 20 --origin-stride 10 --no-guard";
    let expected = run(at, &format!("adapt {MODEL} c.csv {options} --json"));
    let from_file = run(at, &format!("adapt {MODEL} c.csv -c kalman.toml --json"));
    assert_eq!(from_file.status.code(), expected.status.code(), "{}", text(&from_file.stderr));
    assert_eq!(document(&from_file.stdout), document(&expected.stdout));
    // Paths are relative to the file, and lists repeat an option.
    fs::create_dir_all(at.join("options")).unwrap();
    let section = "[adapt]\ntraining_log = [\"../a.csv\", \"../b.csv\"]\ntraining_time = 20\nhorizon = 20\norigin_stride = 50\n";
    fs::write(at.join("options/training.toml"), section).unwrap();
    let output = run(at, &format!("adapt {MODEL} c.csv -c options/training.toml -q"));
    assert!(matches!(output.status.code(), Some(0 | 1)), "{}", text(&output.stderr));
}

#[test]
fn mistakes_in_the_file_are_reported_with_their_place() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for (section, words) in [
        ("[control]\nradios = 3\n", "key radios: hydroid control has no option --radios"),
        ("[control]\nadapt = 1\n", "key adapt: write true or false"),
        ("[control]\nspeed = true\n", "key speed: the option takes a value"),
        ("[control]\nspeed = \"fast\"\n", "invalid value 'fast' for '--speed"),
        ("[control]\nrate-limits = [1, 2]\n", "key rate-limits: write rate_limits"),
        ("[control]\nspeed = \n", "line 2"),
        ("[controls]\nspeed = 2\n", "unknown key controls"),
        ("[boat.inputs.RD_cmd]\nlimit = [-20, 20]\n", "unknown key limit"),
    ] {
        fs::write(at.join("boat.toml"), section).unwrap();
        let output = run(at, "control hydrofoil --controller fl -c boat.toml --json");
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{section}: {message}");
        assert!(message.contains("boat.toml") && message.contains(words), "{section}: {message}");
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(document["error"].is_string());
    }
}

#[test]
fn the_short_help_has_about_twelve_options_and_the_advanced_help_all() {
    let folder = TempDir::new().unwrap();
    for verb in ["adapt", "control"] {
        let count = |level: &str| {
            let help = text(&done(folder.path(), &format!("{verb} {level}")).stdout);
            assert!(help.contains("Examples:"), "{help}");
            let option =
                |line: &&str| line.trim_start().starts_with('-') && !line.trim_start().starts_with("- ");
            help.lines().filter(option).count()
        };
        let (short, all) = (count("--help"), count("--help-advanced"));
        assert!((14..=20).contains(&short), "{verb}: {short}");
        assert!(all > short + 20, "{verb}: {all}");
    }
}
