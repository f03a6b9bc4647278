//! Signals, stalled readers and full disks: files stay whole, at most the last second is lost, and it is said.

use std::fs;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::common::{Limit, MODEL, Service, hydroid, output, signal, simple_vessel, text};

fn lines() -> Vec<String> {
    fs::read_to_string(simple_vessel().join("c.csv")).unwrap().lines().map(str::to_owned).collect()
}

/// A folder with the model and its log.
fn prepared() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::create_dir(folder.path().join("out")).unwrap();
    for file in [MODEL, "c.csv"] {
        fs::copy(simple_vessel().join(file), folder.path().join(file)).unwrap();
    }
    folder
}

fn ended(mut child: Child) -> Option<i32> {
    let _limit = Limit::of(&child);
    child.wait().unwrap().code()
}

/// Time of the state, from the note of a service that resumes.
fn saved_at(at: &Path, args: &[&str]) -> f64 {
    let mut service = Service::start(at, args);
    let t = service.resumed_at();
    service.kill();
    t
}

fn time_of(answer: &str) -> f64 {
    serde_json::from_str::<Value>(answer).unwrap()["t"].as_f64().unwrap()
}

/// Files of killed or refused writes.
fn leftovers(at: &Path) -> Vec<String> {
    let names = fs::read_dir(at).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.starts_with('.')).collect()
}

/// A busy stream had no pause in which a signal could end the service.
#[test]
fn a_signal_on_a_busy_stream_ends_with_the_state_of_the_last_answer() {
    for stop in ["-TERM", "-INT"] {
        let folder = prepared();
        let at = folder.path();
        let args = ["adapt", MODEL, "-", "--state", "s", "-o", "new.safetensors", "-q"];
        let mut child = hydroid(at, &args).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let _limit = Limit::of(&child);
        let mut stdin = child.stdin.take().unwrap();
        let lines = lines();
        let feeder = std::thread::spawn(move || {
            let _ = writeln!(stdin, "{}", lines[0]);
            let row: Vec<&str> = lines[1].split(',').collect();
            for k in 0..u32::MAX {
                if writeln!(stdin, "{},{}", 0.1 * f64::from(k), row[1..].join(",")).is_err() {
                    return;
                }
            }
        });
        let mut last = String::new();
        let mut count = 0;
        for answer in BufReader::new(child.stdout.take().unwrap()).lines() {
            last = answer.unwrap();
            count += 1;
            if count == 300 {
                signal(&child, stop);
            }
        }
        assert_eq!(ended(child), Some(130));
        feeder.join().unwrap();
        assert!(at.join("new.safetensors").exists());
        let saved = saved_at(at, &["adapt", MODEL, "-", "--state", "s"]);
        assert!((saved - time_of(&last)).abs() < 1e-9, "{saved} {last}");
        let files = leftovers(at);
        assert!(files.iter().all(|name| name == ".s.lock"), "{files:?}");
    }
}

/// A line whose plan takes seconds is finished before the service ends.
#[test]
fn a_signal_during_a_long_line_ends_with_its_state() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let line = |t: f64| json!({ "t": t, "x": 0, "y": 0, "psi": 0, "u": 1.5, "v": 0, "r": 0 }).to_string();
    let start = |candidates: &str| {
        let mut service = planner(at, candidates);
        let begun = Instant::now();
        service.ask(&line(5.0));
        (service, begun.elapsed().as_secs_f64())
    };
    // As many candidates as this machine tries in two seconds.
    let (first, taken_s) = start("2000");
    first.kill();
    // It may have been killed before it saved its state.
    let _ = fs::remove_file(at.join("s"));
    let candidates = format!("{:.0}", (2_000.0 * 2.0 / taken_s).clamp(2_000.0, 190_000.0));
    let (mut service, _) = start(&candidates);
    service.send(&line(5.1));
    std::thread::sleep(Duration::from_millis(300));
    signal(&service.child, "-TERM");
    let answer = service.answer();
    assert!(answer.contains("\"t\":5.1"), "the line is answered: {answer}");
    let (code, notes) = service.end();
    assert_eq!(code, Some(130), "{notes}");
    let mut again = planner(at, &candidates);
    assert!((again.resumed_at() - 5.1).abs() < 1e-9);
    again.kill();
}

fn planner(at: &Path, candidates: &str) -> Service {
    let args = "control hydrofoil --controller cem --horizon 50 --task lawn-mower --horizons 1 --state s - --candidates";
    Service::start(at, &args.split(' ').chain([candidates]).collect::<Vec<_>>())
}

/// A reader that takes no answers blocks the service. It still ends, and loses at most a second.
#[test]
fn a_stalled_reader_costs_at_most_a_second() {
    let folder = prepared();
    let at = folder.path();
    let args = ["adapt", MODEL, "-", "--state", "s", "-q"];
    let mut child = hydroid(at, &args).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let _limit = Limit::of(&child);
    let mut stdin = child.stdin.take().unwrap();
    let lines = lines();
    let feeder = std::thread::spawn(move || {
        for line in &lines {
            if writeln!(stdin, "{line}").is_err() {
                return;
            }
        }
        // The end of the input would end the service.
        std::thread::sleep(Duration::from_secs(30));
    });
    // Long enough for the pipe to be full.
    std::thread::sleep(Duration::from_millis(1_500));
    assert!(child.try_wait().unwrap().is_none(), "it waits");
    signal(&child, "-TERM");
    let out = child.stdout.take().unwrap();
    assert_eq!(ended(child), Some(130));
    let answers: Vec<String> = BufReader::new(out).lines().map_while(Result::ok).collect();
    let whole = answers.iter().rfind(|line| line.ends_with('}')).unwrap();
    let saved = saved_at(at, &["adapt", MODEL, "-", "--state", "s"]);
    assert!(answers.len() > 20 && saved > time_of(whole) - 1.2, "{saved} {whole}");
    drop(feeder);
}

/// The same command under a limit of file sizes, which can be changed while it runs: beyond it, writes fail as on a full
/// disk.
fn limited(at: &Path, args: &[&str]) -> Command {
    let mut command = Command::new("sh");
    let script = "trap '' XFSZ; exec \"$0\" \"$@\"";
    command.current_dir(at).args(["-c", script, env!("CARGO_BIN_EXE_hydroid")]).args(args);
    command
}

fn set_limit(child: &Child, bytes: &str) -> bool {
    let limit = format!("--fsize={bytes}:unlimited");
    Command::new("prlimit")
        .args(["--pid", &child.id().to_string(), &limit])
        .status()
        .is_ok_and(|s| s.success())
}

/// The disk is full from a sample on, and has space again or not.
#[test]
fn a_full_disk_costs_at_most_a_second_and_is_said() {
    for space_again in [true, false] {
        let folder = prepared();
        let at = folder.path();
        let args = ["adapt", MODEL, "-", "--state", "s", "--black-box", "b", "-o", "new.safetensors"];
        let mut service = Service::of(&mut limited(at, &args));
        let lines = lines();
        service.send(&lines[0]);
        for line in &lines[1..150] {
            service.ask(line);
        }
        if !set_limit(&service.child, "100") {
            eprintln!("skipped: no prlimit");
            return;
        }
        let full_at = time_of(&service.ask(&lines[150]).to_string());
        for line in &lines[151..300] {
            let answer = service.ask(line);
            assert!(answer["prediction"]["u"][0].is_f64(), "{answer}");
        }
        if space_again {
            assert!(set_limit(&service.child, "unlimited"));
            for line in &lines[300..320] {
                service.ask(line);
            }
        }
        drop(service.child.stdin.take());
        let (code, notes) = service.end();
        // The vessel of these lines may end stopped.
        assert_eq!(code == Some(2), !space_again, "{notes}");
        assert_eq!(notes.matches("warning: the black box cannot be written").count(), 1, "{notes}");
        assert!(notes.matches("warning: cannot write").count() >= 1, "{notes}");
        assert_eq!(at.join("new.safetensors").exists(), space_again);
        let replay = output(&mut hydroid(at, &["adapt", MODEL, "--replay", "b"]));
        let said = text(&replay.stdout);
        assert!(said.ends_with("all identical\n"), "{said} {}", text(&replay.stderr));
        let saved = saved_at(at, &["adapt", MODEL, "-", "--state", "s"]);
        let last = if space_again { 0.1 * 318.0 } else { full_at };
        assert!(saved > last - 1.2 && saved < last + 0.2, "{saved} {last}");
        assert!(leftovers(at).iter().all(|name| name == ".s.lock"), "{:?}", leftovers(at));
    }
}

/// Answers go to a file on a full disk: the service ends, and leaves state and model.
#[test]
fn answers_on_a_full_disk_end_the_service_with_its_state() {
    let folder = prepared();
    let at = folder.path();
    let script = format!(
        "trap '' XFSZ; ulimit -f 200; exec \"$0\" adapt {MODEL} c.csv --stream --state s -o new.safetensors > answers"
    );
    let done =
        output(Command::new("sh").current_dir(at).args(["-c", &script, env!("CARGO_BIN_EXE_hydroid")]));
    let said = text(&done.stderr);
    assert_eq!(done.status.code(), Some(2), "{said}");
    assert!(said.contains("answers cannot be written"), "{said}");
    let answers = fs::read_to_string(at.join("answers")).unwrap();
    let whole: Vec<&str> = answers.lines().filter(|line| line.ends_with('}')).collect();
    assert!(at.join("new.safetensors").exists());
    let saved = saved_at(at, &["adapt", MODEL, "-", "--state", "s"]);
    assert!((saved - time_of(whole[whole.len() - 1])).abs() < 0.11, "{saved}");
}

/// A new state on a full disk ended the service after one answer.
#[test]
fn a_new_state_on_a_full_disk_does_not_end_the_service() {
    for (space_again, model) in [(false, MODEL), (true, MODEL), (true, "hydrofoil")] {
        let folder = prepared();
        let at = folder.path();
        let args = if model == MODEL {
            vec!["adapt", MODEL, "-", "--state", "s"]
        } else {
            vec!["control", "hydrofoil", "--controller", "fl", "--state", "s", "-"]
        };
        let mut service = Service::of(&mut limited(at, &args));
        if !set_limit(&service.child, "100") {
            eprintln!("skipped: no prlimit");
            return;
        }
        let lines: Vec<String> = if model == MODEL {
            lines()
        } else {
            let line = |k: u32| {
                format!(r#"{{"t":{},"x":0,"y":0,"psi":0,"u":1.5,"v":0,"r":0}}"#, f64::from(k) / 10.0)
            };
            (0..300).map(line).collect()
        };
        let first = usize::from(model == MODEL);
        if first == 1 {
            service.send(&lines[0]);
        }
        for line in &lines[first..200] {
            let answer = service.ask(line);
            assert!(answer["prediction"]["u"][0].is_f64(), "{answer}");
        }
        if space_again {
            assert!(set_limit(&service.child, "unlimited"));
            for line in &lines[200..220] {
                service.ask(line);
            }
        }
        drop(service.child.stdin.take());
        let (code, notes) = service.end();
        // The vessel of these lines may end stopped.
        assert_eq!(code == Some(2), !space_again, "{notes}");
        assert_eq!(notes.matches("warning: cannot write").count(), 1, "{notes}");
        assert_eq!(at.join("s").exists(), space_again);
    }
}

/// A state in a place that is no folder is an error before the first line.
#[test]
fn a_state_that_can_never_be_written_is_an_error_at_once() {
    let folder = prepared();
    let done =
        output(&mut hydroid(folder.path(), &["adapt", MODEL, "c.csv", "--stream", "--state", "c.csv/s"]));
    assert_eq!(done.status.code(), Some(2));
    assert!(done.stdout.is_empty(), "{}", text(&done.stdout));
    assert!(text(&done.stderr).contains("c.csv"), "{}", text(&done.stderr));
}
