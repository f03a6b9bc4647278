//! The command on a hydrofoil that was logged at low speed alone, and then flies.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use tempfile::TempDir;

/// The command, in a folder; arguments are parted by blanks.
pub(crate) fn hydroid(folder: &Path, args: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hydroid"));
    command.current_dir(folder).args(args.split(' '));
    command
}

/// The same, to its end.
pub(crate) fn run(folder: &Path, args: &str) -> Output {
    hydroid(folder, args).output().unwrap()
}

/// What was written, for messages.
pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Logs of low speed, one that leaves it (`lawn.csv`), and what `identify` makes with these settings (`net.toml`).
pub(crate) fn folder(settings: &str, identify: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let low = "simulate hydrofoil --excitation low-speed --duration";
    for args in [
        &format!("{low} 900 --seed 1 -o a.csv"),
        &format!("{low} 200 --seed 2 -o b.csv"),
        &format!("{low} 200 --seed 3 -o c.csv"),
        "simulate hydrofoil --excitation lawn-mower --leg-speeds 1.5,4,2 --duration 240 --seed 4 -o lawn.csv",
    ] {
        assert_eq!(run(at, args).status.code(), Some(0), "{args}");
    }
    fs::write(at.join("net.toml"), settings).unwrap();
    let identified = run(at, identify);
    assert!(matches!(identified.status.code(), Some(0 | 1)), "{}", text(&identified.stderr));
    folder
}
