//! `hydroid manoeuvre`: trials of vessels and identified models, and trials in logs.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn hydroid(folder: &Path, args: &[&str]) -> Output {
    Command::cargo_bin("hydroid").unwrap().current_dir(folder).args(args).output().unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&output.stderr)))
}

fn refused(folder: &Path, args: &[&str], words: &str) {
    let output = hydroid(folder, args);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{args:?}: {error}");
    assert!(error.contains(words), "{args:?}: {error}");
}

fn figure<'a>(trial: &'a Value, name: &str) -> &'a Value {
    let figures = trial["figures"].as_array().unwrap();
    figures.iter().find(|figure| figure["name"] == name).unwrap_or_else(|| panic!("{name}: {trial}"))
}

#[test]
fn a_vessel_runs_all_trials() {
    let folder = TempDir::new().unwrap();
    let output = hydroid(folder.path(), &["manoeuvre", "simple", "--length", "2", "-o", "trials", "--json"]);
    assert_eq!(output.status.code(), Some(1), "stopping takes less than 15 lengths, turning more than 4.5 m");
    let document = json(&output);
    let trials = document["trials"].as_array().unwrap();
    let kinds: Vec<&str> = trials.iter().map(|trial| trial["trial"].as_str().unwrap()).collect();
    let zigzags = ["zigzag"; 4];
    let all = [&["turning-circle"; 2][..], &zigzags, &["pull-out", "spiral", "acceleration", "stopping"]];
    assert_eq!(kinds, all.concat());
    let advance = figure(&trials[0], "advance_m");
    assert!((advance["value"].as_f64().unwrap() - 6.4626).abs() < 1e-3);
    assert_eq!(advance["criterion"]["limit"], 9.0);
    assert_eq!(figure(&trials[0], "tactical_diameter_m")["criterion"]["passed"], false);
    assert_eq!(trials[6]["directionally_stable"], true);
    let saved: Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("trials/trials.json")).unwrap()).unwrap();
    assert_eq!(saved, document);
    let tracks = fs::read_to_string(folder.path().join("trials/tracks.csv")).unwrap();
    assert!(tracks.starts_with("trial,name,t [s],PP_cmd [N],RD_cmd [N s],x [m],y [m],psi [rad],u [m/s]"));
    assert!(
        tracks.contains("\n0,turning circle; 100 % to starboard,0,204,25,0,0,0,2.63"),
        "{}",
        &tracks[..200]
    );
    let page = fs::read_to_string(folder.path().join("trials/report.html")).unwrap();
    for words in ["Turning circle", "Zigzag, 10 %", "Pull-out", "Spiral", "Stopping", "criteria", "</html>"] {
        assert!(page.contains(words), "{words}");
    }
    assert!(!page.contains("NaN"));
}

#[test]
fn the_approach_has_the_stated_speed() {
    let folder = TempDir::new().unwrap();
    let args =
        ["manoeuvre", "simple", "--trials", "turning-circle", "--speed", "1.5", "--steering", "40", "--json"];
    let output = hydroid(folder.path(), &args);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let document = json(&output);
    assert!((document["approach_speed_m_s"].as_f64().unwrap() - 1.5).abs() < 1e-5);
    assert_eq!(document["trials"][0]["steering"], 0.4);
    assert_eq!(document["trials"].as_array().unwrap().len(), 2);
    let text = hydroid(folder.path(), &args[..args.len() - 1]);
    let text = String::from_utf8(text.stdout).unwrap();
    assert!(text.starts_with("approach: 1.500 m/s through the water with PP_cmd "), "{text}");
    assert!(text.contains("turning circle, 40 % to port"), "{text}");
}

#[test]
fn an_identified_model_runs_trials_and_predicts_those_in_a_log() {
    let folder = TempDir::new().unwrap();
    for (seed, file) in [("1", "a.csv"), ("2", "b.csv"), ("3", "c.csv")] {
        let args = ["simulate", "simple", "--seed", seed, "--duration", "600", "-o", file];
        assert_eq!(hydroid(folder.path(), &args).status.code(), Some(0));
    }
    let args = ["identify", "a.csv", "b.csv", "c.csv", "--outputs", "u,v,r", "-o", "out"];
    let output = hydroid(folder.path(), &args);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    for model in ["out/sindy.safetensors", "out/committee.safetensors"] {
        let args = ["manoeuvre", model, "--trials", "turning-circle,pull-out", "--steering", "50", "--json"];
        let document = json(&hydroid(folder.path(), &args));
        let truth = ["manoeuvre", "simple", "--trials", "turning-circle", "--steering", "50", "--json"];
        let truth = json(&hydroid(folder.path(), &truth));
        let value = |document: &Value| {
            figure(&document["trials"][0], "tactical_diameter_m")["value"].as_f64().unwrap()
        };
        assert!((value(&document) / value(&truth) - 1.0).abs() < 0.05, "{model}: {}", value(&document));
        let interval = &figure(&document["trials"][0], "tactical_diameter_m")["interval"];
        assert!(model.contains("committee") || interval[0].as_f64() < interval[1].as_f64(), "{interval}");
    }
    simulated_logs_of_a_model(folder.path());
    // A circle in a log: straight, then hard over.
    let mut commands = String::from("t,PP_cmd,RD_cmd\n");
    for (from, rudder) in [(0, 0), (30, 12), (60, 0)] {
        writeln!(commands, "{from},150,{rudder}").unwrap();
    }
    commands += "70,150,0\n";
    fs::write(folder.path().join("commands.csv"), commands).unwrap();
    let args = ["simulate", "simple", "--excitation", "commands.csv", "-o", "circle.csv"];
    assert_eq!(hydroid(folder.path(), &args).status.code(), Some(0));
    let document = json(&hydroid(folder.path(), &["inspect", "circle.csv", "--json"]));
    assert_eq!(document["trials"][0]["kind"], "turning-circle");
    assert!((document["trials"][0]["from_s"].as_f64().unwrap() - 30.0).abs() < 0.11);
    let text = hydroid(folder.path(), &["inspect", "circle.csv"]);
    assert!(String::from_utf8_lossy(&text.stdout).contains("trials     30.0 to 60.0 s: turn by "));
    let args = ["manoeuvre", "out/sindy.safetensors", "circle.csv", "--json"];
    let document = json(&hydroid(folder.path(), &args));
    let compared = &document["comparisons"][0];
    let value = |of: &str| {
        let figures = compared[of].as_array().unwrap();
        let advance = figures.iter().find(|figure| figure["name"] == "advance_m").unwrap();
        advance["value"].as_f64().unwrap()
    };
    assert!((value("predicted") / value("measured") - 1.0).abs() < 0.05, "{compared}");
    let text = hydroid(folder.path(), &args[..3]);
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(text.contains("30.0 s: turn by ") && text.contains("tactical diameter"), "{text}");
    comparisons_are_written(folder.path());
}

fn comparisons_are_written(folder: &Path) {
    let model = "out/sindy.safetensors";
    let args = ["manoeuvre", model, "circle.csv", "-o", "beside", "--json"];
    let document = json(&hydroid(folder, &args));
    let written = fs::read_to_string(folder.join("beside/comparisons.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&written).unwrap(), document);
    let compared = &document["comparisons"][0];
    assert_eq!(compared["in_training"], false);
    // Members of the ensemble give an interval around the prediction.
    assert!(compared["members"].as_u64().unwrap() >= 5, "{compared}");
    let advance = figure_of(&compared["predicted"], "advance_m");
    let [low, high] = [0, 1].map(|i| advance["interval"][i].as_f64().unwrap());
    assert!(low < high && (low..=high).contains(&advance["value"].as_f64().unwrap()), "{advance}");
    let tracks = fs::read_to_string(folder.join("beside/tracks.csv")).unwrap();
    assert!(tracks.lines().filter(|line| line.contains(",measured,")).count() > 100);
    assert!(tracks.lines().filter(|line| line.contains(",predicted,")).count() > 100);
    let page = fs::read_to_string(folder.join("beside/report.html")).unwrap();
    assert!(page.contains("circle.csv") && page.contains("tactical diameter") && page.contains("<svg"));
    // The log of the training is marked, and a log without trials says so.
    let log = fs::read_to_string(folder.join("circle.csv")).unwrap();
    let straight: Vec<&str> = log.lines().take(250).collect();
    fs::write(folder.join("straight.csv"), straight.join("\n")).unwrap();
    let said = hydroid(folder, &["manoeuvre", model, "straight.csv"]);
    assert_eq!(said.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&said.stdout).contains("no trial"));
    let args = ["identify", "circle.csv", "again.csv", "run.csv", "--methods", "sindy", "-o", "with"];
    if folder.join("run.csv").exists() {
        assert_eq!(hydroid(folder, &args).status.code(), Some(0));
        let said = hydroid(folder, &["manoeuvre", "with/sindy.safetensors", "circle.csv"]);
        assert!(String::from_utf8_lossy(&said.stdout).contains("the model was fitted to a run of this name"));
        errors_of_trials_in_the_logs_are_in_the_intervals(folder);
    }
}

/// A model of logs with a turn says how far the models without it were off, for turns and for nothing else.
fn errors_of_trials_in_the_logs_are_in_the_intervals(folder: &Path) {
    let trials = [
        "manoeuvre",
        "with/sindy.safetensors",
        "--trials",
        "turning-circle,zigzag",
        "--steering",
        "50",
        "--json",
    ];
    let document = json(&hydroid(folder, &trials));
    let advance = figure(&document["trials"][0], "advance_m");
    assert!(advance["left_out_trials"].as_u64().unwrap() >= 1, "{advance}");
    let overshoot = figure(&document["trials"][2], "first_overshoot_deg");
    assert!(overshoot["left_out_trials"].is_null(), "{overshoot}");
    let text = hydroid(folder, &trials[..trials.len() - 1]);
    let text = String::from_utf8(text.stdout).unwrap();
    assert!(
        text.contains("members, joined with 90 % by the errors of trials that were left out of the fit"),
        "{text}"
    );
    assert!(text.contains("errors that all of them share are not in them"), "{text}");
    let of_members =
        json(&hydroid(folder, &[&["manoeuvre", "out/sindy.safetensors"], &trials[2..]].concat()));
    let width = |document: &Value| {
        let advance = figure(&document["trials"][0], "advance_m");
        let [low, high] = [0, 1].map(|i| advance["interval"][i].as_f64().unwrap());
        assert!((low..=high).contains(&advance["value"].as_f64().unwrap()), "{advance}");
        (high - low) / advance["value"].as_f64().unwrap()
    };
    assert!(width(&document) > 2.0 * width(&of_members), "{document}");
}

fn figure_of<'a>(figures: &'a Value, name: &str) -> &'a Value {
    figures.as_array().unwrap().iter().find(|figure| figure["name"] == name).unwrap()
}

fn simulated_logs_of_a_model(folder: &Path) {
    let model = "out/sindy.safetensors";
    // Random commands: a log that can be identified.
    let args = ["simulate", model, "--duration", "60", "--seed", "4", "-o", "again.csv"];
    assert_eq!(hydroid(folder, &args).status.code(), Some(0));
    let log = fs::read_to_string(folder.join("again.csv")).unwrap();
    assert!(
        log.starts_with(
            "t [s],PP_cmd [N],RD_cmd [N s],x [m],y [m],psi [rad],u [m/s],v [m/s],r [rad/s],u_true"
        )
    );
    assert_eq!(log.lines().count(), 601);
    let again = hydroid(folder, &["simulate", model, "--duration", "60", "--seed", "4", "-o", "-"]);
    assert!(again.stdout == log.as_bytes(), "the same seed gives the same bytes");
    let without = hydroid(folder, &["simulate", model, "--duration", "60", "--noise", "0", "-o", "-"]);
    let without = String::from_utf8(without.stdout).unwrap();
    let row: Vec<&str> = without.lines().nth(300).unwrap().split(',').collect();
    assert_eq!(row[6..9], row[9..12], "without noise, measurement and truth are equal");

    // The commands of a log, from a measured state on: near the measured path.
    let args = [
        "simulate",
        model,
        "--excitation",
        "a.csv",
        "--start",
        "30",
        "--duration",
        "60",
        "--figure",
        "track.svg",
        "-o",
        "beside.csv",
        "--json",
    ];
    let document = json(&hydroid(folder, &args));
    assert_eq!(document["samples"], 600);
    assert!(document["max_distance_m"].as_f64().unwrap() < 1.0, "{document}");
    let figure = fs::read_to_string(folder.join("track.svg")).unwrap();
    assert!(figure.contains("measured") && figure.contains("simulated"));
    // Commands alone.
    fs::write(folder.join("only.csv"), "t,PP_cmd,RD_cmd\n0,100,0\n20,100,5\n40,100,5\n").unwrap();
    let output = hydroid(folder, &["simulate", model, "--excitation", "only.csv", "-o", "-"]);
    let log = String::from_utf8(output.stdout).unwrap();
    assert_eq!(log.lines().count(), 402, "{}", String::from_utf8_lossy(&output.stderr));
    assert!(log.lines().nth(201).unwrap().starts_with("20,100,5,"));

    for (args, words) in [
        (&["--excitation", "circle"][..], "needs a vessel with one propeller and one rudder: with"),
        (&["--dt", "0.2"], "--dt needs a vessel"),
        (&["--excitation", "only.csv", "--start", "5"], "--start needs a log with the outputs of the model"),
        (&["--excitation", "a.csv", "--start", "1h"], "has no samples there"),
        (&["--noise", "-1"], "the noise is -1"),
        (&["--duration", "0"], "the duration is 0"),
    ] {
        refused(folder, &[&["simulate", model][..], args].concat(), words);
    }
    refused(folder, &["simulate", "simple", "--figure", "track.svg"], "--figure needs an identified model");
}

/// A rudder that moved by 12 degrees in the log.
#[test]
fn the_rudder_may_go_farther_than_in_the_log() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let mut log = String::from("t,u [m/s],v [m/s],r [rad/s],delta [deg]\n");
    let (mut u, mut r) = (2.0_f64, 0.0_f64);
    for k in 0..1_200 {
        let angle = f64::from([0, 28, -28, 14, -20, 24, -7][k / 30 % 7]);
        writeln!(log, "{},{u},{},{r},{angle}", 0.5 * k as f64, -0.3 * r).unwrap();
        for _ in 0..10 {
            let rudder = angle.to_radians();
            u += 0.05 * (0.1 * (2.0 - u) - 0.15 * rudder * rudder);
            r += 0.05 * (0.1 * u * rudder - 0.2 * r);
        }
    }
    fs::write(folder.join("run.csv"), log).unwrap();
    let args = ["identify", "run.csv", "--inputs", "delta", "--methods", "sindy", "-o", "out"];
    let output = hydroid(folder, &args);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let model = "out/sindy.safetensors";
    let circle = ["manoeuvre", model, "--trials", "turning-circle", "--steering", "35", "--length", "8"];
    let output = hydroid(folder, &circle);
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        printed.contains("turning circle, 35 deg to starboard") && printed.contains("limit 36.00"),
        "{printed}"
    );
    let mark = "delta goes from 35 to 35 deg, and from -28 to 28 deg in its logs";
    assert!(printed.contains(mark), "{printed}");
    // The steady turn is slower than any motion in the log.
    let reason = "u is 1.";
    assert!(output.status.code() == Some(1) && printed.contains(reason), "{printed}");
    assert!(printed.contains("steady radius                  not valid"), "{printed}");
    let within = [&circle[..4], &["--steering", "28", "--length", "8"]].concat();
    let printed = hydroid(folder, &within);
    let printed = String::from_utf8_lossy(&printed.stdout).into_owned();
    assert!(!printed.contains("delta goes") && !printed.contains("limit"), "{printed}");
    refused(folder, &[&circle[..], &["--limit", "delta=-30:30 [deg]"]].concat(), "hard over is 30.0000 deg");
    refused(folder, &["manoeuvre", model, "--limit", "delta=1:2 [m]"], "unit of delta, [m]");
}

#[test]
fn wrong_input_is_refused_with_a_remedy() {
    let folder = TempDir::new().unwrap();
    let trial = |option: &'static str, value: &'static str| ["manoeuvre", "hydrofoil", option, value];
    for (option, value, words) in [
        ("--steering", "45", "hard over is 30.0000 deg"),
        ("--steering", "-5", "both sides are tried"),
        ("--zigzag", "10", "'10' is not STEERING/HEADING"),
        ("--zigzag", "10/200", "is not STEERING/HEADING"),
        ("--propulsion", "150", "percent of full ahead"),
        ("--speed", "50", "the steady speeds of the vessel are"),
        ("--push", "PP", "has no input 'PP', did you mean 'PP_cmd'"),
        ("--turn", "-rudder", "has no input 'rudder'"),
        ("--length", "0", "give metres"),
        ("--trials", "loop", "possible values: turning-circle"),
    ] {
        refused(folder.path(), &trial(option, value), words);
    }
    refused(folder.path(), &["manoeuvre", "missing.safetensors"], "missing.safetensors");
    fs::write(folder.path().join("log.csv"), "t,u\n0,1\n").unwrap();
    refused(folder.path(), &["manoeuvre", "log.csv"], "log.csv");
}

#[test]
fn a_tanker_whose_only_input_is_its_rudder_runs_trials_at_the_speed_of_its_log() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden/tanker.csv");
    let log = log.to_str().unwrap();
    let args = ["identify", log, "--inputs", "delta", "--methods", "sindy", "--horizon", "10s", "-o", "out"];
    let output = hydroid(folder, &args);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(0), "{text}{}", String::from_utf8_lossy(&output.stderr));
    let roles = "roles of the inputs of sindy:\n  delta steering     found: its name\n";
    let inspected = hydroid(folder, &["inspect", "out/sindy.safetensors"]);
    for text in [&text, &*String::from_utf8_lossy(&inspected.stdout)] {
        assert!(text.contains(roles), "{text}");
    }
    let summary: Value =
        serde_json::from_str(&fs::read_to_string(folder.join("out/identify.json")).unwrap()).unwrap();
    assert_eq!(summary["models"][0]["boat"]["inputs"]["delta"]["role"], "steering");

    let model = "out/sindy.safetensors";
    let document = json(&hydroid(folder, &["manoeuvre", model, "-o", "trials", "--json"]));
    assert!((document["approach_speed_m_s"].as_f64().unwrap() - 1.786).abs() < 0.02);
    assert_eq!(document["propulsion"], Value::Null);
    assert_eq!(document["no_propulsion"], "no input pushes the vessel: delta (steering)");
    assert_eq!(document["left_out"][1]["trial"], "stopping");
    let printed = hydroid(folder, &["manoeuvre", model]);
    let printed = String::from_utf8_lossy(&printed.stdout).into_owned();
    assert!(printed.contains("(no input pushes the vessel: delta (steering))"), "{printed}");
    assert!(printed.contains("acceleration: left out, because no input pushes"), "{printed}");
    for (args, words) in [
        (&["--speed", "1.2"][..], "the steady speed of the vessel is 1.7"),
        (&["--propulsion", "50"], "no input pushes the vessel"),
        (&["--trials", "stopping"], "acceleration and stopping need propulsion"),
        (&["--role", "delta=propulsion"], "no input of this model pushes the vessel"),
        (&["--role", "detla=steering"], "did you mean 'delta'?"),
        (&["--role", "delta=rudder"], "'rudder' is not a role"),
    ] {
        refused(folder, &[&["manoeuvre", model][..], args].concat(), words);
    }
    refused(folder, &["control", model, "--controller", "pid"], "pid holds the speed");
    let args = ["simulate", model, "--duration", "60", "-o", "-"];
    let simulated = hydroid(folder, &args);
    assert_eq!(simulated.status.code(), Some(0), "{}", String::from_utf8_lossy(&simulated.stderr));
    let args = ["report", model, "--interactive", "-o", "page.html"];
    assert_eq!(hydroid(folder, &args).status.code(), Some(0));
}
