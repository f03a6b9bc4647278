//! What documents name exists: targets of links, files, crates, commands and options. README's commands print what it shows.

mod names;
mod readme;
mod shell;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// A page of the repository.
struct Page {
    path: PathBuf,
    text: String,
}

/// A block of code: its language and its lines, without the fences.
struct Block {
    line: usize,
    language: String,
    text: String,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn markdown(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.filter(|path| path.extension().is_some_and(|extension| extension == "md")).collect()
}

/// All documents but those of the past: what CHANGELOG names need not exist any more.
fn pages() -> Vec<Page> {
    let root = root();
    let mut paths = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "RELEASING.md"]
        .map(|name| root.join(name))
        .to_vec();
    for folder in ["docs", "python", "web", "research", "examples/logs"] {
        paths.extend(
            Some(root.join(folder))
                .filter(|folder| folder.exists())
                .iter()
                .flat_map(|folder| markdown(folder)),
        );
    }
    for entry in fs::read_dir(root.join("crates")).unwrap() {
        paths.push(entry.unwrap().path().join("README.md"));
    }
    paths.sort();
    let read = |path: PathBuf| Page { text: fs::read_to_string(&path).unwrap(), path };
    paths.into_iter().map(read).collect()
}

impl Page {
    /// The place of a finding.
    fn at(&self, line: usize) -> String {
        let relative = self.path.strip_prefix(root()).unwrap();
        format!("{}:{line}", relative.display())
    }

    /// The lines outside of blocks of code, and these blocks.
    fn parts(&self) -> (Vec<(usize, &str)>, Vec<Block>) {
        let (mut prose, mut blocks) = (Vec::new(), Vec::new());
        let mut open: Option<Block> = None;
        for (line, text) in (1..).zip(self.text.lines()) {
            match (text.trim_start().strip_prefix("```"), &mut open) {
                (Some(language), None) => {
                    open = Some(Block { line, language: language.to_owned(), text: String::new() });
                }
                (Some(_), Some(_)) => blocks.extend(open.take()),
                (None, Some(block)) => block.text.extend([text, "\n"]),
                (None, None) => prose.push((line, text)),
            }
        }
        (prose, blocks)
    }
}

/// Anchors of the headings of a page, in the form of common renderers.
fn anchors(page: &Page) -> BTreeSet<String> {
    let (prose, _) = page.parts();
    let headings = prose.iter().filter_map(|(_, line)| {
        line.trim_start_matches('#').strip_prefix(' ').filter(|_| line.starts_with('#'))
    });
    let anchor = |heading: &str| {
        let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        kept.collect::<String>().to_lowercase().replace(' ', "-")
    };
    headings.map(anchor).collect()
}

#[test]
fn links_have_targets() {
    let (mut broken, mut count) = (Vec::new(), 0);
    let changelog = root().join("CHANGELOG.md");
    let changelog = Page { text: fs::read_to_string(&changelog).unwrap(), path: changelog };
    for page in pages().iter().chain([&changelog]) {
        let (prose, _) = page.parts();
        let links =
            prose.iter().flat_map(|(line, text)| text.split("](").skip(1).map(move |rest| (line, rest)));
        for (line, target) in links.filter_map(|(line, rest)| Some((line, rest.split_once(')')?.0))) {
            if target.contains("://") {
                continue;
            }
            count += 1;
            let (file, anchor) =
                target.split_once('#').map_or((target, None), |(file, anchor)| (file, Some(anchor)));
            let path =
                if file.is_empty() { page.path.clone() } else { page.path.parent().unwrap().join(file) };
            let there = path.exists()
                && anchor.is_none_or(|anchor| {
                    fs::read_to_string(&path).is_ok_and(|text| anchors(&Page { path, text }).contains(anchor))
                });
            if !there {
                broken.push(format!("{}: {target}", page.at(*line)));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
    assert!(count > 50, "only {count} links were found");
}

/// A reader has README read in five minutes, and ARCHITECTURE in ten.
#[test]
fn the_first_documents_are_short() {
    let text = |name: &str| fs::read_to_string(root().join(name)).unwrap();
    let lines = text("README.md").lines().count();
    assert!(lines <= 120, "README.md has {lines} lines, more than 120");
    let words = text("ARCHITECTURE.md").split_whitespace().count();
    assert!(words <= 1500, "ARCHITECTURE.md has {words} words, more than 1,500");
}

/// The table of contents lists each page of the book.
#[test]
fn the_table_of_contents_is_complete() {
    let index = fs::read_to_string(root().join("docs/index.md")).unwrap();
    for path in markdown(&root().join("docs")) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        assert!(
            name == "index.md" || index.contains(&format!("]({name})")),
            "docs/index.md does not list {name}"
        );
    }
}

/// ARCHITECTURE states the order of modules that `lib.rs` states, which a test of each crate compares with the imports.
#[test]
fn the_order_of_modules_is_that_of_the_crates() {
    let architecture = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let names = |paragraph: &str| -> Vec<String> {
        paragraph.split('`').skip(1).step_by(2).map(str::to_owned).collect()
    };
    for name in ["hydroid-core", "hydroid"] {
        let lib = fs::read_to_string(root().join("crates").join(name).join("src/lib.rs")).unwrap();
        let lines = lib.lines().skip_while(|line| !line.starts_with("//! Order of the modules"));
        let tested: Vec<&str> = lines.take_while(|line| *line != "//!").collect();
        let stated =
            architecture.split("\n\n").find(|text| text.starts_with(&format!("`{name}`, from the bottom:")));
        let stated = stated.unwrap_or_else(|| panic!("ARCHITECTURE.md states no order of {name}"));
        assert_eq!(names(stated)[1..], names(&tested.concat()), "the modules of {name}");
    }
}

/// ARCHITECTURE has a reason for each dependency.
#[test]
fn each_dependency_has_a_reason() {
    let architecture = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let (_, reasons) = architecture.split_once("## Dependencies").unwrap();
    let named: BTreeSet<&str> = reasons.split([' ', ',', ':', '\n']).collect();
    for folder in [".", "fuzz"] {
        let manifest: toml::Table =
            fs::read_to_string(root().join(folder).join("Cargo.toml")).unwrap().parse().unwrap();
        let tables = [
            manifest.get("workspace").and_then(|table| table.get("dependencies")),
            manifest.get("dependencies"),
        ];
        for name in tables.into_iter().flatten().flat_map(|table| table.as_table().unwrap().keys()) {
            assert!(
                name.starts_with("hydroid") || named.contains(name.as_str()),
                "ARCHITECTURE.md gives no reason for {name}"
            );
        }
    }
}

#[test]
fn the_tables_of_crates_are_complete() {
    for page in ["ARCHITECTURE.md", "docs/rust-api.md"] {
        let text = fs::read_to_string(root().join(page)).unwrap();
        for entry in fs::read_dir(root().join("crates")).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            assert!(text.contains(&format!("\n| `{name}` |")), "{page} has no row for {name}");
        }
    }
}
