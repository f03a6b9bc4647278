//! `hydroid adapt .. --black-box`, `--replay`, and `hydroid inspect` on a recording.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use serde_json::Value;
use tempfile::TempDir;

fn hydroid(folder: &Path, args: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hydroid"));
    command.current_dir(folder).args(args.split(' '));
    command
}

fn ended(args: &str, status: i32) -> Output {
    let output = hydroid(prepared(), args).output().unwrap();
    assert_eq!(output.status.code(), Some(status), "{args}: {}", text(&output.stderr));
    output
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn values(bytes: &[u8]) -> Vec<Value> {
    text(bytes).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// A model of the simple vessel, and a log; computed once.
fn prepared() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER
        .get_or_init(|| {
            let folder = TempDir::new().unwrap();
            for args in [
                "simulate simple --seed 1 --duration 300 -o a.csv",
                "simulate simple --seed 2 --duration 300 -o b.csv",
                "simulate simple --seed 3 --duration 300 -o c.csv",
                "identify a.csv --validate b.csv --test c.csv --outputs u,v,r,P_f --methods sindy -o out -q",
            ] {
                let output = hydroid(folder.path(), args).output().unwrap();
                assert_eq!(output.status.code(), Some(0), "{args}: {}", text(&output.stderr));
            }
            folder
        })
        .path()
}

const MODEL: &str = "out/sindy.safetensors";

/// Sends lines, kills the service after the last answer, and returns the answers.
fn killed(args: &str, lines: usize) -> Vec<Value> {
    let mut child = hydroid(prepared(), args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let mut answers = BufReader::new(child.stdout.take().unwrap()).lines();
    let mut all = Vec::new();
    let log = fs::read_to_string(prepared().join("c.csv")).unwrap();
    let surge = log.lines().next().unwrap().split(',').position(|name| name.starts_with("u [")).unwrap();
    for (k, line) in log.lines().take(lines).enumerate() {
        let mut cells: Vec<&str> = line.split(',').collect();
        if k % 500 == 250 {
            cells[surge] = "25";
        }
        writeln!(stdin, "{}", cells.join(",")).unwrap();
        if k > 0 {
            all.push(serde_json::from_str(&answers.next().unwrap().unwrap()).unwrap());
        }
    }
    child.kill().unwrap();
    child.wait().unwrap();
    all
}

#[test]
fn the_recording_of_a_killed_service_is_replayed_and_inspected() {
    for (name, options) in [("squares", ""), ("filter", " --learner kalman"), ("free", " --no-guard")] {
        let file = format!("{name}.box");
        let serve = format!("adapt {MODEL} - --horizons 1,20 --black-box {file}{options}");
        let answers = killed(&serve, 1500);
        let replay = format!("adapt {MODEL} --replay {file}");
        let said = text(&ended(&replay, 0).stdout);
        let samples: usize =
            said.strip_suffix(" samples replayed, all identical\n").unwrap().parse().unwrap();
        assert!((answers.len() - 10..=answers.len()).contains(&samples), "{samples} of {}", answers.len());

        let once = ended(&format!("{replay} --json"), 0);
        assert!(once.stdout == ended(&format!("{replay} --json"), 0).stdout, "the same bytes twice");
        let steps = values(&once.stdout);
        assert_eq!(steps.len(), samples);
        for (step, answer) in steps.iter().zip(&answers) {
            for key in ["t", "status", "innovation", "nis", "estimate", "prediction"] {
                assert_eq!(step[key], answer[key], "{key}");
            }
            assert_eq!(step["active"], answer["predicted_by"]);
        }

        let message = text(&ended(&format!("inspect {file}"), 0).stdout);
        for words in ["black box of hydroid", "from standard input", "outputs u [m/s]", " accepted, "] {
            assert!(message.contains(words), "{words}: {message}");
        }
        let guarded = name != "free";
        assert_eq!(message.contains("no events"), !guarded, "{message}");
        let spike = message.lines().find(|line| line.contains("spike") && line.contains("rejected"));
        assert_eq!(spike.is_some_and(|line| line.contains("u deviates")), guarded, "{message}");
        assert_eq!(message.contains("by the adapted model"), guarded);
        let inspected = ended(&format!("inspect {file} --json"), 0);
        let inspected: Value = serde_json::from_slice(&inspected.stdout).unwrap();
        assert_eq!(inspected["kind"], "black_box");
        assert_eq!(inspected["samples"], samples);
        assert_eq!(inspected["t"][0], 0.0);
        assert!(inspected["head"]["settings"]["learning"]["method"].is_string());
    }
    // A restart appends to the file; other options are refused.
    killed(&format!("adapt {MODEL} - --black-box squares.box"), 100);
    let message = text(&ended("inspect squares.box", 0).stdout);
    assert!(message.contains("2 segments in time"), "{message}");
    ended(&format!("adapt {MODEL} --replay squares.box"), 0);
    let refused = ended(&format!("adapt {MODEL} c.csv --stream --prior 3 --black-box squares.box"), 2);
    let refused = text(&refused.stderr);
    assert!(
        refused.contains("prior_s: 10.0 in the file, 3.0 given") && refused.contains("move it"),
        "{refused}"
    );
}

#[test]
fn a_complete_log_is_recorded_too() {
    let adapted = hydroid(prepared(), &format!("adapt {MODEL} c.csv --black-box log.box --json -q")).output();
    let with: Value = serde_json::from_slice(&adapted.unwrap().stdout).unwrap();
    let adapted = hydroid(prepared(), &format!("adapt {MODEL} c.csv --json -q")).output();
    let without: Value = serde_json::from_slice(&adapted.unwrap().stdout).unwrap();
    assert_eq!(with["adapted"], without["adapted"], "to note it changes nothing");
    let rows = fs::read_to_string(prepared().join("c.csv")).unwrap().lines().count() - 1;
    let said = text(&ended(&format!("adapt {MODEL} --replay log.box"), 0).stdout);
    assert_eq!(said, format!("{rows} samples replayed, all identical\n"));
    let message = text(&ended("inspect log.box", 0).stdout);
    assert!(message.contains("from c.csv, sample time 0.1 s"), "{message}");
}

#[test]
fn unusable_files_are_refused_with_a_remedy() {
    let refused = |args: &str, words: &str| {
        let message = text(&ended(args, 2).stderr);
        assert!(message.contains(words) && !message.contains("panicked"), "{args}: {message}");
    };
    let at = prepared();
    ended(&format!("adapt {MODEL} c.csv --stream -q --black-box kept.box -o learned.safetensors"), 0);
    refused(
        "adapt learned.safetensors --replay kept.box",
        "another model; give the unchanged model file with which it was written",
    );
    refused(&format!("adapt {MODEL} --replay c.csv"), "not a black box");
    refused(&format!("adapt {MODEL} --replay none.box"), "name another file");
    refused(&format!("adapt {MODEL} c.csv --replay kept.box"), "cannot be used with");
    refused(&format!("adapt {MODEL} --replay kept.box --prior 3"), "cannot be used with");
    refused(&format!("adapt {MODEL}"), "LOG|-");
    refused(&format!("adapt {MODEL} c.csv --black-box a.csv"), "not overwritten");
    refused(&format!("adapt {MODEL} c.csv --stream --black-box ."), "name a file");
    refused(&format!("adapt {MODEL} c.csv --black-box x.box --black-box-minutes 1"), "give 2 to");
    refused(&format!("adapt {MODEL} c.csv --black-box-minutes 5"), "--black-box");
    refused("inspect kept.box --latex", "is a black box");
    let bytes = fs::read(at.join("kept.box")).unwrap();
    for (name, place, words) in [
        ("head.box", 30, "the header is damaged"),
        ("version.box", 8, "reads format 4"),
        ("middle.box", bytes.len() - 120_000, "damaged; copy the file again"),
    ] {
        let mut damaged = bytes.clone();
        damaged[place] ^= 64;
        fs::write(at.join(name), damaged).unwrap();
        refused(&format!("adapt {MODEL} --replay {name}"), words);
    }
    let message = ended("inspect middle.box", 0);
    assert!(text(&message.stderr).contains("the file is damaged"), "{}", text(&message.stderr));
    // A truncated file is a shorter recording.
    fs::write(at.join("cut.box"), &bytes[..bytes.len() - 1000]).unwrap();
    ended(&format!("adapt {MODEL} --replay cut.box"), 0);
}

/// A full disk does not stop the service: it is reported once, and earlier records can be replayed.
#[cfg(unix)]
#[test]
fn a_full_disk_stops_the_recording_only() {
    let script = format!(
        "ulimit -f 200; trap '' XFSZ; exec \"$0\" adapt {MODEL} c.csv --stream --black-box full.box --horizons 1"
    );
    let output = Command::new("sh")
        .current_dir(prepared())
        .args(["-c", &script, env!("CARGO_BIN_EXE_hydroid")])
        .output()
        .unwrap();
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{message}");
    let rows = fs::read_to_string(prepared().join("c.csv")).unwrap().lines().count() - 1;
    assert_eq!(text(&output.stdout).lines().count(), rows, "all lines are answered");
    assert_eq!(message.matches("black box cannot be written: cannot write").count(), 1, "{message}");
    let said = text(&ended(&format!("adapt {MODEL} --replay full.box"), 0).stdout);
    assert!(said.ends_with("all identical\n") && !said.starts_with("0 "), "{said}");
}

/// The saved state covers rehearsal: a replay needs neither training logs nor logs with faults.
#[test]
fn replay_needs_no_vessel_file_training_log_or_faults() {
    ended("simulate hydrofoil --seed 5 --duration 60 -o h.csv", 0);
    let options = "c.csv --training-log a.csv --inject spikes=0.01,dropout=u:10s";
    for (model, log) in [("hydrofoil", "h.csv --horizon 10"), (MODEL, options)] {
        let adapted =
            hydroid(prepared(), &format!("adapt {model} {log} -q --black-box d.box")).output().unwrap();
        assert!(matches!(adapted.status.code(), Some(0 | 1)), "{log}: {}", text(&adapted.stderr));
        let said = text(&ended(&format!("adapt {model} --replay d.box"), 0).stdout);
        assert!(said.ends_with("all identical\n"), "{said}");
    }
}
