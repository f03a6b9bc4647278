//! `hydroid control` from end to end.

use std::fs;
use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn hydroid(folder: &Path, args: &str) -> Output {
    let words: Vec<&str> = args.split(' ').collect();
    Command::cargo_bin("hydroid").unwrap().current_dir(folder).args(words).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn told(folder: &Path, args: &str, status: i32) -> Value {
    let output = hydroid(folder, args);
    assert_eq!(output.status.code(), Some(status), "{args}: {}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The document without computing times.
fn timeless(mut told: Value) -> Value {
    told.as_object_mut().unwrap().remove("us_per_command");
    if let Some(trials) = told.get_mut("trials").and_then(Value::as_array_mut) {
        for trial in trials {
            trial["metrics"].as_object_mut().unwrap().remove("us_per_command");
        }
    }
    told
}

#[test]
fn a_closed_loop_writes_all_files() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let args = "control hydrofoil --controller fl --speed 4 --radius 30 --seed 3 -o steered --json";
    let report = told(at, args, 0);
    for key in
        ["rms_position", "rms_cross_track", "rms_speed", "max_cross_track", "settled_after", "saturated"]
    {
        assert!(report[key].as_f64().is_some_and(|x| x < 10.0), "{key}");
    }
    assert!(report["rms_position"].as_f64().unwrap() < 0.005);
    assert!(
        report["us_per_command"]["median"].as_f64().unwrap()
            <= report["us_per_command"]["max"].as_f64().unwrap()
    );
    let counted: u64 = report["status"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(counted, 1200);
    assert_eq!((&report["controller"]["kind"], &report["violations"]), (&Value::from("fl"), &Value::from(0)));
    let written: Value =
        serde_json::from_str(&fs::read_to_string(at.join("steered/control.json")).unwrap()).unwrap();
    assert_eq!(written, report);
    let page = fs::read_to_string(at.join("steered/report.html")).unwrap();
    for words in ["north [m]", "cross-track error [m]", "PP_cmd [N]", "time for a command", "--speed 4"] {
        assert!(page.contains(words), "{words}");
    }
    // A repetition gives the same result except for computing times.
    let track = fs::read(at.join("steered/track.csv")).unwrap();
    let again = told(at, &args.replace("-o steered", "-o again --threads 1"), 0);
    assert_eq!(timeless(again), timeless(report));
    assert_eq!(fs::read(at.join("again/track.csv")).unwrap(), track);
    // The track is a valid log.
    let evaluated =
        hydroid(at, "evaluate hydrofoil steered/track.csv --horizon 2s --origin-stride 20 --json");
    // A circle excites little, so that no model is good there (status 1); wrong input is 2.
    assert!(matches!(evaluated.status.code(), Some(0 | 1)), "{}", text(&evaluated.stderr));
    let judged: Value = serde_json::from_slice(&evaluated.stdout).unwrap();
    assert!(judged["windows"].as_u64().unwrap() > 40 && judged["diverged"] == 0, "{judged}");
    // The text output.
    let output = hydroid(at, "control hydrofoil --controller backstepping --speed 2.5 --radius 25");
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stdout).contains("RMS distance from the reference after 40 s"));
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn identified_equations_work_with_every_controller_and_adapt() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for (seed, file) in [(0, "a.csv"), (1, "b.csv"), (2, "c.csv")] {
        let args = format!("simulate hydrofoil --duration 300 --seed {seed} -o {file}");
        assert_eq!(hydroid(at, &args).status.code(), Some(0));
    }
    let mut command = Command::cargo_bin("hydroid").unwrap();
    command
        .current_dir(at)
        .args("identify a.csv --validate b.csv --test c.csv -o out -q --methods sindy".split(' '));
    for term in
        ["u", "v", "r", "u |u|", "v |v|", "r |r|", "u r", "v r", "r^2", "u v", "PP_cmd", "u sin(RD_ang)"]
    {
        command.args(["--terms", term]);
    }
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let model = "out/sindy.safetensors";
    for rest in [
        "fl",
        "fl --adaptive-augmentation",
        "fl --adapt",
        "fl --adapt --learner kalman --no-guard",
        "backstepping",
        "cem --candidates 40 --iterations 2",
    ] {
        let report = told(at, &format!("control {model} --plant hydrofoil --controller {rest} --json"), 0);
        let off = report["rms_position"].as_f64().unwrap();
        assert!(off < 0.1, "{rest}: {off}");
    }
}

#[test]
fn equations_that_cannot_be_inverted_are_refused_by_fl_and_accepted_by_cem() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for (seed, file) in [(0, "a.csv"), (1, "b.csv"), (2, "c.csv")] {
        let args = format!("simulate simple --duration 120 --seed {seed} -o {file}");
        assert_eq!(hydroid(at, &args).status.code(), Some(0));
    }
    let mut command = Command::cargo_bin("hydroid").unwrap();
    command.current_dir(at).args(
        "identify a.csv --validate b.csv --test c.csv --outputs u,v,r -o out -q --methods sindy --lag none --gate none"
            .split(' '),
    );
    for term in ["u", "v", "r", "PP_cmd", "u RD_cmd", "u sin(RD_cmd)"] {
        command.args(["--terms", term]);
    }
    command.args(["--threshold", "0"]).output().unwrap();
    let model = "out/sindy.safetensors";
    let output = hydroid(at, &format!("control {model} --plant simple --controller fl --radius 10"));
    let words = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{words}");
    assert!(words.contains("fl cannot invert this model") && words.contains("cem"), "{words}");
    // The remedy of the message.
    let args = "identify a.csv --validate b.csv --test c.csv --outputs u,v,r -o invertible -q --methods sindy --for-control";
    let identified = hydroid(at, args);
    assert!(identified.status.code() < Some(2), "{}", text(&identified.stderr));
    let report =
        told(at, "control invertible/sindy.safetensors --plant simple --controller fl --radius 10 --json", 0);
    assert!(report["rms_position"].as_f64().unwrap() < 0.05, "{}", report["rms_position"]);
    let plan = "--controller cem --candidates 40 --iterations 2 --duration 20 --json";
    let report = told(at, &format!("control {model} --plant simple --radius 10 {plan}"), 0);
    assert!(report["rms_position"].as_f64().unwrap() < 0.5);
}

/// Each kind of model, identified here, is simulated, runs a turning circle, and is steered as the plant of its own controller.
#[test]
fn every_kind_of_model_is_simulated_tried_and_steered() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for (seed, file) in [(0, "a.csv"), (1, "b.csv"), (2, "c.csv")] {
        let args = format!("simulate simple --duration 300 --seed {seed} -o {file}");
        assert_eq!(hydroid(at, &args).status.code(), Some(0));
    }
    let network = "hidden = 16\nepochs = 200\nrestarts = 1\n";
    let direct = "history_s = 1.0\nwindow_s = 2.0\n";
    let text_of = format!("[affine]\n{network}\n[network]\n{network}\n[direct]\n{network}{direct}");
    fs::write(at.join("small.toml"), text_of).unwrap();
    let args = "identify a.csv b.csv c.csv --outputs u,v,r --methods sindy,committee,affine,gru,direct -c small.toml --horizon 20 -o out -q";
    let identified = hydroid(at, args);
    assert!(identified.status.code() < Some(2), "{}", text(&identified.stderr));
    let lawn = "--task lawn-mower --legs 2 --speed 2 --radius 15 --leg 30 --tolerance 5";
    for (kind, law) in
        [("sindy", "pid"), ("committee", "cem"), ("affine", "fl"), ("gru", "cem"), ("direct", "cem")]
    {
        let model = format!("out/{kind}.safetensors");
        let output = hydroid(at, &format!("simulate {model} --duration 60 --seed 4 -o {kind}.csv"));
        assert_eq!(output.status.code(), Some(0), "{kind}: {}", text(&output.stderr));
        let log = fs::read_to_string(at.join(format!("{kind}.csv"))).unwrap();
        assert!(
            log.starts_with("t [s],PP_cmd [N],RD_cmd [N s],x [m],y [m],psi [rad],u [m/s]"),
            "{kind}: {log:.80}"
        );
        assert_eq!(log.lines().count(), 601, "{kind}");
        let trials =
            told(at, &format!("manoeuvre {model} --trials turning-circle --speed 2 --steering 40 --json"), 0);
        let figures = trials["trials"][0]["figures"].as_array().unwrap();
        let tactical = figures.iter().find(|figure| figure["name"] == "tactical_diameter_m").unwrap();
        let tactical = tactical["value"].as_f64().unwrap();
        // The vessel itself has 24.0 m.
        assert!((20.0..29.0).contains(&tactical), "{kind}: {tactical}");
        let report = told(at, &format!("control {model} --controller {law} {lawn} -o {kind} --json"), 0);
        let off = report["rms_cross_track"].as_f64().unwrap();
        // A direct predictor trained for seconds turns unlike on the two sides.
        let bound = if kind == "direct" { 3.0 } else { 0.5 };
        assert!(off < bound, "{kind}: {off}");
        let page = fs::read_to_string(at.join(kind).join("report.html")).unwrap();
        assert!(page.contains(&format!("{kind}.safetensors")) && page.contains("RD_cmd [N s]"), "{kind}");
    }
    // The size of the model gives the defaults of the task, and its own inputs the limits.
    let report = told(at, "control out/sindy.safetensors --controller cem --duration 60 --json", 0);
    assert!(report["task"]["response"]["turning_radius_m"].as_f64().unwrap() > 2.0);
    let radius = report["task"]["path"]["radius"].as_f64().unwrap();
    let scale = report["task"]["scale"]["radius"].as_f64().unwrap();
    assert!((radius / scale - 15.0).abs() < 1e-9);
    let narrow = hydroid(at, "control out/sindy.safetensors --controller cem --radius 1");
    assert_eq!(narrow.status.code(), Some(2));
    assert!(text(&narrow.stderr).contains("give a larger --radius"), "{}", text(&narrow.stderr));
    let windy = hydroid(at, "control out/sindy.safetensors --controller cem --wind 5,0");
    assert_eq!(windy.status.code(), Some(2));
    assert!(text(&windy.stderr).contains("needs a vessel with given parameters"), "{}", text(&windy.stderr));
}

/// Tiny networks, not necessarily good, can be used by a controller.
#[test]
fn networks_are_identified_and_control_the_vessel() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for (seed, file) in [(0, "a.csv"), (1, "b.csv"), (2, "c.csv")] {
        let args = format!("simulate simple --duration 60 --seed {seed} -o {file}");
        assert_eq!(hydroid(at, &args).status.code(), Some(0));
    }
    let tiny = "hidden = 6\nepochs = 3\nrestarts = 1\n";
    let direct = "history_s = 0.5\nwindow_s = 1.0\n";
    let text_of = format!("[affine]\n{tiny}\n[network]\n{tiny}\n[direct]\n{tiny}{direct}");
    fs::write(at.join("tiny.toml"), text_of).unwrap();
    let args = "identify a.csv --validate b.csv --test c.csv --outputs u,v,r --methods affine,gru,direct -c tiny.toml --horizon 10 -o out -q";
    let identified = hydroid(at, args);
    assert!(identified.status.code() < Some(2), "{}", text(&identified.stderr));
    let steered = |rest: &str| {
        let args = format!("control out/{rest} --plant simple --radius 10 --speed 1 --duration 5 --json");
        let output = hydroid(at, &args);
        assert!(output.status.code() < Some(2), "{args}: {}", text(&output.stderr));
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(
            (&report["violations"], &report["undetected_losses"]),
            (&Value::from(0), &Value::from(0)),
            "{args}"
        );
        report
    };
    for law in ["fl", "backstepping"] {
        let report = steered(&format!("affine.safetensors --controller {law}"));
        assert!(report["rms_position"].as_f64().is_some(), "{report}");
    }
    let plan = "--controller cem --candidates 20 --iterations 2 --horizon 10";
    let frozen = steered(&format!("gru.safetensors {plan}"));
    let learning = steered(&format!("gru.safetensors {plan} --adapt"));
    assert_eq!(learning["controller"]["adapt"], true);
    assert_ne!(frozen["rms_position"], learning["rms_position"]);
    steered(&format!("direct.safetensors {plan} --adapt --learner least-squares"));
    let refused = |args: &str, words: &str| {
        let output = hydroid(at, &format!("control out/{args} --plant simple"));
        assert_eq!(output.status.code(), Some(2), "{args}");
        assert!(text(&output.stderr).contains(words), "{args}: {}", text(&output.stderr));
    };
    refused(
        "direct.safetensors --controller cem --adapt --learner kalman",
        "direct predictors adapt by least squares",
    );
    refused(
        "gru.safetensors --controller cem --adapt --learner least-squares",
        "needs equations or a direct predictor",
    );
    refused("affine.safetensors --controller fl --adapt", "cannot");
    let output = hydroid(at, "adapt out/direct.safetensors c.csv --forgetting 0.5");
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("at least 0.950 s are needed"), "{}", text(&output.stderr));
}

#[test]
fn adaptive_augmentation_reduces_the_error() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let sea = "--task lawn-mower --speed 1.5 --legs 2 --mass 1.2 --current 0,0.3 --seed 4 --json";
    let of = |law: &str| told(at, &format!("control hydrofoil --controller {law} {sea}"), 0);
    let (base, learned) = (of("fl"), of("fl --adaptive-augmentation"));
    let off = |report: &Value| report["rms_cross_track"].as_f64().unwrap();
    assert!(off(&learned) < 0.8 * off(&base), "{} beside {}", off(&learned), off(&base));
    let said = |report: &Value| report["controller"]["adaptive_augmentation"].as_bool();
    assert_eq!((said(&base), said(&learned)), (Some(false), Some(true)));
    assert_eq!(
        timeless(of("fl --adaptive-augmentation")),
        timeless(learned),
        "the same seed, the same voyage"
    );
    for (args, words) in [
        (
            "control hydrofoil --controller backstepping --adaptive-augmentation",
            "--adaptive-augmentation needs --controller fl",
        ),
        ("control hydrofoil --controller fl --adaptive-augmentation --adapt", "both learn the error"),
        (
            "control hydrofoil --controller fl --gauss-newton-steps 3",
            "--gauss-newton-steps needs --controller cem",
        ),
    ] {
        let output = hydroid(at, args);
        assert_eq!(output.status.code(), Some(2), "{args}");
        assert!(text(&output.stderr).contains(words), "{args}: {}", text(&output.stderr));
    }
}

#[test]
fn a_current_sets_in_and_is_estimated() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let sea = "--task lawn-mower --speed 1.5 --legs 2 --current 0,0.3 --onset 20s --seed 4 --json";
    let off = |law: &str| {
        let report = told(at, &format!("control hydrofoil --controller {law} {sea}"), 0);
        assert_eq!(report["conditions"]["onset_s"].as_f64(), Some(20.0));
        report["rms_cross_track"].as_f64().unwrap()
    };
    for law in ["fl", "backstepping"] {
        let (without, with) = (off(law), off(&format!("{law} --estimate-current 0.3")));
        assert!(with < 0.7 * without, "{law}: {with} beside {without}");
    }
    let output = hydroid(at, "control hydrofoil --controller pid --estimate-current 0.3");
    assert_eq!(output.status.code(), Some(2));
    assert!(
        text(&output.stderr).contains("needs a controller that predicts with a model"),
        "{}",
        text(&output.stderr)
    );
    // A log over ground in the same current.
    let output = hydroid(at, "simulate simple --duration 60 --current 0.2,-0.1 --noise 0 -o run.csv --json");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let log = fs::read_to_string(at.join("run.csv")).unwrap();
    let first: Vec<f64> = log.lines().nth(1).unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    let column =
        |name: &str| log.lines().next().unwrap().split(',').position(|c| c.trim().starts_with(name)).unwrap();
    assert_eq!((first[column("u")], first[column("v")]), (0.2, -0.1), "at rest in the water, heading north");
}

#[test]
fn pid_is_tuned_and_follows_lawn_mowers() {
    let folder = TempDir::new().unwrap();
    let lawn = "--task lawn-mower --leg 20 --legs 2 --radius 12 --speed 1.5";
    let report = told(folder.path(), &format!("control --plant simple --controller pid {lawn} --json"), 0);
    assert!(report["tuning"]["tried"].as_u64().unwrap() > 100);
    assert!(report["tuning"]["best"]["lookahead"].as_f64().unwrap() > 0.0);
    assert_eq!(report["arrived"], true);
    let points = "--task waypoints --points 0,0;40,0;40,30 --radius 10";
    let report =
        told(folder.path(), &format!("control simple --plant simple --controller fl {points} --json"), 0);
    assert_eq!(report["arrived"], true);
    fs::write(folder.path().join("route.csv"), "north [m],east [m]\n0,0\n40,0\n40,30\n").unwrap();
    let points = "--task waypoints --waypoints route.csv --radius 10";
    let by_file =
        told(folder.path(), &format!("control simple --plant simple --controller fl {points} --json"), 0);
    assert_eq!(report["task"]["path"], by_file["task"]["path"]);
    assert_eq!(report["rms_position"], by_file["rms_position"]);
}

#[test]
fn trials_are_summarized_and_a_failed_trial_has_exit_status_one() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let args = "control hydrofoil --controller fl --duration 30 --runs 6 --json -o many";
    let report = told(at, args, 0);
    assert_eq!((report["runs"].as_u64(), report["held"].as_u64()), (Some(6), Some(6)));
    assert_eq!((report["violations"].as_u64(), report["undetected_losses"].as_u64()), (Some(0), Some(0)));
    assert!(
        report["rms_position"]["median"].as_f64().unwrap() <= report["rms_position"]["max"].as_f64().unwrap()
    );
    assert_eq!(report["trials"].as_array().unwrap().len(), 6);
    assert!(fs::read_to_string(at.join("many/report.html")).unwrap().contains("Monte Carlo"));
    assert_eq!(timeless(told(at, &args.replace("-o many", "--threads 1"), 0)), timeless(report));
    // A current faster than the vessel.
    let report = told(at, "control hydrofoil --controller fl --current 5,0 --duration 30 --json", 1);
    assert!(report["settled_after"].is_null() && report["undetected_losses"] == 0);
    assert_eq!(report["held"], false);
}

/// The message about a late start of the evaluation states it in seconds.
#[test]
fn durations_are_in_seconds_minutes_or_hours() {
    let told = |from: &str| {
        let mut command = Command::cargo_bin("hydroid").unwrap();
        command.args(["control", "hydrofoil", "--controller", "fl", "--duration", "1"]);
        text(&command.arg(format!("--evaluate-from={from}")).output().unwrap().stderr)
    };
    for (written, seconds) in
        [("90", 90), ("90s", 90), ("1e3", 1000), ("5m", 300), ("1.5 h", 5400), (" 2 min ", 120)]
    {
        let told = told(written);
        assert!(told.contains(&format!("the evaluation starts at {seconds} s,")), "{written}: {told}");
    }
    for wrong in ["", "s", "-1", "0", "nan", "inf", "1d", "1e400", "5 5m"] {
        let told = told(wrong);
        assert!(told.contains("is not a duration"), "{wrong}: {told}");
    }
}

#[test]
fn wrong_input_is_refused_with_a_remedy() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let refused = |args: &str, words: &str| {
        let output = hydroid(at, args);
        assert_eq!(output.status.code(), Some(2), "{args}");
        assert!(text(&output.stderr).contains(words), "{args}: {}", text(&output.stderr));
    };
    refused("control --controller fl", "the model is missing");
    refused("control --controller pid", "the model is missing");
    refused("control none.safetensors --controller cem", "none.safetensors");
    refused("control hydrofoil --plant simple --controller cem", "--inputs PP_cmd,RD_cmd");
    refused("control hydrofoil --plant boat --controller fl", "boat");
    refused("control hydrofoil --controller fl --radius -3", "radius");
    refused("control hydrofoil --controller fl --speed 0", "speed");
    refused("control hydrofoil --controller fl --task waypoints", "waypoints are missing");
    refused("control hydrofoil --controller fl --task waypoints --points 0,0;1", "NORTH,EAST");
    refused("control hydrofoil --controller fl --leg 30", "lawn-mower");
    refused("control hydrofoil --controller fl --turn-speed 1", "has one speed");
    refused("control hydrofoil --controller fl --mass 0", "mass");
    refused("control hydrofoil --controller fl --delay=-1", "delay");
    refused("control hydrofoil --controller fl --delay 0.25", "give 0.2 or 0.3");
    refused(
        "control hydrofoil --controller fl --duration 30 --evaluate-from 30s",
        "a smaller --evaluate-from",
    );
    refused("control hydrofoil --controller fl --rate 2", "--rate needs --controller backstepping");
    refused("control hydrofoil --controller backstepping --bandwidth 1,1", "needs --controller fl");
    refused("control hydrofoil --controller backstepping --integral 1", "needs --controller fl");
    refused("control hydrofoil --controller fl --integral 5", "less than the product of the other two");
    refused("control hydrofoil --controller fl --candidates 10", "needs --controller cem");
    refused("control hydrofoil --controller fl --plan-time 10", "needs --controller cem");
    refused("control hydrofoil --controller fl --wind-variation 10", "add --runs");
    refused("control hydrofoil --controller fl --adapt --training-time 10s", "--training-log");
    refused("control hydrofoil --controller cem --candidates 100000 --horizon 1000", "reduce one of them");
    refused("control hydrofoil --controller cem --horizon 500", "or --gauss-newton-steps 0");
    refused("control hydrofoil --controller fl --adapt --learner least-squares", "a direct predictor");
    refused("control hydrofoil --controller fl --gusts 5,0", "gusts");
    refused("control hydrofoil --controller fl --runs 0", "number of runs");
    refused("control hydrofoil --controller fl --runs 3 --mass-variation 1", "dispersion");
    refused("control hydrofoil --controller fl --rate-limit PP_cmd=0", "--rate-limit PP_cmd=0");
    refused("control hydrofoil --controller fl --limit PP=0:100", "its commands are PP_cmd, RD_ang");
    refused("control hydrofoil --controller fl --limit RD_ang=-1:1[m]", "unit of RD_ang, [m]");
    refused(
        "control hydrofoil --controller fl --limit RD_ang=-31:30[deg]",
        "limits may be closer, and not wider",
    );
    refused("control hydrofoil --controller fl --neutral PP_cmd=900", "outside of its limits");
    refused("control hydrofoil --controller fl --reference path", "--reference");
    refused("control hydrofoil --controller cem --candidates 1", "candidates");
    refused("control hydrofoil --controller cem --learner kalman", "--adapt");
    refused("control hydrofoil --controller pid --adapt", "leave --adapt out");
    refused(
        "control hydrofoil --controller fl --task lawn-mower --radius 20 --spacing 30",
        "legs 30 m apart",
    );
}
