//! The commands of README print what it shows, in a folder as a fresh clone has it.

use std::fs;
use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

use super::{Page, root};

/// The command of this build, in front of all others.
fn path() -> std::ffi::OsString {
    let folder = Path::new(env!("CARGO_BIN_EXE_hydroid")).parent().unwrap().to_owned();
    let others = std::env::var_os("PATH").unwrap_or_default();
    std::env::join_paths([folder].into_iter().chain(std::env::split_paths(&others))).unwrap()
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &target);
        } else {
            fs::copy(&path, &target).unwrap();
        }
    }
}

/// A line without the spaces between its words.
fn words(line: &str) -> String {
    line.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
#[cfg(unix)]
#[ignore = "slow tier: .ci/run runs it"]
fn readme_shows_what_its_commands_print() {
    let folder = TempDir::new().unwrap();
    for name in ["examples", "vessels"] {
        copy(&root().join(name), &folder.path().join(name));
    }
    let path_of_page = root().join("README.md");
    let page = Page { text: fs::read_to_string(&path_of_page).unwrap(), path: path_of_page };
    let (mut printed, mut run, mut shown) = (Vec::new(), 0, 0);
    for block in page.parts().1 {
        if block.language == "sh" && block.text.starts_with("hydroid") {
            let script = format!("set -e\n{}", block.text);
            let output = Command::new("sh")
                .args(["-c", &script])
                .env("PATH", path())
                .current_dir(folder.path())
                .output()
                .unwrap();
            let error = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{}:\n{}\n{error}", page.at(block.line), block.text);
            printed = String::from_utf8_lossy(&output.stdout).lines().map(words).collect();
            run += 1;
        } else if block.language == "text" {
            // The lines stand in the output in the same order; others may be between them.
            let mut rest = printed.iter();
            for line in block.text.lines().map(words) {
                let found = rest.any(|printed| *printed == line);
                assert!(
                    found,
                    "{}: not printed, or not in this order: {line}\n{}",
                    page.at(block.line),
                    printed.join("\n")
                );
                shown += 1;
            }
        }
    }
    assert!(run >= 5 && shown >= 10, "{run} blocks, {shown} lines");
    assert!(folder.path().join("boat.html").is_file());
}
