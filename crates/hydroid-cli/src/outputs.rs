//! Files that a command writes are not those that it reads.

use std::path::{Path, PathBuf};

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

/// The file behind a path: links are resolved, also those of the folder of a file that does not exist yet.
fn place(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        path.file_name().map_or_else(|| path.to_owned(), |name| folder.join(name))
    })
}
