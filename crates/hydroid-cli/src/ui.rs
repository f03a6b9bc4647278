//! What the user sees besides results: progress, notes, complaints. All of it goes to standard error.

use std::io::{IsTerminal, Write as _};
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use hydroid::identify::Stage;
use hydroid::log::{Note, Severity};
use indicatif::{ProgressBar, ProgressStyle};

use crate::args::Global;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// What is to be done at an interruption by who waits for input and cannot look out for it.
static AT_INTERRUPT: Mutex<Option<Box<dyn FnOnce() + Send>>> = Mutex::new(None);

/// From now on the first ctrl-C (or SIGTERM, or a terminal that is closed) asks the work to stop cleanly, the
/// second ends the program.
pub fn catch_interrupt() {
    // Without a handler ctrl-C ends the program at once; files are written atomically in either case.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
        // In a thread of its own, so that the second ctrl-C is heard.
        if let Some(act) = AT_INTERRUPT.lock().ok().and_then(|mut act| act.take()) {
            std::thread::spawn(act);
        }
    });
}

/// At an interruption this is done, in a thread of its own; it has to end the program.
pub fn at_interrupt(act: impl FnOnce() + Send + 'static) {
    if let Ok(mut place) = AT_INTERRUPT.lock() {
        *place = Some(Box::new(act));
    }
}

/// Whether ctrl-C was pressed.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// A progress bar where standard error is a terminal, silence elsewhere.
pub struct Bar(ProgressBar);

impl Bar {
    /// A bar that says what is going on.
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

    /// Says what is at work.
    pub fn say(&self, words: &str) {
        if !self.0.is_hidden() {
            self.0.set_message(words.to_owned());
        }
    }

    /// Moves the bar to a fraction of the whole.
    pub fn at(&self, fraction: f64) {
        // A fraction of 1000 steps, clamped.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        self.0.set_position((fraction.clamp(0.0, 1.0) * 1000.0) as u64);
    }

    /// The callback for an identification: moves the bar, says what is at work and how it does, and passes ctrl-C on.
    pub fn stages(&self) -> impl FnMut(&Stage<'_>) -> ControlFlow<()> {
        let mut move_on = self.callback();
        move |stage| {
            if !self.0.is_hidden() {
                self.0.set_message(at_work(stage));
            }
            move_on(stage.fraction)
        }
    }

    /// The callback for the library: moves the bar, and passes ctrl-C on.
    pub fn callback(&self) -> impl FnMut(f64) -> ControlFlow<()> {
        |fraction| {
            self.at(fraction);
            if interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    }
}

/// `lstm: epoch 12 of 200, loss 0.0123, validation 0.0456, 35 s left`.
fn at_work(stage: &Stage<'_>) -> String {
    let Some(method) = stage.method else { return String::from("judging") };
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

/// Tells notes.
pub fn tell(notes: &[Note], global: Global) {
    for note in notes {
        if global.quiet && note.severity == Severity::Info {
            continue;
        }
        let kind = match note.severity {
            Severity::Info => "note",
            Severity::Warning => "warning",
        };
        eprintln!("{kind}: {}", note.message);
        if let Some(remedy) = &note.remedy {
            eprintln!("         {remedy}");
        }
    }
}

/// Tells an error.
pub fn complain(error: &anyhow::Error) {
    eprintln!("error: {}", explain(error));
}

/// An error with its causes, none of them told twice: many messages hold the words of their cause.
pub fn explain(error: &anyhow::Error) -> String {
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

/// The command line, as a shell takes it again.
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

/// Writes results to standard output. A reader that has seen enough (`| head`) ends the program quietly.
pub fn write_out(text: std::fmt::Arguments<'_>) {
    if let Err(error) = std::io::stdout().lock().write_fmt(text) {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        eprintln!("error: standard output cannot be written: {error}");
        std::process::exit(2);
    }
}

/// `println!` for results.
macro_rules! outln {
    ($($text:tt)*) => {
        $crate::ui::write_out(format_args!("{}\n", format_args!($($text)*)))
    };
}
