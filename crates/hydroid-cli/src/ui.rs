//! Progress, notes and errors on standard error; results on standard output.

use std::borrow::Cow;
use std::io::{IsTerminal, Write as _};
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use hydroid::atomic;
use hydroid::identify::Stage;
use hydroid::log::{Note, Severity};
use indicatif::{ProgressBar, ProgressStyle};

use crate::args::Global;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Action at an interruption, for threads that wait for input.
static AT_INTERRUPT: Mutex<Option<Box<dyn FnOnce() + Send>>> = Mutex::new(None);

/// Time after which an interrupted program ends wherever it is \[ms\].
static GRACE_MS: AtomicU64 = AtomicU64::new(800);

/// Longest time to wait for a file that is being written.
const WRITING: Duration = Duration::from_secs(5);

/// Installs the signal handler: the first ctrl-C, SIGTERM or SIGHUP requests a stop, and ends a program that is blocked after
/// [`GRACE_MS`]; the second ends it at once.
pub fn catch_interrupt() {
    // Without a handler, ctrl-C ends the program at once; files are written atomically in either case.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
        // In threads, so that the handler receives a second ctrl-C.
        if let Some(act) = AT_INTERRUPT.lock().ok().and_then(|mut act| act.take()) {
            std::thread::spawn(act);
        }
        std::thread::spawn(|| {
            std::thread::sleep(Duration::from_millis(GRACE_MS.load(Ordering::Relaxed)));
            let _settled = atomic::settle(WRITING);
            std::process::exit(130);
        });
    });
}

/// Text for a terminal: control characters of names and cells from files are escaped, as in JSON.
fn printable(text: &str) -> Cow<'_, str> {
    let hostile = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    if !text.contains(hostile) {
        return Cow::Borrowed(text);
    }
    let escaped = |c: char| if hostile(c) { format!("\\u{:04x}", u32::from(c)) } else { c.to_string() };
    Cow::Owned(text.chars().map(escaped).collect())
}

/// Gives an interrupted program more time to end.
pub fn grant(time: Duration) {
    GRACE_MS.store(u64::try_from(time.as_millis()).unwrap_or(u64::MAX), Ordering::Relaxed);
}

/// Sets the action at an interruption. It runs in a thread and must end the program.
pub fn at_interrupt(act: impl FnOnce() + Send + 'static) {
    if let Ok(mut place) = AT_INTERRUPT.lock() {
        *place = Some(Box::new(act));
    }
}

pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

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

/// The command line, quoted for a shell.
pub fn command_line() -> String {
    let quoted = |word: String| {
        if word.contains([' ', '[', '*', '$', '"', '\'', ';', '&', '(', '|']) {
            format!("'{}'", word.replace('\'', "'\\''"))
        } else {
            word
        }
    };
    let words = std::iter::once(String::from("hydroid")).chain(std::env::args().skip(1)).map(quoted);
    words.collect::<Vec<_>>().join(" ")
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

macro_rules! outln {
    ($($text:tt)*) => {
        $crate::ui::write_out(format_args!("{}\n", format_args!($($text)*)))
    };
}
