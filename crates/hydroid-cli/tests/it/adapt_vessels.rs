//! `hydroid adapt` on a vessel whose parameters have changed.

use std::fs;
use std::path::Path;
use std::process::Output;
use std::sync::OnceLock;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn hydroid(folder: &Path, args: &str) -> Output {
    let mut command = Command::cargo_bin("hydroid").unwrap();
    command.current_dir(folder).args(args.split(' ')).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn done(args: &str) -> String {
    let output = hydroid(prepared(), args);
    assert_eq!(output.status.code(), Some(0), "{args}: {}", text(&output.stderr));
    text(&output.stdout)
}

fn json(args: &str) -> Value {
    serde_json::from_str(&done(args)).unwrap()
}

/// Logs of the hydrofoil with 1.3 times the surge drag; computed once.
fn prepared() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER
        .get_or_init(|| {
            let folder = TempDir::new().unwrap();
            let at = folder.path();
            let vessel = text(&hydroid(at, "simulate hydrofoil --print-vessel").stdout);
            let fouled = vessel.replace("[[20.0,", "[[26.0,").replace("[[18.65,", "[[24.245,");
            assert_ne!(vessel, fouled);
            fs::write(at.join("given.toml"), vessel).unwrap();
            fs::write(at.join("fouled.toml"), fouled).unwrap();
            for (vessel, seed, dt, file) in
                [("fouled", 7, 0.1, "a.csv"), ("fouled", 8, 0.1, "b.csv"), ("fouled", 9, 0.05, "fast.csv")]
            {
                let args = format!("simulate {vessel}.toml --duration 300 --seed {seed} --dt {dt} -o {file}");
                assert_eq!(hydroid(at, &args).status.code(), Some(0));
            }
            folder
        })
        .path()
}

#[test]
fn the_drag_of_a_vessel_is_estimated_and_written_to_a_vessel_file() {
    let report = json("adapt given.toml a.csv -o learned.toml --against truth --json");
    let rmse = |report: &Value, part: &str, step: usize| report[part]["rmse"][step - 1][0].as_f64().unwrap();
    for step in [10, 100] {
        for part in ["frozen", "frozen_filtered"] {
            let (adapted, other) = (rmse(&report, "adapted", step), rmse(&report, part, step));
            assert!(adapted < 0.5 * other, "{step} {part}: {adapted} {other}");
        }
    }
    assert_eq!(report["settings"]["method"], "kalman");
    let parameters = report["parameters"].as_array().unwrap();
    let drag = parameters.iter().find(|p| p["path"] == "drag.quadratic[0][0]").unwrap();
    assert_eq!(drag["given"], 18.65);
    assert!((drag["learned"].as_f64().unwrap() / 24.245 - 1.0).abs() < 0.05, "{drag}");

    // The adapted vessel can be simulated, evaluated and inspected, and is better on another log.
    done("simulate learned.toml --duration 10 -o again.csv");
    let judged = |model: &str| {
        let judged = json(&format!("evaluate {model} b.csv --against truth --json"));
        judged["rmse"][99][0].as_f64().unwrap()
    };
    assert!(judged("learned.toml") < 0.3 * judged("hydrofoil"));
    assert_eq!(judged("given.toml"), judged("hydrofoil"));
    let inspected = json("inspect learned.toml --json");
    assert_eq!(inspected["kind"], "craft");
    assert_eq!(inspected["numbers"]["drag.quadratic[0][0]"]["value"], drag["learned"]);
    let history = &inspected["description"]["provenance"]["settings"]["adapted"];
    assert_eq!(history[0]["runs"][0], "a.csv");
    assert_eq!(history[0]["settings"], report["settings"]);
    assert!(done("inspect learned.toml").contains("flying.transition_speed"));
    hydroid(prepared(), "adapt learned.toml b.csv -o twice.toml -q");
    let twice = json("inspect twice.toml --json");
    assert_eq!(twice["description"]["provenance"]["settings"]["adapted"].as_array().unwrap().len(), 2);
    let message = done("adapt given.toml a.csv -q");
    assert!(message.contains("filtered") && message.contains("drag.linear[0][0]"), "{message}");
}

#[test]
fn every_reduced_covariance_adapts() {
    let mut frozen = None;
    for option in ["--covariance blocks:1", "--huber 3 --leak 3600"] {
        let report =
            json(&format!("adapt given.toml a.csv --against truth --origin-stride 10 --json {option}"));
        let rmse = |part: &str| report[part]["rmse"][99][0].as_f64().unwrap();
        assert!(rmse("adapted") < 0.6 * rmse("frozen"), "{option}: {} {}", rmse("adapted"), rmse("frozen"));
        assert_eq!(*frozen.get_or_insert(rmse("frozen")), rmse("frozen"));
    }
}

#[test]
fn a_vessel_takes_the_sample_time_and_the_columns_of_the_log() {
    let report = json("adapt given.toml fast.csv --horizon 5s --json");
    assert_eq!(report["adapted"]["horizons"].as_array().unwrap().len(), 100);
    let log = fs::read_to_string(prepared().join("a.csv")).unwrap();
    let renamed = log.replacen("PP_cmd [N],RD_ang [rad]", "thrust [N],rudder [rad]", 1);
    fs::write(prepared().join("renamed.csv"), renamed).unwrap();
    let same = json("adapt given.toml a.csv --json");
    let renamed = json("adapt given.toml renamed.csv --inputs PP_cmd=thrust,RD_ang=rudder --json");
    assert_eq!(renamed["adapted"]["rmse"], same["adapted"]["rmse"]);
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn a_vessel_on_a_stream_resumes_to_the_same_bytes() {
    let at = prepared();
    let options = "--horizons 1,20 -q";
    let whole = done(&format!("adapt hydrofoil a.csv --stream {options} -o whole.toml"));
    let last: Value = serde_json::from_str(whole.lines().last().unwrap()).unwrap();
    assert_eq!(last["status"], "accepted", "{last}");
    assert!(last["band_95"]["u"][1].as_f64().unwrap() > 0.0, "{last}");
    let log = fs::read_to_string(at.join("a.csv")).unwrap();
    let head: Vec<&str> = log.lines().take(1001).collect();
    fs::write(at.join("head.csv"), head.join("\n") + "\n").unwrap();
    done(&format!("adapt hydrofoil head.csv --stream {options} --state kept.state"));
    let rest = done(&format!("adapt hydrofoil a.csv --stream {options} --state kept.state -o resumed.toml"));
    let whole: Vec<&str> = whole.lines().collect();
    let is_repeated = |line: &&str| line.contains("\"status\":\"repeated\"");
    let (repeated, rest): (Vec<&str>, Vec<&str>) = rest.lines().partition(is_repeated);
    assert_eq!((repeated.len(), rest.len()), (1000, 2000));
    assert_eq!(rest, whole[1000..]);
    let file = |name: &str| fs::read(at.join(name)).unwrap();
    assert_eq!(file("whole.toml"), file("resumed.toml"));
    // The state of another vessel is refused.
    let other = hydroid(at, &format!("adapt simple a.csv --stream {options} --state kept.state"));
    assert_eq!(other.status.code(), Some(2));
}

#[test]
fn invalid_input_is_refused() {
    fs::write(prepared().join("broken.toml"), "name = 'x'\nmast = 3\n").unwrap();
    for (args, words) in [
        ("adapt given.toml a.csv -o learned.safetensors", "ends in .toml"),
        ("adapt given.toml a.csv --learner least-squares", "adapts by the extended Kalman filter"),
        ("adapt given.toml a.csv --prior 3", "recursive least squares"),
        ("adapt given.toml a.csv --noise u=0.01", "'v' is missing"),
        ("adapt given.toml a.csv --outputs u,v", "outputs"),
        ("adapt simple a.csv", "RD_cmd"),
        ("adapt none.toml a.csv", "none.toml"),
        ("adapt broken.toml a.csv", "line 2"),
        ("adapt hydrofoyl a.csv", "hydrofoyl"),
        ("inspect given.toml --latex", "vessel"),
    ] {
        let output = hydroid(prepared(), args);
        assert_eq!(output.status.code(), Some(2), "{args}");
        let message = text(&output.stderr);
        assert!(message.contains(words) && !message.contains("panicked"), "{args}: {message}");
    }
    let help = done("adapt --help").split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(help.contains("learned.toml") && help.contains("vessel file"), "{help}");
}
