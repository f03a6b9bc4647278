//! Models of the hydrofoil identified at low speed and adapted while foiling.

use std::fs;

use tempfile::TempDir;

use crate::common::{run, text};

/// Logs at low speed, a log with foiling (`lawn.csv`), and the output of `identify` with the options of `net.toml`.
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
