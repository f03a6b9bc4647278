//! `hydroid adapt` from end to end.

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;

use crate::common::{MODEL, simple_vessel, text};

fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::cargo_bin("hydroid").unwrap();
    command.current_dir(folder).args(args);
    command
}

fn hydroid(folder: &Path, args: &[&str]) -> Output {
    command(folder, args).output().unwrap()
}

#[test]
fn an_adapted_model_is_written_with_its_history() {
    let at = simple_vessel();
    let output = hydroid(at, &["adapt", MODEL, "c.csv", "-o", "least_squares.safetensors", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(report["frozen_filtered"].is_null());
    let nrmse = |part: &str| report[part]["nrmse"][99][0].as_f64().unwrap();
    assert!(nrmse("adapted") < 0.7 * nrmse("frozen"), "{} {}", nrmse("adapted"), nrmse("frozen"));
    assert_eq!(report["adapted"]["horizons"].as_array().unwrap().len(), 100);
    for key in ["accepted", "inflated", "rejected", "rolled_back"] {
        assert!(report["guard"][key].is_u64(), "{key}");
    }
    for key in ["median", "p99", "max"] {
        assert!(report["us_per_sample"][key].as_f64().unwrap() > 0.0, "{key}");
    }
    for key in ["80", "95"] {
        assert!((0.0..=1.0).contains(&report["coverage"][key].as_f64().unwrap()), "{key}");
    }
    // `frozen` equals the output of `evaluate`, apart from the coverage of the bands.
    let evaluated = hydroid(at, &["evaluate", MODEL, "c.csv", "--json"]);
    let mut evaluated: Value = serde_json::from_slice(&evaluated.stdout).unwrap();
    for key in ["band_coverage", "prediction_bands"] {
        assert!(evaluated.as_object_mut().unwrap().remove(key).is_some(), "{key}");
    }
    assert!(evaluated == report["frozen"], "the frozen model is the model");

    let inspected = hydroid(at, &["inspect", "least_squares.safetensors", "--json"]);
    let model: Value = serde_json::from_slice(&inspected.stdout).unwrap();
    let provenance = &model["description"]["provenance"];
    assert_eq!(provenance["training"][0], "a.csv");
    assert_eq!(provenance["settings"]["adapted"][0]["runs"][0], "c.csv");
    assert_eq!(provenance["settings"]["adapted"][0]["settings"], report["settings"]);

    let told = hydroid(at, &["adapt", MODEL, "c.csv", "--horizon", "5s", "--forgetting", "inf"]);
    assert_eq!(told.status.code(), Some(0), "{}", text(&told.stderr));
    let table = text(&told.stdout);
    for words in
        ["RMSE frozen", "adapted", "persistence", "used for learning", "80 % band", "time per sample"]
    {
        assert!(table.contains(words), "{words}: {table}");
    }
}

#[test]
fn equations_adapt_by_the_kalman_filter() {
    let at = simple_vessel();
    let args = ["adapt", MODEL, "c.csv", "--learner", "kalman", "-o", "kalman.safetensors", "--json"];
    let output = hydroid(at, &args);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["settings"]["method"], "kalman");
    let nrmse = |part: &str| report[part]["nrmse"][99][0].as_f64().unwrap();
    for part in ["frozen", "frozen_filtered"] {
        assert!(nrmse("adapted") < 0.7 * nrmse(part), "{part}: {} {}", nrmse("adapted"), nrmse(part));
    }
    let inspected = hydroid(at, &["inspect", "kalman.safetensors", "--json"]);
    let model: Value = serde_json::from_slice(&inspected.stdout).unwrap();
    assert_eq!(model["description"]["provenance"]["settings"]["adapted"][0]["settings"], report["settings"]);
    // The adapted model is better on the log.
    let judged = |model: &str| {
        let output = hydroid(at, &["evaluate", model, "c.csv", "--json"]);
        let judged: Value = serde_json::from_slice(&output.stdout).unwrap();
        judged["nrmse"][99][0].as_f64().unwrap()
    };
    assert!(judged("kalman.safetensors") < 0.7 * judged(MODEL));
    // A stream accepts the options of the filter.
    let args = ["adapt", MODEL, "c.csv", "--learner", "kalman", "--weight-variance", "0.02", "--json"];
    let noise = ["--noise", "u=0.01,v=0.01,r=0.01,P_f=1", "--covariance", "blocks:3"];
    let output = hydroid(at, &[&args[..], &noise].concat());
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["settings"]["weight_variance"], 0.02);
    assert_eq!(report["settings"]["covariance"], "blocks:3");
    assert_eq!(report["settings"]["noise"][0], 0.01);
    let output = hydroid(at, &["adapt", MODEL, "c.csv", "--stream", "--learner", "kalman"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let answers = text(&output.stdout);
    let last: Value = serde_json::from_str(answers.lines().last().unwrap()).unwrap();
    assert_eq!(last["status"], "accepted", "{last}");
}

#[test]
fn a_worse_adapted_model_has_exit_status_one() {
    let at = simple_vessel();
    // On the original vessel with short memory, the adapted model is slightly worse.
    let args =
        ["adapt", MODEL, "b.csv", "--forgetting", "0.2", "--prior", "0.01", "--window", "0.1", "--no-gate"];
    let output = hydroid(at, &args);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stdout));
}

#[test]
fn wrong_input_is_refused_with_a_remedy() {
    let at = simple_vessel();
    let refused = |args: &[&str], words: &str| {
        let output = hydroid(at, args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(text(&output.stderr).contains(words), "{args:?}: {}", text(&output.stderr));
    };
    refused(&["adapt", MODEL, "none.csv"], "none.csv");
    refused(&["adapt", "c.csv", "c.csv"], "is not a hydroid model");
    refused(&["adapt", MODEL, "c.csv", "--window", "0"], "window");
    refused(&["adapt", MODEL, "c.csv", "--window", "900"], "shorter than the longest run");
    refused(&["adapt", MODEL, "c.csv", "--forgetting", "-5"], "forgetting time");
    refused(&["adapt", MODEL, "c.csv", "--prior", "0"], "prior");
    refused(&["adapt", MODEL, "c.csv", "--outputs", "u,v,r"], "outputs");
    refused(&["adapt", MODEL, "c.csv", "--weight-variance", "1"], "equations with --learner kalman");
    let kalman = |rest: [&'static str; 2]| {
        [["adapt", MODEL, "c.csv", "--learner", "kalman"].as_slice(), &rest].concat()
    };
    refused(&kalman(["--prior", "5"]), "--prior is an option of recursive least squares");
    refused(&kalman(["--huber", "0"]), "Huber's loss");
    refused(&kalman(["--noise", "u=0.1"]), "'v' is missing");
    let empty = command(at, &["adapt", MODEL, "-"]).write_stdin("").output().unwrap();
    assert_eq!(empty.status.code(), Some(2));
    assert!(text(&empty.stderr).contains("standard input"), "{}", text(&empty.stderr));
}
