//! The order of the modules of this crate, as stated in `lib.rs`, compared with the imports in its sources. The tests
//! of other crates include this file.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// First words of the paragraph in `lib.rs` that lists all modules, bottom to top, in backquotes.
const HEADING: &str = "Order of the modules";

#[test]
fn modules_import_only_modules_below() {
    let source = &Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let lib = fs::read_to_string(source.join("lib.rs")).expect("lib.rs");
    let order = stated(&lib);
    let declared: BTreeSet<String> = lib.lines().filter_map(declaration).collect();
    let listed: BTreeSet<String> = order.iter().cloned().collect();
    assert_eq!(listed, declared, "lib.rs must list each of its modules once under \"{HEADING}\"");
    let mut upward = Vec::new();
    for file in sources(source) {
        let path = modules(source, &file);
        let Some(at) = path.first().and_then(|module| order.iter().position(|name| name == module)) else {
            continue;
        };
        let text = without_comments(&fs::read_to_string(&file).expect("a source file"));
        for name in imports(&text, path.len()) {
            if order[at + 1..].contains(&name) {
                upward.push(format!("{} imports {name}, which is above {}", file.display(), order[at]));
            }
        }
    }
    assert!(upward.is_empty(), "imports must point downwards:\n{}", upward.join("\n"));
}

/// The module that a line of `lib.rs` declares.
fn declaration(line: &str) -> Option<String> {
    let line = line.trim_start_matches("pub(crate) ").trim_start_matches("pub ");
    Some(line.strip_prefix("mod ")?.strip_suffix(';')?.to_owned())
}

/// The names in backquotes of the paragraph that begins with [`HEADING`].
fn stated(lib: &str) -> Vec<String> {
    let doc = lib.lines().map_while(|line| line.strip_prefix("//!")).map(str::trim);
    let paragraph: Vec<&str> =
        doc.skip_while(|line| !line.starts_with(HEADING)).take_while(|line| !line.is_empty()).collect();
    paragraph.join(" ").split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files
}

/// The module path of a file: `a/b.rs` and `a/b/mod.rs` are `[a, b]`, `lib.rs` and `main.rs` are empty.
fn modules(source: &Path, file: &Path) -> Vec<String> {
    let relative = file.strip_prefix(source).expect("below the sources").with_extension("");
    let names = relative.iter().map(|name| name.to_string_lossy().into_owned());
    names.filter(|name| !["mod", "lib", "main"].contains(&name.as_str())).collect()
}

/// A source text without line comments, up to its first inline module of tests.
fn without_comments(text: &str) -> String {
    let code = text.split("\n#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    code.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Modules of the crate's root in a text: after `crate::`, or after the `super::` that lead to the root.
fn imports(text: &str, depth: usize) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for root in ["crate::".to_owned(), "super::".repeat(depth)] {
        for (at, _) in text.match_indices(&root) {
            let before = text[..at].chars().next_back();
            if before.is_some_and(|c| c.is_alphanumeric() || ['_', '$', ':'].contains(&c)) {
                continue;
            }
            names.extend(heads(&text[at + root.len()..]).into_iter().filter(|name| !name.is_empty()));
        }
    }
    names
}

/// First names of a path, or of each path of a group in braces.
fn heads(text: &str) -> Vec<String> {
    let name = |text: &str| -> String {
        text.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
    };
    let Some(group) = text.strip_prefix('{') else { return vec![name(text)] };
    let (mut depth, mut names) = (0_usize, vec![name(group)]);
    for (at, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => names.push(name(&group[at + 1..])),
            _ => {}
        }
    }
    names
}

#[test]
fn paths_and_groups_are_read() {
    let text = "use crate::a::{B, c};\nuse crate::{\n    d::{E, f},\n    g,\n};\nuse super::super::h::I;";
    let names: Vec<String> = imports(text, 2).into_iter().collect();
    assert_eq!(names, ["a", "d", "g", "h"]);
    assert!(imports("use super::other::Thing;", 2).is_empty());
    assert_eq!(imports("fn f() -> crate::k::L {}", 1).into_iter().collect::<Vec<_>>(), ["k"]);
}
