//! Packages of a release: equal versions, complete metadata, and no file outside the package.

use std::fs;
use std::path::{Component, Path, PathBuf};

use toml::Table;

const VERSION: &str = env!("CARGO_PKG_VERSION");

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn table(path: &Path) -> Table {
    text(path).parse().unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Folders of the crates.
fn crates() -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join("crates")).unwrap();
    let found: Vec<_> = entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_dir()).collect();
    assert!(found.len() > 5, "{found:?}");
    found
}

#[test]
fn versions_are_equal() {
    let root = root();
    let mut wrong = Vec::new();
    let mut compare = |place: String, found: &str, expected: &str| {
        if found != expected {
            wrong.push(format!("{place}: expected {expected}, got {found}"));
        }
    };

    let requirements = table(&root.join("Cargo.toml"))["workspace"]["dependencies"].clone();
    for folder in crates() {
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        if let Some(requirement) = requirements.get(&name) {
            let found = requirement["version"].as_str().unwrap();
            compare(format!("requirement of {name} in Cargo.toml"), found, &format!("={VERSION}"));
        }
    }

    for lock in ["Cargo.lock", "checks/no-std/Cargo.lock"] {
        let packages = table(&root.join(lock))["package"].as_array().unwrap().clone();
        let own = packages.iter().filter(|package| package.get("source").is_none());
        // The fuzz targets, the check of the build without std and the research have no version of their own.
        let versioned: Vec<_> = own.filter(|package| package["version"].as_str() != Some("0.0.0")).collect();
        assert!(!versioned.is_empty(), "{lock} has no crate of hydroid");
        for package in versioned {
            compare(format!("{} in {lock}", package["name"]), package["version"].as_str().unwrap(), VERSION);
        }
    }

    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let changes = text(&root.join("CHANGELOG.md"));
    let mut versions = changes.lines().filter_map(|line| line.strip_prefix("## "));
    assert!(
        versions.any(|heading| heading.split(' ').next() == Some(VERSION)),
        "CHANGELOG.md has no section {VERSION}"
    );
}

#[test]
fn metadata_is_complete() {
    let root = root();
    let workspace = table(&root.join("Cargo.toml"))["workspace"]["package"].clone();
    for folder in crates() {
        let place = folder.display();
        let own = table(&folder.join("Cargo.toml"))["package"].clone();
        // A key is stated in the crate, or inherited from the workspace.
        let value = |key: &str| {
            let found = own.get(key).unwrap_or_else(|| panic!("{place}: no {key}"));
            if found.is_table() { workspace[key].clone() } else { found.clone() }
        };
        for key in ["description", "license", "readme", "rust-version", "edition"] {
            assert!(!value(key).as_str().unwrap().is_empty(), "{place}: {key} is empty");
        }
        assert!(own.get("publish").is_none(), "{place}: the command needs a package of each crate");

        // The limits of the registry, which `cargo package` does not check.
        for (key, longest) in [("keywords", 20), ("categories", usize::MAX)] {
            let words = value(key).as_array().unwrap().clone();
            assert!((1..=5).contains(&words.len()), "{place}: {key} has {} entries, at most 5", words.len());
            for word in words {
                let word = word.as_str().unwrap();
                assert!(word.len() <= longest, "{place}: {key}: {word} is longer than {longest} characters");
            }
        }
    }
    for folder in crates().into_iter().chain([root.join("python")]) {
        let readme = text(&folder.join("README.md"));
        assert!(readme.contains("## Licence"), "{}: README.md names no licence", folder.display());
        for licence in ["LICENSE-MIT", "LICENSE-APACHE"] {
            assert_eq!(text(&folder.join(licence)), text(&root.join(licence)), "{}", folder.display());
        }
    }
}

/// The file that a path in a source file names, without following links.
fn named(source: &Path, path: &str) -> PathBuf {
    let mut named = source.parent().unwrap().to_owned();
    for component in Path::new(path).components() {
        match component {
            Component::ParentDir => assert!(named.pop()),
            Component::Normal(name) => named.push(name),
            _ => {}
        }
    }
    named
}

#[test]
fn sources_include_no_file_outside_the_package() {
    let mut count = 0;
    for folder in crates() {
        let mut folders = vec![folder.join("src"), folder.join("examples")];
        while let Some(place) = folders.pop() {
            for entry in fs::read_dir(&place).into_iter().flatten() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                    continue;
                }
                if path.extension().is_none_or(|extension| extension != "rs") {
                    continue;
                }
                let source = text(&path);
                for start in ["include_str!(\"", "include_bytes!(\"", "include!(\"", "#[path = \""] {
                    for rest in source.split(start).skip(1) {
                        let file = named(&path, rest.split('"').next().unwrap());
                        assert!(file.starts_with(&folder), "{}: {}", path.display(), file.display());
                        count += 1;
                    }
                }
            }
        }
    }
    assert!(count > 10, "only {count} files were found");
}
