//! Texts for people.

use std::borrow::Cow;
use std::io::Write as _;

/// Text for a terminal: control characters of names and cells from files are escaped, as in JSON.
pub fn printable(text: &str) -> Cow<'_, str> {
    let hostile = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    if !text.contains(hostile) {
        return Cow::Borrowed(text);
    }
    let escaped = |c: char| if hostile(c) { format!("\\u{:04x}", u32::from(c)) } else { c.to_string() };
    Cow::Owned(text.chars().map(escaped).collect())
}

/// Prints an error on standard error.
pub fn print_error(error: &anyhow::Error) {
    eprintln!("error: {}", printable(&error_text(error)));
}

/// An error with its causes, without repeated text.
pub fn error_text(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

/// Writes results to standard output; a closed pipe (`| head`) ends the program without an error.
pub fn write_out(text: std::fmt::Arguments<'_>) {
    let text = text.to_string();
    if let Err(error) = std::io::stdout().lock().write_all(printable(&text).as_bytes()) {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        eprintln!("error: standard output cannot be written: {error}");
        std::process::exit(2);
    }
}
