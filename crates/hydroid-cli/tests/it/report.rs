//! `hydroid report`: the page of a model, with and without logs, and with the driving view.

use std::fs;
use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn hydroid(folder: &Path, args: &[&str]) -> Output {
    Command::cargo_bin("hydroid").unwrap().current_dir(folder).args(args).output().unwrap()
}

fn done(folder: &Path, args: &[&str]) -> Output {
    let output = hydroid(folder, args);
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

fn refused(folder: &Path, args: &[&str], words: &str) {
    let output = hydroid(folder, args);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{args:?}: {error}");
    assert!(error.contains(words), "{args:?}: {error}");
}

fn page(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap()
}

/// The document of the driving view in a page.
fn document(page: &str) -> Value {
    let (_, rest) = page.split_once("<script id=\"vessel\" type=\"application/json\">").unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn a_vessel_has_a_page_on_which_it_is_driven() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    done(folder, &["report", "simple", "-o", "still.html"]);
    let still = page(folder, "still.html");
    assert!(
        still.contains("Turning circle") && still.contains("Zigzag") && !still.contains("id=\"driving\"")
    );
    done(folder, &["report", "simple", "--length", "2", "--interactive"]);
    let driven = page(folder, "report.html");
    assert!(driven.contains("criteria") || driven.contains("Limits for a length"));
    let document = document(&driven);
    let vessel = &document["vessel"];
    assert_eq!(vessel["motion"], serde_json::json!([0, 1, 2]));
    assert_eq!(vessel["map"]["push"].as_array().unwrap().len(), 2);
    assert!(vessel["functions"]["functions"].as_array().unwrap().len() > 3);
    let trial = &document["trials"][0];
    let advance = trial["figures"].as_array().unwrap().iter().find(|one| one["label"] == "advance").unwrap();
    assert!((advance["value"].as_f64().unwrap() - 6.4626).abs() < 1e-3);
    assert_eq!(advance["unit"], "m");
    assert!(trial["track"].as_array().unwrap().len() > 50);
    assert!(!driven.contains("src=\"http") && !driven.contains("href=\"http"), "the page loads nothing");
}

#[test]
fn logs_add_errors_and_their_trials() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    for (seed, name) in [("1", "a.csv"), ("2", "b.csv"), ("3", "c.csv")] {
        done(folder, &["simulate", "simple", "--duration", "300", "--seed", seed, "-o", name]);
    }
    done(folder, &["identify", "a.csv", "b.csv", "--methods", "sindy", "-o", "out", "-q"]);
    let model = "out/sindy.safetensors";
    let output = done(folder, &["report", model, "c.csv", "--horizon", "5s", "-o", "c.html", "--json"]);
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["report"], "c.html");
    assert!(summary["evaluation"]["windows"].as_u64().unwrap() > 100);
    assert!(summary["trials"]["trials"].as_array().unwrap().len() > 5);
    let written = page(folder, "c.html");
    assert!(written.contains("Errors on logs") && written.contains("Turning circle"));
    let evaluated = done(folder, &["evaluate", model, "c.csv", "--horizon", "5s", "--json"]);
    let evaluated: Value = serde_json::from_slice(&evaluated.stdout).unwrap();
    assert_eq!(summary["evaluation"]["nrmse"], evaluated["nrmse"], "as `hydroid evaluate`");
    refused(folder, &["report", model, "-o", model], "reads this file");
    refused(folder, &["report", model, "--push", "nothing"], "no input 'nothing'");
    refused(folder, &["report", "c.csv"], "not a hydroid model");
    refused(folder, &["report", model, "missing.csv"], "missing.csv");
}
