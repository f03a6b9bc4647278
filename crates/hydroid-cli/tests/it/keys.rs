//! Options have one name: the key of the library and of files, and with `-` for `_` the flag.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

#[test]
fn each_key_in_a_message_is_a_flag() {
    let command = hydroid_cli::arguments();
    let arguments = command.get_subcommands().flat_map(clap::Command::get_arguments);
    let flags: BTreeSet<String> =
        arguments.filter_map(|argument| argument.get_long()).map(str::to_owned).collect();
    let mut unknown = Vec::new();
    for library in ["hydroid", "hydroid-export", "hydroid-live"] {
        visit(
            &Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(library).join("src"),
            &mut |file, text| {
                for (at, start) in text.match_indices("key(\"") {
                    let name = text[at + start.len()..].split('"').next().unwrap_or_default();
                    let is_path =
                        text[..at].ends_with(|c: char| c.is_alphanumeric() || ['_', '.', ':'].contains(&c));
                    if !is_path && !flags.contains(&name.replace('_', "-")) {
                        unknown.push(format!("{}: {name}", file.display()));
                    }
                }
            },
        );
    }
    assert!(unknown.is_empty(), "no command has these options:\n{}", unknown.join("\n"));
}

fn visit(folder: &Path, each: &mut dyn FnMut(&Path, &str)) {
    for entry in fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            visit(&path, each);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).expect("a source file");
            // Other functions have this name as well.
            if text.contains("use crate::key::") || text.contains("use hydroid::key::") {
                each(&path, text.split("\nmod tests {").next().unwrap_or_default());
            }
        }
    }
}

#[test]
fn former_flags_are_read() {
    for words in [
        "hydroid identify a.csv --term u --constraint u:u<=0 --range u=0:6 -o out",
        "hydroid manoeuvre simple --trial zigzag",
    ] {
        hydroid_cli::arguments().try_get_matches_from(words.split(' ')).unwrap();
    }
}
