//! `hydroid adapt` on a recurrent network trained at low speed and adapted while foiling.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Output, Stdio};
use std::sync::OnceLock;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{command, run, text};

/// A small network of low speed, and a log beyond its training range; computed once.
fn prepared() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let settings = "[network]\nhidden = 8\nepochs = 60\nfeedback = false\nlearning_rate = 0.01\n";
    let identify = "identify a.csv --validate b.csv --test c.csv --outputs u,v,r --methods gru -c net.toml --ranges u=0:6,v=-1.5:1.5,r=-1:1,PP_cmd=-130:350 -o out -q";
    FOLDER.get_or_init(|| crate::low_speed::folder(settings, identify)).path()
}

const MODEL: &str = "out/gru.safetensors";

fn report(args: &str) -> Value {
    let output = run(prepared(), args);
    assert_eq!(output.status.code(), Some(0), "{args}: {}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_network_adapts_to_foiling_and_is_written_with_its_history() {
    let report = report("adapt out/gru.safetensors lawn.csv -o adapted.safetensors --against truth --json");
    let mae = |part: &str, step: usize| report[part]["mae"][step - 1][0].as_f64().unwrap();
    for step in [1, 20, 100] {
        let frozen = mae("frozen", step).min(mae("frozen_filtered", step));
        assert!(mae("adapted", step) < 0.6 * frozen, "{step}: {} {frozen}", mae("adapted", step));
    }
    assert_eq!(report["settings"]["method"], "kalman");
    // The noise is that of the training log: 1 cm/s and 1 deg/s.
    for (noise, truth) in report["settings"]["noise"].as_array().unwrap().iter().zip([0.01, 0.01, 0.01745]) {
        assert!((noise.as_f64().unwrap() / truth - 1.0).abs() < 0.1, "{noise}");
    }
    let coverage = report["coverage"]["95"].as_f64().unwrap();
    assert!((0.85..=1.0).contains(&coverage), "{coverage}");
    let inspected = run(prepared(), "inspect adapted.safetensors --json");
    let inspected: Value = serde_json::from_slice(&inspected.stdout).unwrap();
    let adapted = &inspected["description"]["provenance"]["settings"]["adapted"][0];
    assert_eq!(adapted["runs"][0], "lawn.csv");
    assert_eq!(adapted["settings"], report["settings"]);
}

#[test]
fn the_table_has_frozen_filtered_and_adapted_columns() {
    let output = run(prepared(), "adapt out/gru.safetensors lawn.csv -q");
    let message = text(&output.stdout);
    let head: Vec<&str> = message.lines().next().unwrap().split_whitespace().collect();
    let columns = "horizon output RMSE frozen filtered adapted NRMSE frozen filtered adapted persistence";
    assert_eq!(head.join(" "), columns);
    // Time, output and unit, then a number in each column.
    assert_eq!(message.lines().nth(1).unwrap().split_whitespace().count(), 4 + 7, "{message}");
}

#[test]
fn a_guard_survives_faults_and_reports_its_events() {
    let args = "adapt out/gru.safetensors lawn.csv --json -q --horizon 20 --inject spikes=0.02,stuck=r:8s@60 --seed 3";
    let error = |report: &Value| {
        // Mean over outputs and horizons of the RMSE against the measurements before the faults.
        let rows: Vec<f64> = report["adapted"]["rmse"]
            .as_array()
            .unwrap()
            .iter()
            .map(|row| row[0].as_f64().unwrap())
            .collect();
        rows.iter().sum::<f64>() / rows.len() as f64
    };
    let guarded = report(args);
    let alone = run(prepared(), &format!("{args} --no-guard"));
    let alone: Value = serde_json::from_slice(&alone.stdout).unwrap();
    assert!(error(&guarded) < 0.7 * error(&alone), "{} beside {}", error(&guarded), error(&alone));
    let events = guarded["events"].as_array().unwrap();
    let count = |action: &str| events.iter().filter(|event| event["action"] == action).count();
    // One in fifty of 2400 samples of three outputs.
    assert!((70..250).contains(&count("spike")), "{}", count("spike"));
    let stuck = events.iter().find(|event| event["action"] == "stuck").unwrap();
    assert!((60.0..61.0).contains(&stuck["t"].as_f64().unwrap()), "{stuck}");
    assert!(stuck["text"].as_str().unwrap().starts_with("r has repeated its value"), "{stuck}");
    assert_eq!(alone["events"].as_array().unwrap().len(), 0);
    let by = &guarded["guard"]["predicted_by"];
    assert!(by[0].as_u64().unwrap() > 1000, "{by}");
}

#[test]
fn the_filter_runs_over_the_training_logs_first() {
    let plain = report("adapt out/gru.safetensors lawn.csv --json -q");
    let shore =
        report("adapt out/gru.safetensors lawn.csv --json -q --training-log a.csv --training-time 100s");
    assert_ne!(plain["adapted"]["rmse"], shore["adapted"]["rmse"]);
    assert_eq!(plain["frozen"]["rmse"], shore["frozen"]["rmse"]);
    assert!(shore["adapted"]["rmse"][19][0].as_f64() < shore["frozen"]["rmse"][19][0].as_f64());
}

/// Weights adapted while foiling keep their accuracy at low speed through rehearsal.
#[test]
fn training_logs_are_rehearsed() {
    let error = |option: &str, output: &str| {
        let options = format!("--training-log a.csv --training-time 20s --no-guard {option}");
        let adapted = report(&format!("adapt out/gru.safetensors lawn.csv --json -q {options} -o {output}"));
        let judged = run(prepared(), &format!("evaluate {output} a.csv --json -q"));
        let judged: Value = serde_json::from_slice(&judged.stdout).unwrap();
        (adapted, judged["rmse"][19][0].as_f64().unwrap())
    };
    let (with, known) = error("--black-box rehearsed.box", "rehearsed.safetensors");
    let (without, forgotten) = error("--no-rehearsal", "forgot.safetensors");
    assert!(with["settings"]["rehearsal"]["windows"].as_u64().unwrap() > 0, "{}", with["settings"]);
    assert!(without["settings"]["rehearsal"].is_null(), "{}", without["settings"]);
    assert!(known < 0.6 * forgotten, "{known} beside {forgotten}");
    // The saved state contains the rehearsal windows; the log is not needed again.
    let replayed = run(prepared(), "adapt out/gru.safetensors --replay rehearsed.box");
    assert_eq!(replayed.status.code(), Some(0), "{}", text(&replayed.stderr));
}

#[test]
fn every_reduced_covariance_adapts() {
    let frozen = report("adapt out/gru.safetensors lawn.csv --json -q");
    let frozen = frozen["frozen"]["rmse"][0][0].as_f64().unwrap();
    for option in ["--covariance blocks:1", "--covariance blocks:7", "--huber 3 --leak 600 --forgetting 300"]
    {
        let report = report(&format!("adapt out/gru.safetensors lawn.csv --json -q {option}"));
        let adapted = report["adapted"]["rmse"][0][0].as_f64().unwrap();
        assert!(adapted < 0.5 * frozen, "{option}: {adapted} {frozen}");
    }
}

#[test]
fn invalid_input_is_refused() {
    for (options, words) in [
        ("--noise u=0.01", "'v' is missing"),
        ("--noise u=0.01,v=0.01,r=0.02,w=1", "no output 'w'"),
        ("--noise u=0,v=0.01,r=0.02", "standard deviation of 0"),
        ("--noise u", "NAME=VALUE"),
        ("--covariance blocks:0", "blocks:7"),
        ("--covariance much", "blocks:7"),
        ("--weight-variance=-1", "initial variance"),
        ("--prior 3", "recursive least squares"),
        ("--forgetting 0", "forgetting"),
        ("--inject leak=u:3", "is not a fault"),
        ("--inject bias=w:1", "the outputs are u, v, r"),
        ("--stream --inject spikes=0.1", "cannot be used with a live stream"),
        ("--training-log nowhere.csv", "nowhere.csv"),
        ("--no-rehearsal", "--training-log"),
    ] {
        let output = run(prepared(), &format!("adapt {MODEL} lawn.csv {options}"));
        assert_eq!(output.status.code(), Some(2), "{options}");
        let message = text(&output.stderr);
        assert!(message.contains(words) && !message.contains("panicked"), "{options}: {message}");
    }
}

/// After a kill, answers and model are those of an uninterrupted service.
#[test]
fn a_killed_service_resumes_to_the_same_model() {
    let at = prepared();
    let options = "--stream --horizons 1,20 -q";
    let whole = run(at, &format!("adapt {MODEL} lawn.csv {options} -o whole.safetensors"));
    assert_eq!(whole.status.code(), Some(0), "{}", text(&whole.stderr));
    let whole = text(&whole.stdout);
    let log = fs::read_to_string(at.join("lawn.csv")).unwrap();

    let mut child = command(at, &format!("adapt {MODEL} - --horizons 1,20 -q --state kept.state"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let mut answers = BufReader::new(child.stdout.take().unwrap()).lines();
    for (k, line) in log.lines().take(1208).enumerate() {
        writeln!(stdin, "{line}").unwrap();
        if k > 0 {
            let answer: Value = serde_json::from_str(&answers.next().unwrap().unwrap()).unwrap();
            assert!(answer["status"] == "accepted" || k == 1, "{answer}");
            assert!(k < 2 || answer["band_95"]["u"][1].as_f64().unwrap() > 0.0, "{answer}");
        }
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let rest =
        run(at, &format!("adapt {MODEL} lawn.csv {options} --state kept.state -o resumed.safetensors"));
    assert_eq!(rest.status.code(), Some(0), "{}", text(&rest.stderr));
    let rest = text(&rest.stdout);
    let whole: Vec<&str> = whole.lines().collect();
    let is_repeated = |line: &&str| line.contains("\"status\":\"repeated\"");
    let (repeated, rest): (Vec<&str>, Vec<&str>) = rest.lines().partition(is_repeated);
    assert_eq!(repeated.len() + rest.len(), whole.len(), "each line has an answer");
    assert!(rest.len() > whole.len() - 1208, "{} of {}", rest.len(), whole.len());
    assert_eq!(rest, whole[whole.len() - rest.len()..]);
    let model = |name: &str| fs::read(at.join(name)).unwrap();
    assert_eq!(model("whole.safetensors"), model("resumed.safetensors"));
}

/// The recording of a network is replayed bit for bit with every form of the covariance.
#[test]
fn a_network_is_replayed_from_its_black_box() {
    let at = prepared();
    for (k, options) in ["", " --covariance blocks:2 --huber 3"].into_iter().enumerate() {
        let file = format!("gru{k}.box");
        let serve = format!(
            "adapt {MODEL} lawn.csv --stream --horizons 20 -q --black-box {file} --black-box-minutes 2{options}"
        );
        let answers = run(at, &serve);
        assert_eq!(answers.status.code(), Some(0), "{serve}: {}", text(&answers.stderr));
        let replayed = run(at, &format!("adapt {MODEL} --replay {file} --json"));
        assert_eq!(replayed.status.code(), Some(0), "{options}: {}", text(&replayed.stderr));
        // The last recorded sample is the last one of the stream.
        let last = |output: &Output| -> Value {
            serde_json::from_str(text(&output.stdout).lines().last().unwrap()).unwrap()
        };
        let (step, answer) = (last(&replayed), last(&answers));
        assert_eq!(step["t"], answer["t"]);
        assert_eq!(step["estimate"], answer["estimate"]);
        assert_eq!(step["prediction"]["u"][1], answer["prediction"]["u"][0]);
        assert!(step["health"]["min_s_over_r"].as_f64().unwrap() >= 1.0 - 1e-6, "{step}");
    }
}
