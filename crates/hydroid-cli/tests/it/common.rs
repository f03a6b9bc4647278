//! Running the command, and a shared vessel with an identified model.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdout, Command, Output, Stdio};
use std::sync::OnceLock;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::time::Duration;

use serde_json::Value;
use tempfile::TempDir;

pub(crate) const MODEL: &str = "out/sindy.safetensors";

/// Runs the command in a folder, with arguments separated by blanks.
pub(crate) fn command(folder: &Path, args: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hydroid"));
    command.current_dir(folder).args(args.split(' '));
    command
}

pub(crate) fn run(folder: &Path, args: &str) -> Output {
    output(&mut command(folder, args))
}

/// The output of the command with exit status 0.
pub(crate) fn done(folder: &Path, args: &str) -> Output {
    let output = run(folder, args);
    assert_eq!(output.status.code(), Some(0), "{args}: {}", text(&output.stderr));
    output
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The command with separate arguments.
pub(crate) fn hydroid(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hydroid"));
    command.current_dir(folder).args(args);
    command
}

/// Longest time of a child process, for a loaded machine.
const LONGEST: Duration = Duration::from_mins(10);

/// Kills a child after [`LONGEST`], unless dropped before.
pub(crate) struct Limit {
    _ended: Sender<()>,
}

impl Limit {
    pub(crate) fn of(child: &Child) -> Self {
        let id = child.id().to_string();
        let (ended, wait) = mpsc::channel();
        std::thread::spawn(move || {
            if wait.recv_timeout(LONGEST) == Err(RecvTimeoutError::Timeout) {
                let _ = Command::new("kill").args(["-9", &id]).status();
            }
        });
        Self { _ended: ended }
    }
}

/// Output of a command with a time limit.
pub(crate) fn output(command: &mut Command) -> Output {
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let _limit = Limit::of(&child);
    child.wait_with_output().unwrap()
}

/// Sends a signal (`-TERM`, `-KILL`).
pub(crate) fn signal(child: &Child, signal: &str) {
    let sent = Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(sent.unwrap().success());
}

/// A running service with its answers and notes.
pub(crate) struct Service {
    pub(crate) child: Child,
    _limit: Limit,
    answers: BufReader<ChildStdout>,
    notes: BufReader<ChildStderr>,
}

impl Service {
    pub(crate) fn start(folder: &Path, args: &[&str]) -> Self {
        Self::of(&mut hydroid(folder, args))
    }

    pub(crate) fn of(command: &mut Command) -> Self {
        let mut child =
            command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let limit = Limit::of(&child);
        let answers = BufReader::new(child.stdout.take().unwrap());
        let notes = BufReader::new(child.stderr.take().unwrap());
        Self { child, _limit: limit, answers, notes }
    }

    pub(crate) fn send(&mut self, line: &str) {
        let stdin = self.child.stdin.as_mut().unwrap();
        writeln!(stdin, "{line}").unwrap();
        stdin.flush().unwrap();
    }

    pub(crate) fn answer(&mut self) -> String {
        let mut line = String::new();
        self.answers.read_line(&mut line).unwrap();
        line
    }

    pub(crate) fn ask(&mut self, line: &str) -> Value {
        self.send(line);
        loop {
            let answer = self.answer();
            let answer: Value =
                serde_json::from_str(&answer).unwrap_or_else(|error| panic!("{error}: {answer}"));
            // What a service says in silence, on a loaded machine, answers no line.
            if answer["status"] != "lost" {
                return answer;
            }
        }
    }

    /// Time of the state file, from the note on it.
    pub(crate) fn resumed_at(&mut self) -> f64 {
        let notes = &mut self.notes;
        let mut note = String::new();
        while !note.contains("resuming from") {
            note.clear();
            assert!(notes.read_line(&mut note).unwrap() > 0, "no note on the state");
        }
        let after = note.split(" at ").nth(1).unwrap();
        after.split(' ').next().unwrap().parse().unwrap()
    }

    /// Waits for the end; exit code and notes.
    pub(crate) fn end(mut self) -> (Option<i32>, String) {
        let mut notes = String::new();
        self.notes.read_to_string(&mut notes).unwrap();
        (self.child.wait().unwrap().code(), notes)
    }

    pub(crate) fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

/// Logs of the simple vessel (`a.csv`, `b.csv`, `d.csv`), a log with more drag (`c.csv`), and equations identified from
/// the former ([`MODEL`]). Tests write under their own file names.
pub(crate) fn simple_vessel() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER
        .get_or_init(|| {
            let folder = TempDir::new().unwrap();
            let at = folder.path();
            let vessel = text(&done(at, "simulate simple --print-vessel").stdout);
            fs::write(at.join("fouled.toml"), vessel.replace("77.55", "124.0").replace("162.5", "260.0"))
                .unwrap();
            for (plant, seed, file) in [
                ("simple", 1, "a.csv"),
                ("simple", 2, "b.csv"),
                ("fouled.toml", 3, "c.csv"),
                ("simple", 4, "d.csv"),
            ] {
                done(at, &format!("simulate {plant} --seed {seed} --duration 300 -o {file}"));
            }
            done(
                at,
                "identify a.csv --validate b.csv --test d.csv --outputs u,v,r,P_f --methods sindy -o out -q",
            );
            folder
        })
        .path()
}
