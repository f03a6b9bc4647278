//! Options of `hydroid adapt`, `hydroid control` and `hydroid live` in a TOML file.
//!
//! Each key of the section `[adapt]`, `[control]` or `[live]` is an option with `_` in place of `-`. The values become arguments;
//! the command line takes precedence.

use std::any::TypeId;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use hydroid::{config, toml_file};
use serde::Deserialize;

use super::control::Control;

/// Values of a section by option name.
type Section = BTreeMap<String, Value>;

/// The value of an option.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, expecting = "a number, a text, true, false, a list, or a table of these")]
enum Value {
    Flag(bool),
    Integer(i64),
    Number(f64),
    Text(String),
    List(Vec<Value>),
    Table(BTreeMap<String, Value>),
}

/// The sections of interest; `hydroid identify` reads the others.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Sections {
    adapt: Section,
    control: Section,
    live: Section,
}

/// Arguments from a file.
#[derive(Debug)]
pub struct FromFile {
    /// The file.
    pub path: PathBuf,
    /// Name of the section.
    pub verb: &'static str,
    /// The arguments.
    pub arguments: Vec<OsString>,
}

/// The options of a section of a file as arguments of a command, which people call by the name `program`. Those that were
/// given on the command line are omitted.
///
/// # Errors
/// If the file cannot be read, or a key is no option.
pub fn section(
    command: &Command,
    program: &str,
    verb: &str,
    path: &Path,
    given: Option<&ArgMatches>,
) -> anyhow::Result<Vec<OsString>> {
    // Other sections are read by other commands; one that none reads is an error.
    config::read(path).context("the configuration file cannot be used")?;
    let sections: Sections = toml_file::read(path).context("the configuration file cannot be used")?;
    let section = match verb {
        "adapt" => sections.adapt,
        "live" => sections.live,
        _ => sections.control,
    };
    let mut arguments = Vec::new();
    for (key, value) in &section {
        let place = || format!("{}, section [{verb}], key {key}", path.display());
        if key.contains('-') {
            bail!("{}: write {}", place(), key.replace('-', "_"));
        }
        let Some(arg) = option(command, key) else {
            let help = if verb == "live" { "--help" } else { "--help-advanced" };
            bail!(
                "{}: {program} has no option --{}; `{program} {help}` lists all of them",
                place(),
                key.replace('_', "-")
            );
        };
        let is_given =
            |given: &ArgMatches| given.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine);
        if given.is_some_and(is_given) {
            continue;
        }
        arguments.extend(words(arg, value, path).with_context(place)?);
    }
    Ok(arguments)
}

/// Parses words, with those of a file behind the first ones. Help and invalid arguments end the program.
pub fn parse<A: FromArgMatches>(
    command: &Command,
    mut words: Vec<OsString>,
    from_file: Option<FromFile>,
    after: usize,
) -> anyhow::Result<A> {
    let of = |words: &[OsString]| {
        let matches = command.clone().try_get_matches_from(words)?;
        A::from_arg_matches(&matches)
    };
    let Some(FromFile { path, verb, arguments }) = from_file else {
        return Ok(of(&words).unwrap_or_else(|error| error.exit()));
    };
    words.splice(after..after, arguments);
    of(&words).map_err(|error| {
        if !error.use_stderr() {
            error.exit();
        }
        invalid(&error, verb, &path)
    })
}

/// The arguments of `hydroid control` in a configuration file.
///
/// # Errors
/// If the section `[control]` cannot be used.
pub fn control_of(file: &Path) -> anyhow::Result<Control> {
    let command = Control::augment_args(Command::new("control").bin_name("hydroid control"));
    let words = section(&command, "hydroid control", "control", file, None)?;
    let matches = command.no_binary_name(true).try_get_matches_from(words);
    matches
        .and_then(|matches| Control::from_arg_matches(&matches))
        .map_err(|error| invalid(&error, "control", file))
}

/// Invalid words of a section.
fn invalid(error: &clap::Error, section: &str, file: &Path) -> anyhow::Error {
    let text = error.render().to_string();
    let text = text.trim_start_matches("error: ").trim_end();
    anyhow!("with the section [{section}] of {}: {text}", file.display())
}

fn option<'a>(command: &'a Command, key: &str) -> Option<&'a Arg> {
    let long = key.replace('_', "-");
    let named = |arg: &&Arg| arg.get_long() == Some(long.as_str());
    let excluded = ["config", "help", "help-advanced", "print-config", "replay"];
    command.get_arguments().find(named).filter(|_| !excluded.contains(&long.as_str()))
}

fn words(arg: &Arg, value: &Value, file: &Path) -> anyhow::Result<Vec<OsString>> {
    let long = arg.get_long().unwrap_or_default();
    if matches!(arg.get_action(), ArgAction::SetTrue) {
        return match value {
            Value::Flag(true) => Ok(vec![format!("--{long}").into()]),
            Value::Flag(false) => Ok(Vec::new()),
            _ => bail!("write true or false"),
        };
    }
    let is_path = arg.get_value_parser().type_id() == TypeId::of::<PathBuf>();
    let word = |text: String| -> OsString {
        let text = if is_path { beside(file, &text).into_os_string() } else { text.into() };
        let mut word = OsString::from(format!("--{long}="));
        word.push(text);
        word
    };
    match (arg.get_action(), arg.get_value_delimiter(), value) {
        (ArgAction::Append, None, Value::List(all)) => {
            all.iter().map(|value| Ok(word(text(value, ",")?))).collect()
        }
        _ => Ok(vec![word(text(value, if nested(value) { ";" } else { "," })?)]),
    }
}

fn beside(file: &Path, name: &str) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(name)
}

fn nested(value: &Value) -> bool {
    matches!(value, Value::List(all) if all.iter().any(|value| matches!(value, Value::List(_))))
}

/// A value in command-line form: lists with a separator, tables as `NAME=VALUE`, inner lists with commas.
fn text(value: &Value, separator: &str) -> anyhow::Result<String> {
    Ok(match value {
        Value::Flag(_) => bail!("the option takes a value, not true or false"),
        Value::Integer(n) => n.to_string(),
        Value::Number(x) => x.to_string(),
        Value::Text(text) => text.clone(),
        Value::List(all) => {
            let all: anyhow::Result<Vec<_>> = all.iter().map(|value| text(value, ",")).collect();
            all?.join(separator)
        }
        Value::Table(all) => {
            let mut joined = String::new();
            for (name, value) in all {
                let comma = if joined.is_empty() { "" } else { "," };
                // A list is a range.
                let _ = write!(joined, "{comma}{name}={}", text(value, ":")?);
            }
            joined
        }
    })
}
