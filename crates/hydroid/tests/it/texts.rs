//! Texts of the libraries name options by keys, which each front end spells.

use std::fs;
use std::path::{Path, PathBuf};

/// Crates whose texts reach users of Python, C and the page.
const LIBRARIES: [&str; 7] = [
    "hydroid",
    "hydroid-c",
    "hydroid-core",
    "hydroid-export",
    "hydroid-io",
    "hydroid-live",
    "hydroid-report",
];

/// Folder of the command line.
const COMMAND_LINE: &str = "hydroid-live/src/program";

#[test]
fn no_text_contains_a_flag() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the folder of the crates");
    let mut found = Vec::new();
    for library in LIBRARIES {
        for file in sources(&crates.join(library).join("src")) {
            let text = fs::read_to_string(&file).expect("a source file");
            let code = text.split("\n#[cfg(test)]\nmod tests {").next().unwrap_or_default();
            found.extend(flags(code).into_iter().map(|flag| format!("{}: {flag}", file.display())));
        }
    }
    assert!(found.is_empty(), "name the option by hydroid::key::key in:\n{}", found.join("\n"));
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() && !path.ends_with(COMMAND_LINE) {
            files.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files
}

/// Words that begin with two dashes and a letter, outside of comments and of commands in backquotes.
fn flags(code: &str) -> Vec<String> {
    let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    let lines = lines.map(|line| line.split(" // ").next().unwrap_or_default());
    let code = lines.collect::<Vec<_>>().join("\n").replace("\\\"", "");
    let texts = code.split('"').flat_map(|literal| literal.split('`').step_by(2));
    let words = texts.flat_map(|text| text.split(|c: char| c.is_whitespace() || "(['".contains(c)));
    let is_flag = |word: &&str| {
        word.strip_prefix("--").is_some_and(|name| name.starts_with(|c: char| c.is_ascii_lowercase()))
    };
    words.filter(is_flag).map(str::to_owned).collect()
}

#[test]
fn flags_are_found() {
    let code = "// as in --comment\nlet a = \"give (--max-gap) or `hydroid inspect --latex`\"; // --end\n\"%--a --\"";
    assert_eq!(flags(code), ["--max-gap)"]);
}
