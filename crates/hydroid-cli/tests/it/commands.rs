//! The commands from end to end on simulated logs, and their JSON documents.

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

fn simulate(folder: &Path, plant: &str, seed: &str, file: &str, duration: &str) {
    let args = ["simulate", plant, "--seed", seed, "--duration", duration, "-o", file];
    let output = hydroid(folder, &args);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
}

/// The JSON object of `evaluate`, for three outputs.
fn is_evaluation(value: &Value, horizon: usize) {
    assert_eq!(value["channels"], serde_json::json!(["u", "v", "r"]));
    assert_eq!(value["units"], serde_json::json!(["m/s", "m/s", "rad/s"]));
    assert_eq!(value["horizons"].as_array().unwrap().len(), horizon);
    for key in ["model", "origin", "against"] {
        assert!(value[key].is_string(), "{key}");
    }
    for key in ["dt", "windows", "diverged"] {
        assert!(value[key].is_number(), "{key}");
    }
    let tables = ["mae", "max", "rmse", "nrmse", "r2"].map(|key| (key, &value[key]));
    let kept = ["mae", "rmse", "nrmse"].map(|key| (key, &value["persistence"][key]));
    for (key, table) in tables.into_iter().chain(kept) {
        let rows = table.as_array().unwrap_or_else(|| panic!("{key}"));
        assert_eq!(rows.len(), horizon, "{key}");
        assert!(rows.iter().all(|row| row.as_array().unwrap().len() == 3), "{key}");
    }
}

#[test]
fn the_hydrofoil_is_simulated_identified_and_evaluated() {
    let folder = TempDir::new().unwrap();
    for (seed, file, duration) in [("1", "a.csv", "900"), ("2", "b.csv", "300"), ("3", "c.csv", "300")] {
        simulate(folder.path(), "hydrofoil", seed, file, duration);
    }
    let args = ["identify", "a.csv", "--validate", "b.csv", "--test", "c.csv", "-o", "out", "--json"];
    let output = hydroid(folder.path(), &args);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let document = json(&output);
    assert_eq!(document["best"], "sindy");
    let model = &document["models"][0];
    assert_eq!(model["kind"], "sparse_equations");
    assert!(model["weights"].as_u64().unwrap() > 5 && model["train_seconds"].is_number());
    is_evaluation(&model["validation"], 100);
    is_evaluation(&model["test"], 100);
    // Propeller force and mode are hidden: the model is not good, but far better than none.
    for (error, kept) in [("u", 0), ("v", 1), ("r", 2)]
        .map(|(_, c)| (&model["test"]["nrmse"][99][c], &model["test"]["persistence"]["nrmse"][99][c]))
    {
        assert!(error.as_f64().unwrap() < 0.5 * kept.as_f64().unwrap());
    }
    assert!(document["warnings"].is_array());
    let saved: Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("out/identify.json")).unwrap()).unwrap();
    assert_eq!(saved, document);
    let file = model["file"].as_str().unwrap();

    // `evaluate` gives the same errors on the same log.
    let output = hydroid(folder.path(), &["evaluate", file, "c.csv", "--json"]);
    assert_eq!(output.status.code(), Some(0));
    let mut evaluated = json(&output);
    let band = evaluated.as_object_mut().unwrap().remove("band_coverage");
    assert!(band.is_some(), "how often the ensemble's band holds");
    assert!(evaluated.as_object_mut().unwrap().remove("prediction_bands").is_some());
    assert!(evaluated == model["test"], "the same figures");

    // From true origins against the truth, short-term errors are smaller.
    let args =
        ["evaluate", file, "c.csv", "--origin", "true", "--against", "truth", "--horizon", "5", "--json"];
    let truth = json(&hydroid(folder.path(), &args));
    assert_eq!((truth["origin"].as_str(), truth["against"].as_str()), (Some("true"), Some("truth")));
    assert!(truth["rmse"][0][2].as_f64() < model["test"]["rmse"][0][2].as_f64());

    let output = hydroid(folder.path(), &["inspect", file]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("du/dt =") && text.contains("dr/dt =") && text.contains("PP_cmd"), "{text}");
    let inspected = json(&hydroid(folder.path(), &["inspect", file, "--json"]));
    assert_eq!(inspected["kind"], "sparse_equations");
}

#[test]
fn the_same_command_writes_the_same_bytes_on_any_number_of_threads() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "simple", "5", "run.csv", "400");
    let run = |out: &str, threads: &str| {
        let args = ["identify", "run.csv", "-o", out, "--horizon", "30", "--threads", threads];
        assert_eq!(hydroid(folder.path(), &args).status.code(), Some(0));
        fs::read(folder.path().join(out).join("sindy.safetensors")).unwrap()
    };
    assert_eq!(run("one", "1"), run("three", "3"));
    simulate(folder.path(), "simple", "5", "again.csv", "400");
    let bytes = |file: &str| fs::read(folder.path().join(file)).unwrap();
    assert_eq!(bytes("run.csv"), bytes("again.csv"));
    simulate(folder.path(), "simple", "6", "other.csv", "400");
    assert_ne!(bytes("run.csv"), bytes("other.csv"));
}

#[test]
fn a_configuration_file_equals_the_command_line() {
    let folder = TempDir::new().unwrap();
    for (seed, file) in [("1", "a.csv"), ("2", "b.csv"), ("3", "c.csv")] {
        simulate(folder.path(), "simple", seed, file, "300");
    }
    fs::write(
        folder.path().join("hydroid.toml"),
        "[log]\noutputs = [\"u\", \"speed_to_starboard=v\", \"r\"]\ninputs = [\"PP_cmd\", \"RD_cmd\"]\n\
         [split]\ntrain = [\"a.csv\"]\nvalidate = [\"b.csv\"]\ntest = [\"c.csv\"]\n\
         [identify]\nhorizon = 20\n[sindy]\ndegree = 1\nsigned_squares = false\ngate = \"none\"\nlag = \"none\"\n",
    )
    .unwrap();
    let output = hydroid(folder.path(), &["identify", "-c", "hydroid.toml", "-o", "out", "--json"]);
    let document = json(&output);
    let test = &document["models"][0]["test"];
    assert_eq!(test["channels"], serde_json::json!(["u", "speed_to_starboard", "r"]));
    assert_eq!(test["horizons"].as_array().unwrap().len(), 20);
    let inspected = json(&hydroid(folder.path(), &["inspect", "out/sindy.safetensors", "--json"]));
    let asked = &inspected["description"]["provenance"]["settings"]["asked"];
    assert_eq!((&asked["degree"], &asked["signed_squares"]), (&Value::from(1), &Value::from(false)));
    prints_equations(folder.path(), &inspected);
}

/// Text, LaTeX and JSON of a model agree.
fn prints_equations(folder: &Path, document: &Value) {
    let shown = |args: &[&str]| {
        let output = hydroid(folder, &[&["inspect", "out/sindy.safetensors"], args].concat());
        String::from_utf8(output.stdout).unwrap()
    };
    let (text, latex) = (shown(&[]), shown(&["--latex"]));
    for equation in document["equations"].as_array().unwrap() {
        assert!(text.contains(equation.as_str().unwrap()), "{text}");
    }
    let parts = ["latex", "latex_units", "latex_coefficients"].map(|key| document[key].as_str().unwrap());
    assert_eq!(latex, parts.concat());
    assert!(latex.starts_with("\\begin{align*}\n  \\dot{u} &="), "{latex}");
    // The Jacobian of linear equations is the matrix of coefficients.
    let coefficients = document["coefficients"].as_array().unwrap();
    let of_u = coefficients.iter().find(|c| c["output"] == "u" && c["term"] == "u").unwrap();
    assert!(text.contains("coefficients ± standard errors") && latex.contains("\\pm"), "{text}{latex}");
    let error = of_u["standard_error"].as_f64().unwrap();
    assert!(error > 0.0 && error < of_u["value"].as_f64().unwrap().abs(), "{of_u}");
    let correlation = &document["correlation"][0];
    assert_eq!(
        (&correlation["output"], &correlation["matrix"][0][0]),
        (&Value::from("u"), &Value::from(1.0))
    );
    let terms_of_u = coefficients.iter().filter(|c| c["output"] == "u").map(|c| &c["term"]);
    assert!(terms_of_u.eq(correlation["terms"].as_array().unwrap()), "{correlation}");
    let entry = &document["jacobian"]["A"][0][0];
    assert_eq!((&entry["terms"][0][0], &entry["terms"][0][1]), (&of_u["value"], &Value::from("1")));
    assert_eq!((&entry["unit"], &of_u["unit"]), (&Value::from("1/s"), &Value::from("1/s")));
}

#[test]
fn a_vessel_is_read_from_a_file() {
    let folder = TempDir::new().unwrap();
    let printed = hydroid(folder.path(), &["simulate", "simple", "--print-vessel"]);
    let toml = String::from_utf8(printed.stdout).unwrap();
    fs::write(folder.path().join("mine.toml"), toml.replace("mass = 80.0", "mass = 160.0")).unwrap();
    let args = |plant| ["simulate", plant, "--duration", "60", "--noise", "0", "--json", "-o"];
    let light = json(&hydroid(folder.path(), &[&args("simple")[..], &["light.csv"]].concat()));
    let heavy = json(&hydroid(folder.path(), &[&args("mine.toml")[..], &["heavy.csv"]].concat()));
    assert_eq!(light["samples"], 600);
    assert_ne!(light["u_max"], heavy["u_max"]);
}

#[test]
fn commands_from_a_file_repeat_a_simulation() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "hydrofoil", "4", "first.csv", "60");
    let args = ["simulate", "hydrofoil", "--excitation", "first.csv", "--seed", "4", "-o", "second.csv"];
    let output = hydroid(folder.path(), &args);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = |file: &str| fs::read(folder.path().join(file)).unwrap();
    assert_eq!(bytes("first.csv"), bytes("second.csv"));
}

/// The model stores an input delay as time: 0.3 s are three samples at 10 Hz and six at 20 Hz.
#[test]
fn a_delay_in_samples_means_the_same_time_on_a_log_of_another_rate() {
    let folder = TempDir::new().unwrap();
    let log = |name: &str, halves: u32, rows: u32, seed: f64| {
        let dt = 0.05 * f64::from(halves);
        let command = |t: f64| (0.9 * t + seed).sin() + (0.31 * t).cos();
        let mut text = String::from("t [s],u [m/s],n_cmd [1]\n");
        let mut u = 0.0;
        for k in 0..rows {
            let t = f64::from(k) * dt;
            writeln!(text, "{t:.3},{u},{}", command(t)).unwrap();
            // The command acts 0.3 s after its log entry, held over a step of the finer log.
            for half in 0..halves {
                let at = t + 0.05 * f64::from(half) - 0.3;
                let held = (at / dt + 1e-9).floor() * dt;
                u += 0.05 * (-0.5 * u + command(held));
            }
        }
        fs::write(folder.path().join(name), text).unwrap();
    };
    log("slow.csv", 2, 3_000, 0.0);
    log("fast.csv", 1, 3_000, 1.0);
    let args =
        ["identify", "slow.csv", "--outputs", "u", "--input-delay", "3", "-o", "out", "--horizon", "5s"];
    assert_eq!(hydroid(folder.path(), &args).status.code(), Some(0));
    let evaluate = |delay: &[&str]| {
        let args = ["evaluate", "out/sindy.safetensors", "fast.csv", "--horizon", "5s", "--json"];
        json(&hydroid(folder.path(), &[&args[..], delay].concat()))["nrmse"][49][0].as_f64().unwrap()
    };
    let (kept, none) = (evaluate(&[]), evaluate(&["--input-delay", "0"]));
    assert!(kept < 0.02 && kept < 0.3 * none, "{kept} {none}");
}

#[test]
fn a_model_below_persistence_has_exit_status_one() {
    let folder = TempDir::new().unwrap();
    for (plant, file) in [("simple", "a.csv"), ("hydrofoil", "b.csv")] {
        simulate(folder.path(), plant, "3", file, "300");
    }
    let args = ["identify", "a.csv", "-o", "out", "--horizon", "2s"];
    assert_eq!(hydroid(folder.path(), &args).status.code(), Some(0));
    // The log of another vessel, whose rudder angle has the name of the moment in the model.
    let log = fs::read_to_string(folder.path().join("b.csv")).unwrap();
    fs::write(folder.path().join("b.csv"), log.replace("RD_ang [rad]", "RD_cmd [N s]")).unwrap();
    let args = ["evaluate", "out/sindy.safetensors", "b.csv"];
    let output = hydroid(folder.path(), &[&args[..], &["--horizon", "10s"]].concat());
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("NOT IDENTIFIED"));
    assert!(String::from_utf8_lossy(&output.stderr).contains("leave the training range of the model"));
}

#[test]
fn hydroid_toml_in_the_current_folder_is_read() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "simple", "1", "a.csv", "300");
    fs::write(
        folder.path().join("hydroid.toml"),
        "[split]\ntrain = [\"a.csv\"]\n[identify]\nhorizon = \"2s\"\n[sindy]\ndegree = 1\n",
    )
    .unwrap();
    let document =
        json(&hydroid(folder.path(), &["identify", "-o", "out", "--json", "--methods", "sindy,sindy"]));
    assert_eq!(document["models"].as_array().unwrap().len(), 1, "a method said twice is tried once");
    let unknown = hydroid(folder.path(), &["identify", "-o", "out", "--methods", "crystal-ball"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert_eq!(document["models"][0]["validation"]["horizons"].as_array().unwrap().len(), 20);
    assert!(document["cross_validated"] == true && document["models"][0]["test"].is_null());
    assert!(!folder.path().join("out/hydrofoil-train.csv").exists());
}

#[cfg(unix)]
#[test]
fn a_closed_pipe_is_not_an_error() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "simple", "1", "a.csv", "120");
    let program = assert_cmd::cargo::cargo_bin("hydroid");
    for command in
        ["simulate simple --duration 600 -o -", "simulate hydrofoil --print-vessel", "inspect a.csv"]
    {
        let line = format!("'{}' {command} 2>err | head -c 1 >/dev/null; cat err", program.display());
        let output =
            std::process::Command::new("sh").args(["-c", &line]).current_dir(folder.path()).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(!text.contains("panicked") && !text.contains("error"), "{command}: {text}");
    }
}

/// Two minutes under way, then towed with zero commands.
#[test]
fn the_end_of_a_log_under_tow_is_left_out_unless_it_is_kept() {
    let folder = TempDir::new().unwrap();
    let mut log = String::from("t [s],u [m/s],n\n");
    for k in 0..1500_u32 {
        let t = f64::from(k) * 0.1;
        let (u, n) =
            if k < 1200 { (0.5 + 0.2 * (0.3 * t).sin(), 1 + k / 100 % 3) } else { (0.05 * (t - 120.0), 0) };
        let _ = writeln!(log, "{t:.1},{u:.4},{n}");
    }
    fs::write(folder.path().join("log.csv"), log).unwrap();
    let told = |more: &[&str]| {
        let args = [&["inspect", "log.csv", "--outputs", "u", "--inputs", "n"], more].concat();
        let output = hydroid(folder.path(), &args);
        assert_eq!(output.status.code(), Some(0));
        format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
    };
    let words = told(&[]);
    assert!(words.contains("the end of the log, 29.9 s from line 1202 to line 1501, is removed"), "{words}");
    assert!(!told(&["--keep-towed"]).contains("is removed"));
}

#[test]
fn every_command_has_help_with_an_example() {
    let folder = TempDir::new().unwrap();
    for verb in ["simulate", "inspect", "identify", "evaluate"] {
        let output = hydroid(folder.path(), &[verb, "--help"]);
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(text.contains("Examples:") && text.contains(&format!("hydroid {verb}")), "{verb}");
        for option in ["--json", "--threads"] {
            assert!(text.contains(option), "{verb} {option}");
        }
    }
}

/// Three runs of a vessel that turns, in currents; the heading is in the last column.
fn runs_in_currents(folder: &Path, heading: &str) -> [String; 3] {
    [(1, [0.0, 0.0]), (2, [0.6, -0.2]), (3, [-0.3, 0.5])].map(|(number, [north, east])| {
        let (mut log, mut psi) = (format!("t,n_cmd,rudder_ang [rad],u,v,r,{heading}\n"), 0.2_f64);
        let (mut u, mut v, mut r) = (0.8_f64, 0.0, 0.0);
        for k in 0..1200_u32 {
            let held = f64::from((k / 40 * 7 + number * 3) % 11) / 11.0;
            let (n, rudder) = (0.4 + held, (f64::from(k / 40 * 5 % 7) - 3.0) / 5.0);
            let (sin, cos) = psi.sin_cos();
            let (over_u, over_v) = (u + north * cos + east * sin, v + east * cos - north * sin);
            let noise = |c: u32| 0.01 * f64::from((k * 7919 + c * 104_729) % 1000) / 1000.0;
            let _ = writeln!(
                log,
                "{:.1},{n:.3},{rudder:.3},{:.5},{:.5},{:.5},{:.4}",
                0.2 * f64::from(k),
                over_u + noise(1),
                over_v + noise(2),
                r + noise(3),
                psi.to_degrees()
            );
            psi += 0.2 * r;
            (u, v, r) = (
                u + 0.2 * (0.4 * n - 0.4 * u),
                v + 0.2 * (-0.5 * v - 0.3 * u * r),
                r + 0.2 * (-0.6 * r + 0.3 * u * rudder),
            );
        }
        let name = format!("run{number}.csv");
        fs::write(folder.join(&name), log).unwrap();
        name
    })
}

#[test]
fn a_model_of_the_motion_through_the_water_is_identified_and_evaluated() {
    let folder = TempDir::new().unwrap();
    let names = runs_in_currents(folder.path(), "heading [deg]");
    let [a, b, c] = names.each_ref().map(String::as_str);
    let identify = ["identify", a, b, c, "--horizon", "10s", "--methods", "committee"];
    // The current of a run is unknown for its first seconds, which decide on exact and short runs.
    let output = hydroid(folder.path(), &[&identify[..], &["-o", "auto"]].concat());
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("stays over ground: its cross-validated error is"), "{told}");
    let demanded = ["--motion", "through-water", "-o", "out"];
    let output = hydroid(folder.path(), &[&identify[..], &demanded].concat());
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("Currents of the runs"), "{told}");
    let text = fs::read_to_string(folder.path().join("out/identify.json")).unwrap();
    let summary: Value = serde_json::from_str(&text).unwrap();
    let found = &summary["currents"]["runs"];
    assert!((found[1]["north_m_s"].as_f64().unwrap() - 0.6).abs() < 0.02, "{found}");
    assert!((found[2]["east_m_s"].as_f64().unwrap() - 0.5).abs() < 0.02, "{found}");
    let model = "out/committee.safetensors";
    let evaluated = hydroid(folder.path(), &["evaluate", model, b]);
    assert_eq!(evaluated.status.code(), Some(0), "{}", String::from_utf8_lossy(&evaluated.stderr));
    let adapted = hydroid(folder.path(), &["adapt", model, b]);
    assert!(adapted.status.code().is_some_and(|code| code < 2));
    assert!(String::from_utf8_lossy(&adapted.stdout).contains("adapted"));
    // The model names the column of its heading.
    let others = TempDir::new().unwrap();
    let [d, ..] = runs_in_currents(others.path(), "angle [deg]");
    let d = others.path().join(d);
    let missing = hydroid(folder.path(), &["evaluate", model, d.to_str().unwrap()]);
    assert!(String::from_utf8_lossy(&missing.stderr).contains("heading"));
    let named = ["evaluate", model, d.to_str().unwrap(), "--heading", "angle"];
    assert_eq!(hydroid(folder.path(), &named).status.code(), Some(0));
    // Without a column that is known to be a heading.
    let output = hydroid(others.path(), &[&identify[..], &demanded].concat());
    assert_ne!(output.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--heading"));
    assert!(!others.path().join("out").exists());
}

#[test]
fn a_model_from_still_water_estimates_a_current() {
    let folder = TempDir::new().unwrap();
    let sail = ["control", "hydrofoil", "--controller", "fl", "--task", "lawn-mower", "--speed", "2"];
    let sail = [&sail[..], &["--radius", "15", "--leg", "30", "--current", "0.3,0.2", "-o", "sail"]].concat();
    let output = hydroid(folder.path(), &sail);
    assert!(output.status.code().is_some_and(|code| code < 2), "{}", String::from_utf8_lossy(&output.stderr));
    let judged = |command: &str, options: &[&str]| {
        let log = ["sail/track.csv", "--inputs", "PP_cmd,RD_ang", "--horizon", "2s", "--origin-stride", "5"];
        hydroid(folder.path(), &[&[command, "hydrofoil"], &log[..], options, &["--json"]].concat())
    };
    let sway = |document: &Value| document["nrmse"][19][1].as_f64().unwrap();
    let still = sway(&json(&judged("evaluate", &[])));
    let current = sway(&json(&judged("evaluate", &["--estimate-current", "0.3"])));
    assert!(current < 0.7 * still, "{current} {still}");
    let adapted = json(&judged("adapt", &["--estimate-current", "0.3"]));
    let learned = sway(&adapted["adapted"]);
    assert!(learned < 0.7 * still && sway(&adapted["frozen"]) == still, "{learned} {still}");

    // Wrong use.
    let complaint = |output: Output| {
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8(output.stderr).unwrap()
    };
    for deviation in ["-1", "0"] {
        let wrong = complaint(judged("evaluate", &["--estimate-current", deviation]));
        assert!(wrong.contains("give a positive number"), "{wrong}");
    }
    let log = fs::read_to_string(folder.path().join("sail/track.csv")).unwrap();
    fs::write(folder.path().join("sail/track.csv"), log.replacen("psi", "angle", 1)).unwrap();
    let wrong = complaint(judged("evaluate", &["--estimate-current", "0.3"]));
    assert!(wrong.contains("track.csv") && wrong.contains("--heading"), "{wrong}");
    let wrong = complaint(judged("adapt", &["--estimate-current", "0.3", "--heading", "nowhere"]));
    assert!(wrong.contains("nowhere"), "{wrong}");
}
