//! Inputs that once made the command misbehave, each named after its story.

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::common::{Service, hydroid, output, text};

/// A log of the hydrofoil.
fn log(folder: &Path) {
    let args = ["simulate", "hydrofoil", "--duration", "60", "--seed", "1", "-o", "log.csv"];
    assert!(output(&mut hydroid(folder, &args)).status.success());
}

fn refused(folder: &Path, args: &[&str], words: &str) {
    let output = output(hydroid(folder, args).stdin(Stdio::null()));
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
    assert!(said.contains(words), "{args:?}: {said}");
}

/// Story 4: a command that is blocked did not hear the first signal.
#[cfg(unix)]
#[test]
fn a_command_that_is_blocked_ends_at_the_first_signal() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    log(at);
    assert!(std::process::Command::new("mkfifo").arg(at.join("pipe")).status().unwrap().success());
    for (args, signal) in [
        (&["inspect", "pipe"][..], "-TERM"),
        (&["adapt", "hydrofoil", "pipe", "--horizon", "5"], "-INT"),
        (&["adapt", "hydrofoil", "-", "--state", "boat.state"], "-TERM"),
    ] {
        let mut child = hydroid(at, args).stdin(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(700));
        let begun = Instant::now();
        let kill = std::process::Command::new("kill").args([signal, &child.id().to_string()]).status();
        assert!(kill.unwrap().success());
        let status = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break status;
            }
            // Generous for a loaded machine: before, it never ended.
            assert!(begun.elapsed() < Duration::from_secs(20), "{args:?} does not end");
            std::thread::sleep(Duration::from_millis(20));
        };
        assert_eq!(status.code(), Some(130), "{args:?}");
    }
}

/// Story 6: a line of gigabytes aborted the program.
#[test]
fn a_file_without_ends_of_lines_is_refused() {
    let folder = TempDir::new().unwrap();
    for (header, lines) in [("t,u,r,n_cmd\n", 2), ("t,u,r,n_cmd\r\n0,1,2,3\r\n", 3), ("a,b\n\n", 3)] {
        let mut bytes = header.as_bytes().to_vec();
        bytes.resize(20_000_000, b'0');
        fs::write(folder.path().join("big.csv"), bytes).unwrap();
        let said =
            format!("big.csv, line {lines}: {} bytes without an end of line", 20_000_000 - header.len());
        refused(folder.path(), &["inspect", "big.csv"], &said);
    }
}

/// Story 8: one line after a long gap blocked the service for seconds.
#[test]
fn the_work_for_a_line_is_bounded() {
    let folder = TempDir::new().unwrap();
    refused(folder.path(), &["adapt", "hydrofoil", "-", "--max-gap", "99999"], "at most 10000 steps");
}

/// Stories 10 and 11: a log and a state were overwritten.
#[test]
fn outputs_that_are_inputs_are_refused() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    log(at);
    let before = fs::read(at.join("log.csv")).unwrap();
    fs::create_dir(at.join("sub")).unwrap();
    for args in [
        &["adapt", "hydrofoil", "log.csv", "-o", "log.csv", "--horizon", "5"][..],
        &["adapt", "hydrofoil", "log.csv", "-o", "sub/../log.csv", "--horizon", "5"],
        &["adapt", "hydrofoil", "log.csv", "--stream", "--state", "log.csv"],
        &["simulate", "hydrofoil", "--excitation", "log.csv", "-o", "log.csv"],
    ] {
        refused(at, args, "name another file");
        assert_eq!(fs::read(at.join("log.csv")).unwrap(), before);
    }
    refused(at, &["adapt", "hydrofoil", "-", "--state", "st.toml", "-o", "st.toml"], "name two files");
    refused(at, &["adapt", "hydrofoil", "-", "--state", "st", "--black-box", "./st"], "name two files");
}

/// Names of built-in vessels are not files, and a device may be named twice.
#[cfg(unix)]
#[test]
fn names_that_are_no_files_are_no_conflict() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let args = ["adapt", "hydrofoil", "-", "--state", "/dev/null", "--black-box", "/dev/null"];
    refused(at, &args, "it is a folder or a device");
    for name in ["hydrofoil", "mixed"] {
        fs::write(at.join(name), "a file of this name").unwrap();
        let args = ["simulate", "hydrofoil", "--excitation", "mixed", "--duration", "9", "-o", name];
        let done = output(&mut hydroid(at, &args));
        assert!(done.status.success(), "{}", text(&done.stderr));
        assert!(fs::read_to_string(at.join(name)).unwrap().starts_with('t'), "{name}");
    }
}

/// Story 12: names from files reached the terminal with their escape sequences.
#[test]
fn escape_sequences_in_files_are_shown_escaped() {
    let folder = TempDir::new().unwrap();
    let log = "t,\u{1b}]0;pwned\u{7}u\u{1b}[31m [m/s],v,r\n0,1,2,3\n0.1,1,2,3\n";
    fs::write(folder.path().join("escape.csv"), log).unwrap();
    let output = hydroid(folder.path(), &["inspect", "escape.csv"]).output().unwrap();
    let all = [output.stdout, output.stderr].concat();
    assert!(!all.iter().any(|byte| *byte < 0x20 && !matches!(byte, b'\n' | b'\t')), "{}", text(&all));
    assert!(text(&all).contains("\\u001b]0;pwned"), "{}", text(&all));
}

/// Story 13: of two services with the same state, the last writer won.
#[test]
fn a_second_writer_is_refused() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for option in ["--state", "--black-box"] {
        let args = ["adapt", "hydrofoil", option, "boat", "-"];
        let mut first = Service::start(at, &args);
        first.ask(r#"{"t":0,"u":1.5,"v":0,"r":0,"PP_cmd":100,"RD_ang":0}"#);
        refused(at, &args, "another run of hydroid writes there");
        drop(first.child.stdin.take());
        assert_eq!(first.end().0, Some(0));
        // After its end, another run may write; no lock is left.
        let mut second = Service::start(at, &args);
        second.ask(r#"{"t":1,"u":1.5,"v":0,"r":0,"PP_cmd":100,"RD_ang":0}"#);
        drop(second.child.stdin.take());
        assert_eq!(second.end().0, Some(0));
        assert!(!at.join(".boat.lock").exists());
        let _ = fs::remove_file(at.join("boat"));
    }
}

/// Story 13: the same for two identifications into one folder. Devices have no lock.
#[test]
fn a_folder_in_use_is_refused() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    log(at);
    fs::create_dir(at.join("out")).unwrap();
    let held = fs::File::create(at.join("out/.hydroid.lock")).unwrap();
    held.try_lock().unwrap();
    for args in [
        &["identify", "log.csv", "-o", "out"][..],
        &["manoeuvre", "hydrofoil", "--trials", "turning-circle", "-o", "out"],
        &["control", "hydrofoil", "--controller", "fl", "--task", "circle", "-o", "out"],
    ] {
        refused(at, args, "another run of hydroid writes there");
    }
    let held_file = fs::File::create(at.join(".new.csv.lock")).unwrap();
    held_file.try_lock().unwrap();
    refused(
        at,
        &["simulate", "hydrofoil", "--duration", "9", "-o", "new.csv"],
        "another run of hydroid writes",
    );
    drop((held, held_file));
    refused(at, &["identify", "log.csv", "--outputs", "w", "-o", "out"], "w");
    assert!(fs::read_dir(at.join("out")).unwrap().next().is_none(), "no lock is left");
    if cfg!(unix) {
        let args = ["adapt", "hydrofoil", "log.csv", "--horizon", "5", "--black-box", "/dev/null"];
        let said = hydroid(at, &args).output().unwrap();
        assert!(!text(&said.stderr).contains("lock"), "{}", text(&said.stderr));
    }
}

/// Story 14: temporary files of a killed run stayed for ever.
#[test]
fn temporary_files_of_dead_runs_are_removed() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let names = [".hydroid-aB3dEf.tmp", ".hydroid-123456.tmp", ".hydroid-notes.txt", ".hydroid-my-own.tmp"];
    let [dead, alive, own, other] = names.map(|name| at.join(name));
    for path in [&dead, &alive, &own, &other] {
        let mut file = fs::File::create(path).unwrap();
        file.write_all(b"half").unwrap();
        file.set_modified(std::time::SystemTime::now() - Duration::from_mins(1)).unwrap();
    }
    // The writer of a living run holds a lock.
    let held = fs::File::open(&alive).unwrap();
    held.try_lock().unwrap();
    log(at);
    assert!(!dead.exists() && alive.exists());
    assert!(own.exists() && other.exists(), "files of others stay");
}

/// Story 15: a configuration that was cut before its logs trained on the demonstration.
#[test]
fn a_configuration_without_logs_is_no_demonstration() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    fs::write(at.join("cut.toml"), "[identify]\nhorizon = 10\n").unwrap();
    refused(at, &["identify", "-c", "cut.toml", "-o", "out", "-q"], "names no training logs");
    assert!(!at.join("out").exists());
    fs::rename(at.join("cut.toml"), at.join("hydroid.toml")).unwrap();
    refused(at, &["identify", "-o", "out"], "hydroid.toml names no training logs");
}

/// `-o x/../log.csv` overwrote the log if `x` did not exist.
#[test]
fn a_folder_that_does_not_exist_hides_no_input() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    log(at);
    fs::create_dir(at.join("sub")).unwrap();
    let before = fs::read(at.join("log.csv")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("sub", at.join("link")).unwrap();
    for name in
        ["x/../log.csv", "x/y/../../log.csv", "sub/x/../../log.csv", "./x/./../log.csv", "link/../log.csv"]
    {
        if cfg!(not(unix)) && name.starts_with("link") {
            continue;
        }
        let args = ["convert", "log.csv", "--outputs", "u,v,r", "--inputs", "PP_cmd,RD_ang", "-o", name];
        refused(at, &args, "name another file");
        assert_eq!(fs::read(at.join("log.csv")).unwrap(), before, "{name}");
    }
    // A file of the same name elsewhere is another one.
    let args = ["convert", "log.csv", "--outputs", "u,v,r", "--inputs", "PP_cmd,RD_ang", "-o", "x/log.csv"];
    let done = output(&mut hydroid(at, &args));
    assert!(done.status.success() && at.join("x/log.csv").exists(), "{}", text(&done.stderr));
}

/// Names that are not UTF-8 ended the command with a panic.
#[cfg(unix)]
#[test]
fn names_that_are_not_utf_8_are_names() {
    use std::os::unix::ffi::OsStrExt as _;
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    log(at);
    let name = std::ffi::OsStr::from_bytes(b"log-\xff.csv");
    fs::rename(at.join("log.csv"), at.join(name)).unwrap();
    let run = |before: &[&str], after: &[&str]| output(hydroid(at, before).arg(name).args(after));
    let inspected = run(&["inspect"], &[]);
    assert_eq!(inspected.status.code(), Some(0), "{}", text(&inspected.stderr));
    // The command line is part of reports, and of the search for --json in wrong arguments.
    let reported = run(&["evaluate", "hydrofoil"], &["--horizon", "5"]);
    assert!(matches!(reported.status.code(), Some(0 | 1)), "{}", text(&reported.stderr));
    for wrong in [&["--no-such-option"][..], &["--no-such-option", "--json"], &["--horizon", "x"]] {
        let refused = run(&["evaluate", "hydrofoil"], wrong);
        let said = [refused.stdout, refused.stderr].concat();
        assert_eq!(refused.status.code(), Some(2), "{}", text(&said));
        assert!(!text(&said).contains("panicked"), "{}", text(&said));
    }
}
