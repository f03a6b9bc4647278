//! `hydroid adapt MODEL -`: a live stream.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLockReadGuard};
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use hydroid::adapt::{self, ResolvedOptions};
use hydroid::atomic::{self, Lock};
use hydroid::log::{LogError, Note};
use hydroid::model::{self, Model, Reading};
use hydroid_live::black_box::{Recorder, Source};
use hydroid_live::program::{interrupt, text};
use hydroid_live::stream::{Line, Lines, Options, Stream, StreamError, fingerprint};

use serde_json::{Value, json};

use super::super::Outcome;
use crate::args::{Adapt, Against, Global, Horizon, Origin};
use crate::ui;

/// Longest time for which an interrupted service brings commands to their neutral values.
const LONGEST_REST: Duration = Duration::from_secs(5);

/// State of the service, shared with the interruption handler.
pub struct Service {
    pub stream: Stream,
    pub model: Model,
    pub learning: adapt::Options,
    pub used: ResolvedOptions,
    pub name: String,
    pub output: Option<PathBuf>,
    pub global: Global,
    pub finished: bool,
    /// Whether the lines come as time passes: from a pipe.
    pub is_live: bool,
    /// Of the files that are written under way.
    pub locks: Vec<Lock>,
}

/// Source of the lines: standard input (`-`) or a file.
pub struct Lined {
    pub name: String,
    piped: bool,
}

impl Lined {
    pub fn of(log: &Path) -> Self {
        let piped = log == Path::new("-");
        let name = if piped { "standard input".to_owned() } else { log.display().to_string() };
        Self { name, piped }
    }

    /// Whether it is standard input.
    pub const fn is_piped(&self) -> bool {
        self.piped
    }

    pub fn open(&self) -> anyhow::Result<Box<dyn BufRead + Send>> {
        if self.piped {
            return Ok(Box::new(BufReader::new(io::stdin())));
        }
        let failed = |source| LogError::Read { path: self.name.clone(), source };
        Ok(Box::new(BufReader::new(File::open(&self.name).map_err(failed)?)))
    }
}

/// Keeps the state of a stream in a file, and says from where it resumes.
pub fn persist(
    stream: &mut Stream,
    path: &Path,
    model_print: String,
    settings: &Value,
    global: Global,
) -> anyhow::Result<()> {
    if let Some(t) = stream.persist_in(path, model_print, settings)? {
        let note = format!(
            "resuming from {} at {t} s: lines that were answered before are not used again",
            path.display()
        );
        ui::print_notes(&[Note::info(note)], global);
    }
    Ok(())
}

/// Fingerprint of a model's file; a built-in vessel has none, and its sample time is an option.
pub fn model_fingerprint(path: &Path, model: &Model) -> anyhow::Result<String> {
    let file = if model.is_vessel() {
        [model::encode(model)?, model.description.dt.to_le_bytes().to_vec()].concat()
    } else {
        std::fs::read(path).with_context(|| format!("{} cannot be read", path.display()))?
    };
    Ok(fingerprint(&file))
}

pub fn run(
    args: &Adapt,
    log: &Path,
    global: Global,
    model: &Model,
    reading: Reading,
) -> anyhow::Result<Outcome> {
    let judging = args.evaluation;
    ensure!(
        judging.horizon == Horizon::Samples(100)
            && judging.origin_stride == 1
            && judging.origin == Origin::Measured
            && judging.against == Against::Measurement,
        "--horizon, --origin-stride, --origin and --against need a complete log; a live stream has --horizons, as in --horizons 1,10,100"
    );
    let source = Lined::of(log);
    let name = source.name.clone();
    ensure!(
        args.guard.inject.is_none(),
        "--inject needs a complete log and cannot be used with a live stream"
    );
    let learning = super::options(args, model)?;
    let (mut adapter, used) =
        adapt::adapter(model, &learning, &[]).context("the model cannot be adapted from a live stream")?;
    let guard = &args.guard;
    let answers = &args.stream.answers;
    let written = [&answers.state, &args.black_box.black_box, &args.output];
    let locks = written.into_iter().flatten().map(|path| Lock::new(path)).collect::<Result<_, _>>()?;
    let training = crate::logs::training_logs(
        &guard.training_log,
        guard.training_time.0,
        (&args.model, model),
        &reading,
        global,
    )?;
    training.remember(adapter.as_mut());
    let recorder = super::blackbox::settings(args)?.map(|settings| {
        let described = json!({ "learning": used, "reading": reading });
        Recorder::new(&settings, model, adapter.as_mut(), &learning, &described, Source::Stream(&name))
    });
    let recorder = recorder.transpose()?;
    let options =
        Options { name: name.clone(), reading, horizons: answers.horizons(), timing: answers.timing };
    let mut stream = Stream::new(model, adapter, options)?;
    if let Some(path) = &answers.state {
        let mut settings = serde_json::to_value(&used)?;
        settings["guard"] = serde_json::to_value(&learning.guard)?;
        persist(&mut stream, path, model_fingerprint(&args.model, model)?, &settings, global)?;
    }
    if let Some(recorder) = recorder {
        stream.record(recorder);
    }
    // Fails early if the model cannot be written at the end.
    if let Some(folder) = args.output.as_ref().and_then(|path| path.parent()) {
        atomic::probe(if folder.as_os_str().is_empty() { Path::new(".") } else { folder })?;
    }
    let reader = source.open()?;
    let service = Service {
        stream,
        model: model.clone(),
        learning,
        used,
        name,
        output: args.output.clone(),
        global,
        finished: false,
        is_live: source.is_piped(),
        locks,
    };
    serve(reader, service)
}

/// A poisoned lock is usable: answers are written whole.
fn lock(service: &Mutex<Service>) -> MutexGuard<'_, Service> {
    service.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Standard output, during whose writes an interrupted program may end: the reader of the answers may not read.
struct Answers<'a> {
    out: io::Stdout,
    held: &'a mut Option<RwLockReadGuard<'static, ()>>,
}

impl Answers<'_> {
    fn released<T>(&mut self, act: impl FnOnce(&mut io::Stdout) -> T) -> T {
        *self.held = None;
        let done = act(&mut self.out);
        *self.held = Some(atomic::hold());
        done
    }
}

impl Write for Answers<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.released(|out| out.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.released(Write::flush)
    }
}

/// Answers each line until the source ends or the program is interrupted. A line that is being computed, and the files of
/// the end, are finished first.
pub fn serve(reader: Box<dyn BufRead + Send>, service: Service) -> anyhow::Result<Outcome> {
    let service = &Arc::new(Mutex::new(service));
    let interrupted = Arc::clone(service);
    // The main thread may wait for input.
    interrupt::at_interrupt(move || {
        let mut service = lock(&interrupted);
        let _held = atomic::hold();
        service.end_interrupted();
    });
    let answered = answer_lines(reader, service);
    let _held = atomic::hold();
    let mut service = lock(service);
    if answered.is_ok() && !service.stream.has_begun() {
        return Err(LogError::Empty { path: service.name.clone() }.into());
    }
    // State and model are written even if answers cannot be.
    let finished = if service.stream.has_begun() { service.finish() } else { Ok(()) };
    let outcome = if service.stream.is_left_without_task() { Outcome::Missed } else { Outcome::Done };
    service.rest("the input has ended");
    answered?;
    finished?;
    Ok(outcome)
}

/// A line that waits for its answer; `None` is one that is too long.
type Waiting = io::Result<Option<Vec<u8>>>;

/// Reads the lines in a thread, so that their absence can be answered, too. The thread ends with the source, or with the
/// program: a source that says nothing cannot be interrupted.
fn read_lines(reader: Box<dyn BufRead + Send>) -> Receiver<Waiting> {
    let (sender, receiver) = sync_channel(1);
    std::thread::spawn(move || {
        let mut lines = Lines::new(reader);
        loop {
            let line = match lines.next_line() {
                Ok(None) => return,
                Ok(Some(Line::TooLong)) => Ok(None),
                Ok(Some(Line::Whole(bytes))) => Ok(Some(bytes.to_vec())),
                Err(error) => Err(error),
            };
            let is_last = line.is_err();
            if sender.send(line).is_err() || is_last {
                return;
            }
        }
    });
    receiver
}

fn answer_lines(reader: Box<dyn BufRead + Send>, service: &Mutex<Service>) -> anyhow::Result<()> {
    let lines = read_lines(reader);
    loop {
        let due =
            lock(service).stream.due_s().map(|due| Duration::try_from_secs_f64(due).unwrap_or(Duration::MAX));
        let begun = Instant::now();
        let line = match due {
            Some(due) => lines.recv_timeout(due),
            None => lines.recv().map_err(|_| RecvTimeoutError::Disconnected),
        };
        let waited_s = begun.elapsed().as_secs_f64();
        if matches!(line, Err(RecvTimeoutError::Disconnected)) {
            return Ok(());
        }
        let mut service = lock(service);
        let mut held = Some(atomic::hold());
        let mut out = Answers { out: io::stdout(), held: &mut held };
        let served = if let Ok(line) = line {
            let line = line.map_err(|source| LogError::Read { path: service.name.clone(), source })?;
            service.stream.arrive_after(waited_s);
            service.stream.serve(line.as_deref().map_or(Line::TooLong, Line::Whole), &mut out)
        } else {
            service.stream.wait(waited_s, &mut out)
        };
        if interrupt::interrupted() {
            service.end_interrupted();
        }
        drop(held);
        let notes = service.stream.take_notes();
        ui::print_notes(&notes, service.global);
        match served {
            // The reader closed the pipe.
            Err(StreamError::Output(error)) if error.kind() == ErrorKind::BrokenPipe => return Ok(()),
            other => other?,
        }
    }
}

impl Service {
    /// Ends the program after an interruption; the caller holds the lock of the service.
    fn end_interrupted(&mut self) {
        if self.finished {
            return;
        }
        let status = match self.finish() {
            Ok(()) => 130,
            Err(error) => {
                text::print_error(&error);
                2
            }
        };
        // The reader of the answers may not read: the program ends nevertheless.
        std::thread::scope(|scope| {
            let rest = scope.spawn(|| self.rest("the service was interrupted"));
            let begun = Instant::now();
            while !rest.is_finished() && begun.elapsed() < LONGEST_REST {
                std::thread::sleep(Duration::from_millis(5));
            }
            std::process::exit(status);
        });
    }

    /// Brings the commands of a steered vessel to their neutral values, step by step as time passes. Nobody need read them.
    fn rest(&mut self, reason: &str) {
        let mut out = io::stdout();
        while let Ok(Some(next_s)) = self.stream.end(reason, &mut out) {
            if self.is_live {
                std::thread::sleep(Duration::try_from_secs_f64(next_s).unwrap_or_default());
            }
        }
    }

    fn finish(&mut self) -> anyhow::Result<()> {
        self.finished = true;
        let finished = self.finish_files();
        self.locks.clear();
        finished?;
        if !self.global.quiet {
            eprintln!("{}", self.stream.summary());
        }
        Ok(())
    }

    fn finish_files(&mut self) -> anyhow::Result<()> {
        self.stream.finish()?;
        ui::print_notes(&self.stream.take_notes(), self.global);
        if let Some(path) = &self.output {
            // Run names omit the folder, as for complete logs.
            let run = Path::new(&self.name)
                .file_name()
                .map_or(Cow::Borrowed(self.name.as_str()), |name| name.to_string_lossy());
            let learned =
                adapt::learned(&self.model, &self.learning, self.stream.weights(), &[&run], &self.used)?;
            model::write(&learned, path)?;
        }
        Ok(())
    }
}
