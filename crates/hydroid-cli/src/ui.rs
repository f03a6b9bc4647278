//! Progress, notes and errors on standard error. `outln` prints results on standard output.

use std::io::IsTerminal;
use std::ops::ControlFlow;

use hydroid::identify::Stage;
use hydroid::log::{Note, Severity};
use hydroid_live::program::interrupt::interrupted;
use hydroid_live::program::text::printable;
pub use hydroid_live::program::text::write_out;
use indicatif::{ProgressBar, ProgressStyle};

use crate::global::Global;

/// A progress bar if standard error is a terminal.
pub struct Bar(ProgressBar);

impl Bar {
    pub fn new(message: &'static str, global: Global) -> Self {
        if global.quiet || !std::io::stderr().is_terminal() {
            return Self(ProgressBar::hidden());
        }
        let bar = ProgressBar::new(1000);
        if let Ok(style) = ProgressStyle::with_template("{msg:24} {wide_bar} {percent:>3} %  {eta} left") {
            bar.set_style(style);
        }
        bar.set_message(message);
        Self(bar)
    }

    pub fn set_message(&self, message: &str) {
        if !self.0.is_hidden() {
            self.0.set_message(message.to_owned());
        }
    }

    pub fn set_fraction(&self, fraction: f64) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 0 and 1,000
        self.0.set_position((fraction.clamp(0.0, 1.0) * 1000.0) as u64);
    }

    /// Callback of an identification: updates the bar and reports interruptions.
    pub fn stage_callback(&self) -> impl FnMut(&Stage<'_>) -> ControlFlow<()> {
        let mut update = self.callback();
        move |stage| {
            if !self.0.is_hidden() {
                self.0.set_message(stage_text(stage));
            }
            update(stage.fraction)
        }
    }

    /// Callback with a fraction: updates the bar and reports interruptions.
    pub fn callback(&self) -> impl FnMut(f64) -> ControlFlow<()> {
        |fraction| {
            self.set_fraction(fraction);
            if interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    }
}

/// `lstm: epoch 12 of 200, loss 0.0123, validation 0.0456, 35 s left`.
fn stage_text(stage: &Stage<'_>) -> String {
    let Some(method) = stage.method else { return String::from("evaluating") };
    let Some(status) = stage.training else { return String::from(method.name()) };
    let figure = |name: &str, x: f64| if x.is_finite() { format!(", {name} {x:.4}") } else { String::new() };
    format!(
        "{}: epoch {} of {}{}{}, {:.0} s left",
        method.name(),
        status.epoch,
        status.epochs,
        figure("loss", status.train_loss),
        figure("validation", status.validation),
        status.seconds_left.max(0.0)
    )
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

pub fn print_notes(notes: &[Note], global: Global) {
    for note in notes {
        if global.quiet && note.severity == Severity::Info {
            continue;
        }
        let kind = match note.severity {
            Severity::Info => "note",
            Severity::Warning => "warning",
        };
        eprintln!("{kind}: {}", printable(&note.message));
        if let Some(remedy) = &note.remedy {
            eprintln!("         {}", printable(remedy));
        }
    }
}

/// The command line, quoted for a shell.
pub fn command_line() -> String {
    let quoted = |word: String| {
        if word.contains([' ', '[', '*', '$', '"', '\'', ';', '&', '(', '|']) {
            format!("'{}'", word.replace('\'', "'\\''"))
        } else {
            word
        }
    };
    let given = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned());
    let words = std::iter::once(String::from("hydroid")).chain(given).map(quoted);
    words.collect::<Vec<_>>().join(" ")
}

macro_rules! outln {
    ($($text:tt)*) => {
        $crate::ui::write_out(format_args!("{}\n", format_args!($($text)*)))
    };
}
