//! Files that a command writes are not those that it reads.

use std::path::{Component, Path, PathBuf};

use anyhow::ensure;

/// Refuses an output that is also an input or another output. An option without a file is `None`. Devices and pipes may
/// be named more than once; an input that is not a file is a name.
pub fn check(outputs: &[(&str, Option<&Path>)], inputs: &[&Path]) -> anyhow::Result<()> {
    let replaceable = |path: &Path| path.metadata().map_or(true, |metadata| metadata.is_file());
    let given: Vec<(&str, &Path)> = outputs
        .iter()
        .filter_map(|(option, path)| Some((*option, (*path)?)))
        .filter(|(_, path)| replaceable(path))
        .collect();
    let inputs: Vec<&Path> = inputs.iter().filter(|path| path.is_file()).copied().collect();
    for (i, (option, output)) in given.iter().enumerate() {
        let place = place(output);
        ensure!(
            !inputs.iter().any(|input| self::place(input) == place),
            "{option} {}: the command reads this file, and would overwrite it: name another file",
            output.display()
        );
        if let Some((other, _)) = given[..i].iter().find(|(_, path)| self::place(path) == place) {
            anyhow::bail!("{other} and {option} name the same file {}: name two files", output.display());
        }
    }
    Ok(())
}

/// The file behind a path: links are resolved, also those of folders on the way. A folder that does not exist yet is one.
fn place(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let mut place = PathBuf::new();
    for part in path.components() {
        if part == Component::ParentDir {
            place.pop();
            continue;
        }
        place.push(part);
        if let Ok(real) = place.canonicalize() {
            place = real;
        }
    }
    place
}
