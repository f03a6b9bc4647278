//! Running the command, and a shared vessel with an identified model.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

use tempfile::TempDir;

pub(crate) const MODEL: &str = "out/sindy.safetensors";

/// Runs the command in a folder, with arguments separated by blanks.
pub(crate) fn command(folder: &Path, args: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hydroid"));
    command.current_dir(folder).args(args.split(' '));
    command
}

pub(crate) fn run(folder: &Path, args: &str) -> Output {
    command(folder, args).output().unwrap()
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
