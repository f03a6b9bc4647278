//! Wrong input: exit status 2, a message with the cause, and no partial output.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use tempfile::TempDir;

fn hydroid(folder: &Path, args: &[&str]) -> Output {
    Command::cargo_bin("hydroid").unwrap().current_dir(folder).args(args).output().unwrap()
}

/// Runs, expects status 2 with all of `words` in the message, and no panic.
fn refused(folder: &Path, args: &[&str], words: &[&str]) {
    let output = hydroid(folder, args);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
    assert!(message.starts_with("error: ") || message.contains("\nerror: "), "{args:?}: {message}");
    assert!(!message.contains("panicked"), "{args:?}: {message}");
    for word in words {
        assert!(message.contains(word), "{args:?}: '{word}' is not in: {message}");
    }
    assert!(output.stdout.is_empty(), "{args:?}: wrote to standard output");
}

/// A valid log with two outputs and two inputs.
fn good(rows: usize) -> Vec<String> {
    let mut lines = vec![String::from("t [s],u [m/s],r [rad/s],n_cmd [rps],d_cmd [rad]")];
    let (mut u, mut r) = (0.0, 0.0);
    for k in 0..rows {
        let n = (k as f64 * 0.05).sin() + 0.3 * (k as f64 * 0.171).cos();
        let d = 0.4 * (k as f64 * 0.083).sin();
        lines.push(format!("{:.1},{u:.6},{r:.6},{n:.6},{d:.6}", k as f64 * 0.1));
        u += 0.1 * (-0.4 * u + 0.8 * n);
        r += 0.1 * (-0.9 * r + 0.5 * d);
    }
    lines
}

fn write(folder: &TempDir, name: &str, lines: &[String]) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, lines.join("\n") + "\n").unwrap();
    path
}

/// A valid log with one line replaced; line numbers start at 1.
fn with_line(folder: &TempDir, line: usize, text: &str) {
    let mut lines = good(400);
    text.clone_into(&mut lines[line - 1]);
    write(folder, "bad.csv", &lines);
}

const IDENTIFY: &[&str] =
    &["identify", "bad.csv", "-o", "out", "--outputs", "u,r", "--inputs", "n_cmd,d_cmd"];

#[test]
fn the_valid_log_passes() {
    let folder = TempDir::new().unwrap();
    write(&folder, "bad.csv", &good(400));
    let output = hydroid(folder.path(), &[IDENTIFY, &["--horizon", "20"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    for file in ["sindy.safetensors", "report.html", "identify.json"] {
        assert!(folder.path().join("out").join(file).exists(), "{file}");
    }
}

#[test]
fn files_that_are_no_logs() {
    let folder = TempDir::new().unwrap();
    refused(folder.path(), &["inspect", "nowhere.csv"], &["nowhere.csv"]);
    refused(folder.path(), &["identify", "nowhere.csv", "-o", "out"], &["nowhere.csv"]);
    write(&folder, "empty.csv", &[]);
    fs::write(folder.path().join("empty.csv"), "").unwrap();
    refused(folder.path(), &["inspect", "empty.csv"], &["empty.csv", "empty"]);
    write(&folder, "headless.csv", &good(400)[1..]);
    refused(folder.path(), &["inspect", "headless.csv"], &["headless.csv", "names the columns"]);
    write(&folder, "one.csv", &good(1));
    refused(folder.path(), &["identify", "one.csv", "--outputs", "u", "-o", "out"], &["one.csv", "1"]);
    assert!(!folder.path().join("out").join("sindy.safetensors").exists());
}

#[test]
fn columns_that_do_not_exist() {
    let folder = TempDir::new().unwrap();
    write(&folder, "bad.csv", &good(400));
    let args = ["identify", "bad.csv", "-o", "out", "--outputs", "u,rr", "--inputs", "n_cmd"];
    refused(folder.path(), &args, &["rr", "bad.csv", "n_cmd"]);
    let args = ["identify", "bad.csv", "-o", "out", "--outputs", "u", "--inputs", "n_cdm"];
    refused(folder.path(), &args, &["n_cdm", "n_cmd"]);
}

#[test]
fn different_columns_in_two_files() {
    let folder = TempDir::new().unwrap();
    write(&folder, "bad.csv", &good(400));
    let other: Vec<String> = good(400).iter().map(|line| line.replace("d_cmd", "delta")).collect();
    write(&folder, "other.csv", &other);
    let args =
        ["identify", "bad.csv", "other.csv", "-o", "out", "--outputs", "u,r", "--inputs", "n_cmd,d_cmd"];
    refused(folder.path(), &args, &["bad.csv", "other.csv", "d_cmd"]);
}

#[test]
fn cells_that_cannot_be_right() {
    let folder = TempDir::new().unwrap();
    with_line(&folder, 50, "4.8,fast,0.1,0.2,0.1");
    refused(folder.path(), IDENTIFY, &["bad.csv", "line 50", "`u`", "fast"]);
    with_line(&folder, 60, "5.8,1000000000,0.1,0.2,0.1");
    refused(folder.path(), IDENTIFY, &["bad.csv", "line 60", "`u`"]);
    with_line(&folder, 61, "5.8,0.1,0.1,0.2,0.1");
    refused(folder.path(), IDENTIFY, &["bad.csv", "line 61", "5.8"]);
    with_line(&folder, 62, "0.3,0.1,0.1,0.2,0.1");
    refused(folder.path(), IDENTIFY, &["bad.csv", "line 62"]);
    with_line(&folder, 63, "6.1,0.1,0.1");
    refused(folder.path(), IDENTIFY, &["bad.csv", "line 63"]);
    with_line(&folder, 64, "6.2,inf,0.1,0.2,0.1");
    refused(folder.path(), IDENTIFY, &["bad.csv", "line 64", "`u`"]);
}

#[test]
fn two_equal_time_stamps_and_time_running_backwards_have_messages_of_their_own() {
    let folder = TempDir::new().unwrap();
    with_line(&folder, 61, "5.8,0.1,0.1,0.2,0.1");
    let twice = String::from_utf8(hydroid(folder.path(), IDENTIFY).stderr).unwrap();
    with_line(&folder, 61, "0.3,0.1,0.1,0.2,0.1");
    let back = String::from_utf8(hydroid(folder.path(), IDENTIFY).stderr).unwrap();
    assert_ne!(twice, back);
    assert!(back.contains("backwards"), "{back}");
}

#[test]
fn one_missing_value_is_no_error_and_all_missing_is() {
    let folder = TempDir::new().unwrap();
    with_line(&folder, 50, "4.8,NaN,0.1,0.2,0.1");
    let output = hydroid(folder.path(), &[IDENTIFY, &["--horizon", "20"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let mut lines = good(400);
    for line in &mut lines[1..] {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[1] = "NaN";
        *line = cells.join(",");
    }
    write(&folder, "bad.csv", &lines);
    refused(folder.path(), IDENTIFY, &["bad.csv", "`u`"]);
}

#[test]
fn a_constant_output_has_no_equation() {
    let folder = TempDir::new().unwrap();
    let mut lines = good(400);
    for line in &mut lines[1..] {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[1] = "1.5";
        *line = cells.join(",");
    }
    write(&folder, "bad.csv", &lines);
    refused(folder.path(), &[IDENTIFY, &["--horizon", "20"]].concat(), &["'u'", "vary"]);
    // A single constant command gives only a warning.
    let mut lines = good(400);
    for line in &mut lines[1..] {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[4] = "0.1";
        *line = cells.join(",");
    }
    write(&folder, "bad.csv", &lines);
    let output = hydroid(folder.path(), &[IDENTIFY, &["--horizon", "20"]].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(matches!(output.status.code(), Some(0 | 1)), "{message}");
    assert!(message.contains("d_cmd"), "{message}");
}

#[test]
fn configuration_files_with_mistakes() {
    let folder = TempDir::new().unwrap();
    write(&folder, "bad.csv", &good(400));
    let config = folder.path().join("hydroid.toml");
    let args = ["identify", "bad.csv", "-c", "hydroid.toml", "-o", "out"];
    fs::write(&config, "[log]\noutputs = [\"u\"]\n\n[sindy]\ndegre = 2\n").unwrap();
    refused(folder.path(), &args, &["hydroid.toml", "line 5", "degre", "degree"]);
    fs::write(&config, "[log\n").unwrap();
    refused(folder.path(), &args, &["hydroid.toml", "line 1"]);
    fs::write(&config, "[identify]\nhorizon = \"long\"\n").unwrap();
    refused(folder.path(), &args, &["hydroid.toml", "line 2"]);
    fs::remove_file(&config).unwrap();
    refused(folder.path(), &args, &["hydroid.toml"]);
}

#[test]
fn invalid_settings() {
    let folder = TempDir::new().unwrap();
    write(&folder, "bad.csv", &good(400));
    for (option, words) in [
        ("--horizon=0", ["horizon", "at least 1"]),
        ("--origin-stride=0", ["origin stride", "at least 1"]),
        ("--ridge=nan", ["ridge", "NaN"]),
        ("--threshold=-1", ["threshold", "-1"]),
        ("--window=0", ["window", "positive"]),
        ("--horizon=100000", ["left-out runs", "100000"]),
        ("--dt=-1", ["step", "positive"]),
    ] {
        refused(folder.path(), &[IDENTIFY, &[option]].concat(), &words);
    }
    let longest = [IDENTIFY, &["--window=1000", "--horizon=20"]].concat();
    refused(folder.path(), &longest, &["regression rows", "too few"]);
    // Too large libraries are refused early, whatever the number of terms.
    let many: Vec<String> = (0..30).map(|i| format!("c{i}_cmd")).collect();
    let mut lines = vec![format!("t,u,{}", many.join(","))];
    for k in 0..800u32 {
        let cells: Vec<String> = (0..31).map(|i| (0.1 * f64::from(k * (i + 3))).sin().to_string()).collect();
        lines.push(format!("{:.1},{}", 0.1 * f64::from(k), cells.join(",")));
    }
    write(&folder, "wide.csv", &lines);
    refused(folder.path(), &["identify", "wide.csv", "--degree", "6", "-o", "out"], &["terms", "degree"]);
}

#[test]
fn an_output_folder_that_cannot_be_written() {
    let folder = TempDir::new().unwrap();
    write(&folder, "bad.csv", &good(400));
    fs::write(folder.path().join("file"), "in the way").unwrap();
    let args = ["identify", "bad.csv", "-o", "file/out", "--outputs", "u", "--inputs", "n_cmd"];
    refused(folder.path(), &args, &["file"]);
    refused(folder.path(), &["simulate", "simple", "--duration", "10", "-o", "file/run.csv"], &["file"]);
    let args = ["identify", "bad.csv", "-o", "file", "--outputs", "u", "--inputs", "n_cmd"];
    refused(folder.path(), &args, &["it is a file"]);
    assert_eq!(fs::read_to_string(folder.path().join("file")).unwrap(), "in the way");
    // A failed run removes the folder that it created.
    refused(folder.path(), &["identify", "nowhere.csv", "-o", "new"], &["nowhere.csv"]);
    assert!(!folder.path().join("new").exists());
}

#[test]
fn files_that_are_no_models() {
    let folder = TempDir::new().unwrap();
    write(&folder, "bad.csv", &good(400));
    let output = hydroid(folder.path(), &[IDENTIFY, &["--horizon", "20"]].concat());
    assert_eq!(output.status.code(), Some(0));
    let model = fs::read(folder.path().join("out/sindy.safetensors")).unwrap();
    fs::write(folder.path().join("cut.safetensors"), &model[..model.len() / 2]).unwrap();
    fs::write(folder.path().join("text.safetensors"), "t,u\n0,1\n").unwrap();
    refused(folder.path(), &["evaluate", "nowhere.safetensors", "bad.csv"], &["nowhere.safetensors"]);
    refused(folder.path(), &["evaluate", "cut.safetensors", "bad.csv"], &["cut.safetensors", "cut short"]);
    refused(folder.path(), &["inspect", "cut.safetensors"], &["cut.safetensors"]);
    refused(folder.path(), &["inspect", "bad.csv", "--latex"], &["bad.csv is a log", "--latex"]);
    let both = ["inspect", "out/sindy.safetensors", "--latex", "--json"];
    let output = hydroid(folder.path(), &both);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stdout).unwrap().contains("exclude each other"));
    refused(folder.path(), &["evaluate", "text.safetensors", "bad.csv"], &["not a hydroid model"]);
    refused(folder.path(), &["evaluate", "bad.csv", "bad.csv"], &["bad.csv", "not a hydroid model"]);
    // A valid model on a log that is shorter than the horizon and has no truth.
    let good = "out/sindy.safetensors";
    refused(folder.path(), &["evaluate", good, "bad.csv", "--horizon", "100000"], &["horizon", "100000"]);
    refused(
        folder.path(),
        &["evaluate", good, "bad.csv", "--against", "truth"],
        &["true outputs", "bad.csv"],
    );
}

#[test]
fn plants_and_excitations_that_do_not_exist() {
    let folder = TempDir::new().unwrap();
    refused(folder.path(), &["simulate", "submarine"], &["submarine", "hydrofoil"]);
    refused(folder.path(), &["simulate", "simple", "--excitation", "wild"], &["wild", "lawn-mower"]);
    refused(folder.path(), &["simulate", "mine.toml"], &["mine.toml"]);
    refused(folder.path(), &["simulate", "simple", "--dt", "0.015"], &["0.015"]);
    refused(folder.path(), &["simulate", "simple", "--duration", "-5"], &["duration", "-5"]);
    refused(folder.path(), &["simulate", "simple", "--radius", "5"], &["--radius", "circle", "mixed"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// A horizon beyond all runs is refused early.
#[test]
fn absurd_horizons() {
    let folder = TempDir::new().unwrap();
    write(&folder, "bad.csv", &good(400));
    for horizon in ["10000000000", "1e300s", "80"] {
        // A sixth of the log is left out in a cross-validation, else a fifth is the test.
        for (methods, most) in [("sindy", 66), ("gru", 79), ("lagged,recursive,lstm", 79)] {
            let rest = ["--methods", methods, "--horizon", horizon];
            let most = format!("at most {most} samples");
            refused(folder.path(), &[IDENTIFY, &rest].concat(), &["horizon", &most]);
        }
    }
}

/// Samples that occur in two parts of the split would invalidate the evaluation.
#[test]
fn logs_in_two_parts_of_the_split() {
    let folder = TempDir::new().unwrap();
    write(&folder, "bad.csv", &good(400));
    write(&folder, "copy.csv", &good(400));
    let words = ["share measurements", "bad.csv"];
    for rest in [&["--test", "bad.csv"][..], &["--validate", "bad.csv", "--test", "copy.csv"]] {
        refused(folder.path(), &[IDENTIFY, &["--horizon", "20"], rest].concat(), &words);
    }
    let thrice = ["identify", "bad.csv", "copy.csv", "bad.csv", "-o", "out", "--outputs", "u,r"];
    refused(folder.path(), &[&thrice[..], &["--inputs", "n_cmd,d_cmd"]].concat(), &["share measurements"]);
}

#[test]
fn options_for_a_log_without_a_log() {
    let folder = TempDir::new().unwrap();
    refused(folder.path(), &["identify", "-o", "out", "--inputs", "n_cmd"], &["no log"]);
    refused(folder.path(), &["identify", "-o", "out", "--test", "a.csv"], &["training logs are missing"]);
    let both = hydroid(folder.path(), &["simulate", "simple", "--duration", "5", "-o", "-", "--json"]);
    assert_eq!(both.status.code(), Some(2));
    let document: serde_json::Value = serde_json::from_slice(&both.stdout).unwrap();
    assert!(document["error"].as_str().unwrap().contains("standard output"));
    refused(folder.path(), &["simulate", "simple", "--duration", "1e9"], &["duration", "samples"]);
    let slip = ["simulate", "simple", "--excitation", "lawn-mower", "--leg", "1e-7"];
    refused(folder.path(), &slip, &["leg", "too short"]);
}

#[test]
fn error_causes_are_printed_once() {
    let folder = TempDir::new().unwrap();
    let output = hydroid(folder.path(), &["inspect", "nowhere.safetensors"]);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(message.matches("No such file").count(), 1, "{message}");
}

#[test]
fn with_json_an_error_is_a_json_document() {
    let folder = TempDir::new().unwrap();
    let output = hydroid(folder.path(), &["inspect", "nowhere.csv", "--json"]);
    assert_eq!(output.status.code(), Some(2));
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(document["error"].as_str().unwrap().contains("nowhere.csv"));
}

/// A boat on a winding path with its pose, whose yaw rate is in deg/s without a stated unit.
fn winding(rows: usize) -> Vec<String> {
    let mut lines = vec![String::from("t [s],u [m/s],r,n_cmd,d_cmd,x [m],y [m],psi [rad]")];
    let (mut u, mut r, mut x, mut y, mut psi) = (1.0, 0.0, 0.0, 0.0, 0.2_f64);
    for k in 0..rows {
        let n = 1.0 + 0.5 * (k as f64 * 0.05).sin() + 0.3 * (k as f64 * 0.171).cos();
        let d = 0.4 * (k as f64 * 0.03).sin();
        let rate = f64::to_degrees(r);
        lines.push(format!("{:.1},{u:.6},{rate:.6},{n:.6},{d:.6},{x:.4},{y:.4},{psi:.6}", k as f64 * 0.1));
        x += 0.1 * u * psi.cos();
        y += 0.1 * u * psi.sin();
        psi += 0.1 * r;
        u += 0.1 * (-0.4 * u + 0.8 * n);
        r += 0.1 * (-0.9 * r + 0.5 * d);
    }
    lines
}

#[test]
fn a_yaw_rate_that_contradicts_the_heading_is_warned_of_by_inspect_and_identify() {
    let folder = TempDir::new().unwrap();
    write(&folder, "bad.csv", &winding(900));
    let inspected = hydroid(folder.path(), &["inspect", "bad.csv"]);
    let identified = hydroid(folder.path(), &[IDENTIFY, &["--methods", "sindy"]].concat());
    for output in [inspected, identified] {
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() < Some(2), "{message}");
        let warning = "warning: bad.csv: `r` contradicts the pose: as read it is 57.3 times the rate of change of `psi`; its unit seems to be deg/s";
        assert!(message.contains(warning), "{message}");
        assert!(message.contains("--outputs \"u,r [deg/s]\""), "{message}");
    }
}

#[test]
fn an_offset_in_the_inputs_is_stored_in_the_model_and_applied_to_further_logs() {
    let folder = TempDir::new().unwrap();
    write(&folder, "bad.csv", &good(900));
    let shifted: Vec<String> = good(900)
        .iter()
        .map(|line| {
            let mut cells: Vec<String> = line.split(',').map(String::from).collect();
            cells[3] = cells[3].parse::<f64>().map_or("pwm".to_owned(), |n| (1500.0 + 400.0 * n).to_string());
            cells.join(",")
        })
        .collect();
    write(&folder, "pwm.csv", &shifted);
    let errors = |log: &str, inputs: &str, out: &str| {
        let args = ["identify", log, "-o", out, "--outputs", "u,r", "--inputs", inputs, "--methods", "sindy"];
        let output = hydroid(folder.path(), &args);
        assert!(output.status.code() < Some(2), "{}", String::from_utf8_lossy(&output.stderr));
        let model = format!("{out}/sindy.safetensors");
        let output = hydroid(folder.path(), &["evaluate", &model, log, "--json"]);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let document: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        document["rmse"].as_array().unwrap().last().unwrap()[0].as_f64().unwrap()
    };
    let plain = errors("bad.csv", "n_cmd,d_cmd", "plain");
    let offset = errors("pwm.csv", "n_cmd=(pwm - 1500) / 400,d_cmd", "offset");
    assert!((plain - offset).abs() <= 1e-3 * plain.max(1e-3), "{plain} {offset}");
}
