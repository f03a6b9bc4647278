//! Commands, options, crates and files that documents name.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use clap::error::ErrorKind;

use super::shell::{Variables, commands};
use super::{Page, pages, root};

/// Options of other programs that the prose of documents names.
const FOREIGN: [&str; 4] = ["--zig", "--compatibility", "--target", "--ros-args"];

/// Folders that a build makes.
const BUILT: [&str; 2] = ["web/dist", "fuzz/corpus"];

/// Spans of code in a line.
fn spans(line: &str) -> impl Iterator<Item = &str> {
    line.split('`').skip(1).step_by(2)
}

/// The command and what it lacks: an unknown subcommand, option or value, or a missing argument.
fn refusal(words: &[String]) -> Option<String> {
    let error = hydroid_cli::arguments().try_get_matches_from(words).err()?;
    let text = error.render().to_string();
    // A configuration file can have the rest.
    let elsewhere = words.iter().any(|word| word == "-c" || word == "--config");
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => None,
        ErrorKind::MissingRequiredArgument if elsewhere => None,
        _ => Some(format!("{}: {}", words.join(" "), text.lines().next().unwrap_or_default())),
    }
}

/// Long options of a command and its subcommands.
fn options(command: &clap::Command) -> BTreeSet<String> {
    let own = command.get_arguments().filter_map(clap::Arg::get_long).map(|name| format!("--{name}"));
    let below = command.get_subcommands().flat_map(options);
    own.chain(below).chain(["--help", "--version", "--help-advanced"].map(str::to_owned)).collect()
}

/// The crate that a span names.
fn crate_of(span: &str) -> Option<String> {
    let name = match span.split_once("::") {
        Some((name, _)) if name.starts_with("hydroid_") => name.replace('_', "-"),
        _ => span.split([' ', '/']).next()?.to_owned(),
    };
    let plain = name.chars().all(|c| c.is_ascii_lowercase() || c == '-');
    (name.starts_with("hydroid-") && plain).then_some(name)
}

/// Files of the repository, without those that are built.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy();
        if path.is_dir() && !["target", ".git", "node_modules", "_static", "dist"].contains(&&*name) {
            files(&path, found);
        } else if path.is_file() {
            found.push(path.strip_prefix(root()).unwrap().to_owned());
        }
    }
}

struct Repository {
    files: Vec<PathBuf>,
    /// Names at the top, of which a path begins.
    top: BTreeSet<String>,
    packages: BTreeSet<String>,
    command: clap::Command,
}

impl Repository {
    fn read() -> Self {
        let mut found = Vec::new();
        files(&root(), &mut found);
        let top = found.iter().filter(|path| path.components().count() > 1);
        let top = top.map(|path| path.iter().next().unwrap().to_string_lossy().into_owned()).collect();
        let manifests = found.iter().filter(|path| path.ends_with("Cargo.toml"));
        let package = |path: &PathBuf| {
            let manifest: toml::Table = fs::read_to_string(root().join(path)).unwrap().parse().unwrap();
            Some(manifest.get("package")?.get("name")?.as_str()?.to_owned())
        };
        let mut command = hydroid_cli::arguments();
        // Subcommands get the options of every command.
        command.build();
        Self { packages: manifests.filter_map(package).collect(), command, top, files: found }
    }

    /// A path of a page, from the root, from its folder, or from `crates`. Without these it is the end of any path.
    fn has_path(&self, page: &Page, path: &str) -> bool {
        let path = path.trim_end_matches('/');
        let inner = format!("/{path}/");
        page.path.parent().unwrap().join(path).exists()
            || root().join(path).exists()
            || self.files.iter().any(|file| file.ends_with(path) || file.to_string_lossy().contains(&inner))
            || BUILT.iter().any(|built| path.starts_with(built))
    }

    /// Whether a package has a program with this name in a folder.
    fn has_program(&self, page: &Page, folder: &str, name: &str) -> bool {
        [".rs", "/main.rs"].iter().any(|end| self.has_path(page, &format!("{folder}/{name}{end}")))
    }

    /// Whether a word must be a path of the repository: it begins in one of its folders, or ends as a source does.
    fn is_path(&self, word: &str) -> bool {
        let first = word.split('/').next().unwrap_or_default();
        let source = [".rs", ".js"].iter().any(|end| word.ends_with(end) && word.len() > end.len());
        let inside = word.contains('/') && (self.top.contains(first) || self.packages.contains(first));
        !word.contains([' ', '(', ':', '=', ',', '*', '{', '$', '<']) && (source || inside)
    }

    /// What a line of prose names and does not exist.
    fn missing_in_prose(&self, page: &Page, line: &str, missing: &mut Vec<String>) {
        for span in spans(line) {
            if self.is_path(span) && !self.has_path(page, span) {
                missing.push(format!("file {span}"));
            }
            missing.extend(
                crate_of(span)
                    .filter(|name| !self.packages.contains(name))
                    .map(|name| format!("crate {name}")),
            );
            if span.contains("cargo ") {
                for words in commands(span, &mut Variables::default()) {
                    self.missing_in_command(page, &words, missing);
                }
            }
            let words: Vec<&str> = span.split_whitespace().collect();
            let verb = match words[..] {
                ["hydroid", verb, ..] if verb.chars().all(char::is_lowercase) => Some(verb),
                ["hydroid-ros", ..] => Some("live"),
                _ => None,
            };
            let known = match verb {
                Some(verb) => self.command.find_subcommand(verb),
                None => {
                    Some(&self.command).filter(|_| words.first().is_some_and(|word| word.starts_with("--")))
                }
            };
            if let Some(verb) = verb.filter(|_| known.is_none()) {
                missing.push(format!("command {verb}"));
            }
            let Some(known) = known.map(options) else { continue };
            for word in words.iter().filter(|word| word.starts_with("--")) {
                let option = word.split('=').next().unwrap().trim_end_matches(|c: char| !c.is_alphanumeric());
                if !option.is_empty() && !known.contains(option) && !FOREIGN.contains(&option) {
                    missing.push(format!("option {span}"));
                }
            }
        }
    }

    /// What a command in a block of code names and does not exist.
    fn missing_in_command(&self, page: &Page, words: &[String], missing: &mut Vec<String>) {
        if words[0] == "hydroid" {
            missing.extend(refusal(words));
        }
        if words[0] == "hydroid-ros" {
            let options = words.iter().take_while(|word| *word != "--ros-args").map(String::as_str);
            self.missing_in_prose(page, &format!("`{}`", options.collect::<Vec<_>>().join(" ")), missing);
        }
        for word in words {
            if self.is_path(word) && !self.has_path(page, word) {
                missing.push(format!("file {word}"));
            }
        }
        if words[0] != "cargo" {
            return;
        }
        for pair in words.windows(2) {
            let there = match pair[0].as_str() {
                // CRATE stands for any.
                "-p" => pair[1] == "CRATE" || self.packages.contains(&pair[1]),
                "--example" => self.has_program(page, "examples", &pair[1]),
                "--bench" => self.has_program(page, "benches", &pair[1]),
                "--bin" => self.has_program(page, "src/bin", &pair[1]),
                "--test" => pair[1] == "it" || self.has_path(page, &format!("tests/{}.rs", pair[1])),
                _ => true,
            };
            if !there {
                missing.push(format!("{} of {}", pair[1], pair[0]));
            }
        }
        if words.get(1).is_some_and(|verb| verb == "test" || verb == "bench") {
            missing.extend(self.unknown_filter(words));
        }
    }

    /// A filter of `cargo test` that selects nothing, as far as a text shows.
    fn unknown_filter(&self, words: &[String]) -> Option<String> {
        let valued = ["-p", "--test", "--bench", "--features", "--manifest-path", "--target-dir"];
        let filter = (2..words.len())
            .take_while(|&i| words[i] != "--")
            .find(|&i| !words[i].starts_with('-') && !valued.contains(&words[i - 1].as_str()))?;
        let name = words[filter].rsplit("::").next().unwrap();
        let mut sources =
            self.files.iter().filter(|path| path.extension().is_some_and(|extension| extension == "rs"));
        let named = |path: &PathBuf| {
            path.to_string_lossy().contains(name)
                || fs::read_to_string(root().join(path)).is_ok_and(|text| {
                    text.match_indices("fn ")
                        .any(|(at, _)| text[at..].split('(').next().is_some_and(|head| head.contains(name)))
                })
        };
        (!sources.any(named)).then(|| format!("test {}", words[filter]))
    }
}

#[test]
fn what_documents_name_exists() {
    let repository = Repository::read();
    let (mut found, mut count) = (Vec::new(), 0);
    for page in &pages() {
        let (prose, blocks) = page.parts();
        for (line, text) in prose {
            let mut missing = Vec::new();
            repository.missing_in_prose(page, text, &mut missing);
            found.extend(missing.iter().map(|name| format!("{}: {name}", page.at(line))));
        }
        let mut variables = Variables::default();
        for block in
            blocks.iter().filter(|block| ["sh", "", "bash", "console"].contains(&block.language.trim()))
        {
            for words in commands(&block.text, &mut variables) {
                count += usize::from(words[0] == "hydroid");
                let mut missing = Vec::new();
                repository.missing_in_command(page, &words, &mut missing);
                found.extend(missing.iter().map(|name| format!("{}: {name}", page.at(block.line))));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
    assert!(count > 100, "only {count} commands were found");
}

/// The examples of `--help`: a command, and its purpose after at least two blanks.
#[test]
fn examples_of_the_help_are_accepted() {
    let command = hydroid_cli::arguments();
    let (mut refused, mut count) = (Vec::new(), 0);
    for command in command.get_subcommands().chain([&command]) {
        let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
        for line in help.lines().map(str::trim).filter(|line| line.starts_with("hydroid ")) {
            let example = line.split("  ").next().unwrap();
            for words in
                commands(example, &mut Variables::default()).iter().filter(|words| words[0] == "hydroid")
            {
                count += 1;
                refused.extend(refusal(words));
            }
        }
    }
    assert!(refused.is_empty(), "{}", refused.join("\n"));
    assert!(count > 50, "only {count} examples were found");
}
