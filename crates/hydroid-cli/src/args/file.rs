//! Options of `hydroid adapt`, `hydroid control` and `hydroid live` in a TOML file.

use std::path::{Path, PathBuf};

use clap::{ArgMatches, Command};
use hydroid::config;
use hydroid_live::program::file::{FromFile, section};

/// Reads the section of the subcommand in `matches` from the file of `--config` or from `hydroid.toml` in the current
/// folder. Options on the command line are omitted.
pub fn read(command: &Command, matches: &ArgMatches) -> anyhow::Result<Option<FromFile>> {
    let Some((name, given)) = matches.subcommand() else { return Ok(None) };
    let Some(verb) = ["adapt", "control", "live"].into_iter().find(|verb| *verb == name) else {
        return Ok(None);
    };
    // A recording contains all options of its session.
    if verb == "adapt" && given.contains_id("replay") {
        return Ok(None);
    }
    let path = match given.get_one::<PathBuf>("config") {
        Some(path) => path.clone(),
        None if Path::new(config::FILE).exists() => PathBuf::from(config::FILE),
        None => return Ok(None),
    };
    let Some(command) = command.find_subcommand(verb) else { return Ok(None) };
    let arguments = section(command, &format!("hydroid {verb}"), verb, &path, Some(given))?;
    Ok((!arguments.is_empty()).then_some(FromFile { path, verb, arguments }))
}
