//! `hydroid adapt` on a direct predictor trained at low speed and adapted while foiling.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::Stdio;
use std::sync::OnceLock;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{command, run, text};

/// A small network of low speed, and a log beyond its training range; computed once.
fn prepared() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let settings = "[direct]\nhidden = 24\nlayers = 2\nhistory_s = 0.4\nepochs = 12\nrestarts = 1\nensemble = false\nbase = \"nothing\"\n";
    let identify = "identify a.csv --validate b.csv --test c.csv --outputs u,v,r --methods direct -c net.toml --horizon 20 --ranges u=0:6,v=-1.5:1.5,r=-1:1,PP_cmd=-130:350 -o out -q";
    FOLDER.get_or_init(|| crate::low_speed::folder(settings, identify)).path()
}

const MODEL: &str = "out/direct.safetensors";

fn report(args: &str) -> Value {
    let output = run(prepared(), args);
    assert_eq!(output.status.code(), Some(0), "{args}: {}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_direct_predictor_adapts_to_foiling_and_is_written_with_its_history() {
    let args = format!("adapt {MODEL} lawn.csv --against truth --horizon 20 --json");
    let alone = report(&format!("{args} --no-guard -o adapted.safetensors"));
    let guarded = report(&args);
    for report in [&alone, &guarded] {
        let mae = |part: &str, step: usize| report[part]["mae"][step - 1][0].as_f64().unwrap();
        for step in [1, 5, 20] {
            assert!(mae("adapted", step) < 0.6 * mae("frozen", step), "{step}: {report}");
        }
        assert_eq!(report["adapted"]["diverged"], 0);
        assert_eq!(report["settings"]["method"], "last_layer");
        let coverage = report["coverage"]["95"].as_f64().unwrap();
        assert!((0.75..=1.0).contains(&coverage), "{coverage}");
    }
    assert!(guarded["guard"]["predicted_by"][0].as_u64().unwrap() > 500, "{}", guarded["guard"]);
    let inspected = run(prepared(), "inspect adapted.safetensors --json");
    let inspected: Value = serde_json::from_slice(&inspected.stdout).unwrap();
    let adapted = &inspected["description"]["provenance"]["settings"]["adapted"][0];
    assert_eq!(adapted["runs"][0], "lawn.csv");
    assert_eq!(adapted["settings"], alone["settings"]);
    let error = |model: &str| {
        let judged =
            run(prepared(), &format!("evaluate {model} lawn.csv --against truth --horizon 20 --json -q"));
        let judged: Value = serde_json::from_slice(&judged.stdout).unwrap();
        judged["mae"][19][0].as_f64().unwrap()
    };
    assert!(error("adapted.safetensors") < 0.6 * error(MODEL));
}

#[test]
fn invalid_input_is_refused() {
    for (options, words) in [
        ("--learner kalman", "by least squares"),
        ("--weight-variance 0.1", "a recurrent network"),
        ("--window 1", "is an option of equations"),
        ("--all-terms", "is an option of equations"),
        ("--prior 0", "weight of the reference model"),
        ("--forgetting 0", "forgetting"),
        ("--forgetting=-1", "forgetting"),
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
    let whole =
        run(at, &format!("adapt {MODEL} lawn.csv {options} -o whole.safetensors --black-box direct.box"));
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
            // Windows of 4 past and 20 future samples; 30 windows until bands are available.
            assert!(answer["status"] == "accepted" || answer["status"] == "waiting", "{answer}");
            assert!(k < 60 || answer["band_95"]["u"][1].as_f64().unwrap() > 0.0, "{answer}");
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
    // The black box is sufficient for a replay.
    let replayed = run(at, &format!("adapt {MODEL} --replay direct.box"));
    assert_eq!(replayed.status.code(), Some(0), "{}{}", text(&replayed.stdout), text(&replayed.stderr));
}
