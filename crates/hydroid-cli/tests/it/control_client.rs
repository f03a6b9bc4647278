//! The control service and a client in Python, which integrates a boat of its own and kills the service twice.
//!
//! The Python is `HYDROID_PYTHON` or `python3`; without it the tests pass with a message.

use std::io::Write as _;
use std::process::{Command, Stdio};

use serde_json::{Value, json};

const CLIENT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/peers/control_client.py");

/// Largest distance of the boat from its path \[m\]. The first runs had 0.07 m.
const CORRIDOR_M: f64 = 0.3;
/// Largest cross-track error in the answers, whose positions have a noise of 0.05 m. The first runs had 0.23 m.
const MEASURED_CORRIDOR_M: f64 = 0.5;

fn python() -> Option<String> {
    let python = std::env::var("HYDROID_PYTHON").unwrap_or_else(|_| String::from("python3"));
    let there = Command::new(&python)
        .args(["-c", "import sys; sys.exit(sys.version_info < (3, 8))"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success());
    if !there {
        let _ = writeln!(
            std::io::stderr(),
            "skipped: no Python (install Python 3.8 or later, or name one in HYDROID_PYTHON)"
        );
    }
    there.then_some(python)
}

/// Runs the client, checks its report and prints it. The latencies in it are not checked.
fn sail(size: &[&str], options: &[&str]) -> Option<Value> {
    let output = Command::new(python()?)
        .arg(CLIENT)
        .arg(env!("CARGO_BIN_EXE_hydroid"))
        .args(size)
        .arg("--")
        .args(options)
        .output()
        .unwrap();
    let (report, notes) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{options:?}: {report}{notes}");
    println!("{options:?}: {report}");
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!((&report["arrived"], &report["kills"]), (&json!(true), &json!(2)), "{options:?}: {report}");
    assert_eq!(report["exit_status"], 0, "{options:?}: {report}");
    for (key, limit) in
        [("largest_distance_from_path_m", CORRIDOR_M), ("largest_cross_track_m", MEASURED_CORRIDOR_M)]
    {
        assert!(report[key].as_f64().unwrap() < limit, "{options:?}: {report}");
    }
    Some(report)
}

#[test]
fn a_python_client_keeps_its_boat_in_a_corridor() {
    sail(&["--legs", "2", "--leg", "40"], &["--controller", "fl", "--horizons", "10"]);
}

/// 31 minutes for each controller. With `--adapt`, the boat has a drag 30 % above that of the model.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn a_boat_of_a_python_client_stays_in_its_corridor_for_half_an_hour() {
    for (size, options) in [
        (&[][..], &["--controller", "fl", "--horizons", "10"][..]),
        (&["--drag", "1.3"], &["--controller", "fl", "--adapt", "--horizons", "10"]),
        (&["--drag", "1.3"], &["--controller", "backstepping", "--adapt", "--horizons", "10"]),
    ] {
        let Some(report) = sail(size, options) else { return };
        assert!(report["simulated_s"].as_f64().unwrap() > 1800.0, "{report}");
        if options.contains(&"--adapt") {
            assert!(report["predicted_by"]["adapted"].as_f64().unwrap() > 1000.0, "{report}");
        }
    }
}
