//! Names of options in messages.
//!
//! An option has one name, its key: `max_gap`. A message names it by [`key`], and the front end decides how it is written: the
//! command line `--max-gap 3`, everything else `max_gap=3`, which is a keyword of Python and, with spaces, a line of a file.

use std::fmt::{Display, Formatter, Result};
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether the front end of this process is a command line.
static IS_COMMAND_LINE: AtomicBool = AtomicBool::new(false);

/// From now on, messages of this process name options as on a command line. Call it first.
pub fn spell_as_arguments() {
    IS_COMMAND_LINE.store(true, Ordering::Relaxed);
}

/// An option in a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key<'a> {
    name: &'a str,
    value: Option<String>,
}

/// The option with a name.
pub const fn key(name: &str) -> Key<'_> {
    Key { name, value: None }
}

impl Key<'_> {
    /// The option with a value.
    #[must_use]
    pub fn is(self, value: impl Display) -> Self {
        Self { value: Some(value.to_string()), ..self }
    }

    fn write(&self, out: &mut Formatter<'_>, is_command_line: bool) -> Result {
        let Self { name, value } = self;
        if !is_command_line {
            let Some(value) = value else { return out.write_str(name) };
            let is_bare = value.parse::<f64>().is_ok() || matches!(value.as_str(), "true" | "false");
            return if is_bare { write!(out, "{name}={value}") } else { write!(out, "{name}=\"{value}\"") };
        }
        write!(out, "--{}", name.replace('_', "-"))?;
        match value {
            Some(value) if value.contains([' ', ';', '(', '[', '\'']) => write!(out, " \"{value}\""),
            // A value that begins like a flag is not taken as one.
            Some(value) if value.starts_with('-') => write!(out, "={value}"),
            Some(value) => write!(out, " {value}"),
            None => Ok(()),
        }
    }
}

impl Display for Key<'_> {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        self.write(out, IS_COMMAND_LINE.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Spelled<'a>(&'a Key<'a>, bool);

    impl Display for Spelled<'_> {
        fn fmt(&self, out: &mut Formatter<'_>) -> Result {
            self.0.write(out, self.1)
        }
    }

    #[test]
    fn each_front_end_has_its_spelling() {
        for (key, argument, keyword) in [
            (key("max_gap"), "--max-gap", "max_gap"),
            (key("max_gap").is(3.5), "--max-gap 3.5", "max_gap=3.5"),
            (key("input_delay").is("-3"), "--input-delay=-3", "input_delay=-3"),
            (key("task").is("lawn-mower"), "--task lawn-mower", "task=\"lawn-mower\""),
            (key("heading").is("psi [deg]"), "--heading \"psi [deg]\"", "heading=\"psi [deg]\""),
        ] {
            assert_eq!(Spelled(&key, true).to_string(), argument);
            assert_eq!(Spelled(&key, false).to_string(), keyword);
        }
    }
}
