//! `hydroid adapt MODEL -`: a live stream.

use std::borrow::Cow;
use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::{Context, ensure};
use hydroid::adapt::{self, Used};
use hydroid::atomic;
use hydroid::log::{LogError, Note};
use hydroid::model::{self, Model, Reading};
use hydroid_live::black_box::{Recorder, Source};
use hydroid_live::stream::{Lines, Options, Stream, StreamError, fingerprint};

use serde_json::json;

use super::super::Outcome;
use crate::args::{Adapt, Against, Global, Horizon, Origin};
use crate::ui;

/// Horizons where none are asked for \[samples\].
const HORIZONS: [usize; 4] = [1, 10, 50, 100];

/// All that is needed to end the work, from here or from an interruption.
struct Service {
    stream: Stream,
    model: Model,
    used: Used,
    name: String,
    output: Option<PathBuf>,
    global: Global,
    finished: bool,
}

pub fn run(
    args: &Adapt,
    log: &Path,
    global: Global,
    model: &Model,
    reading: Reading,
) -> anyhow::Result<Outcome> {
    let judging = args.judging;
    ensure!(
        judging.horizon == Horizon::Samples(100)
            && judging.origin_stride == 1
            && judging.origin == Origin::Measured
            && judging.against == Against::Measurement,
        "--horizon, --origin-stride, --origin and --against judge a log that is read as a whole; a stream has --horizons 1,10,100"
    );
    let piped = log == Path::new("-");
    let name = if piped { "standard input".to_owned() } else { log.display().to_string() };
    ensure!(
        args.trust.inject.is_none(),
        "--inject puts faults into a log that is read as a whole, not into a stream"
    );
    let learning = super::options(args, model)?;
    let (mut adapter, used) =
        adapt::adapter(model, &learning, &[]).context("the model cannot learn from a stream")?;
    let trust = &args.trust;
    let shore = crate::logs::shore(&trust.shore, trust.shore_time.0, (&args.model, model), &reading, global)?;
    shore.remember(adapter.as_mut());
    let recorder = super::blackbox::settings(args)?.map(|settings| {
        let described = json!({ "learning": used, "reading": reading });
        Recorder::new(&settings, model, adapter.as_ref(), &learning, &described, Source::Stream(&name))
    });
    let recorder = recorder.transpose()?;
    let options = Options {
        name: name.clone(),
        reading,
        horizons: args.stream.horizons.clone().unwrap_or_else(|| HORIZONS.to_vec()),
        timing: args.stream.timing,
    };
    let mut stream = Stream::new(model, adapter, options)?;
    if let Some(path) = &args.stream.state {
        let mut settings = serde_json::to_value(&used)?;
        settings["guard"] = serde_json::to_value(&learning.guard)?;
        let file =
            // A vessel may have no file, and takes the sample time that it is given.
            if model.plant().is_some() {
                [model::encode(model)?, model.description.dt.to_le_bytes().to_vec()].concat()
            } else {
                std::fs::read(&args.model)
                    .with_context(|| format!("{} cannot be read", args.model.display()))?
            };
        if let Some(t) = stream.keep_in(path, fingerprint(&file), &settings)? {
            let note = format!("going on from {} at {t} s: lines up to then are skipped", path.display());
            ui::tell(&[Note::info(note)], global);
        }
    }
    if let Some(recorder) = recorder {
        stream.record(recorder);
    }
    // What cannot be written at the end is better known now.
    if let Some(folder) = args.output.as_ref().and_then(|path| path.parent()) {
        atomic::probe(if folder.as_os_str().is_empty() { Path::new(".") } else { folder })?;
    }
    let reader: Box<dyn BufRead> = if piped {
        Box::new(std::io::stdin().lock())
    } else {
        let failed = |source| LogError::Read { path: name.clone(), source };
        Box::new(BufReader::new(File::open(log).map_err(failed)?))
    };
    let service = Service {
        stream,
        model: model.clone(),
        used,
        name,
        output: args.output.clone(),
        global,
        finished: false,
    };
    serve(reader, &Arc::new(Mutex::new(service)))
}

/// Nothing that was in use when another thread panicked is half-done: answers are written whole.
fn lock(service: &Mutex<Service>) -> MutexGuard<'_, Service> {
    service.lock().unwrap_or_else(PoisonError::into_inner)
}

fn serve(reader: Box<dyn BufRead>, service: &Arc<Mutex<Service>>) -> anyhow::Result<Outcome> {
    let interrupted = Arc::clone(service);
    // Who waits for a line cannot look out for an interruption. A line that is being answered is finished first.
    ui::at_interrupt(move || {
        let mut service = lock(&interrupted);
        if service.finished {
            return;
        }
        let status = match service.finish() {
            Ok(()) => 130,
            Err(error) => {
                ui::complain(&error);
                2
            }
        };
        std::process::exit(status);
    });
    let mut lines = Lines::new(reader);
    let mut out = std::io::stdout();
    loop {
        let name = || lock(service).name.clone();
        let Some(line) = lines.next_line().map_err(|source| LogError::Read { path: name(), source })? else {
            break;
        };
        let mut service = lock(service);
        let served = service.stream.serve(line, &mut out);
        let notes = service.stream.take_notes();
        ui::tell(&notes, service.global);
        match served {
            // Nobody reads on: the end.
            Err(StreamError::Output(error)) if error.kind() == ErrorKind::BrokenPipe => break,
            other => other?,
        }
    }
    let mut service = lock(service);
    if !service.stream.has_begun() {
        return Err(LogError::Empty { path: service.name.clone() }.into());
    }
    service.finish()?;
    Ok(Outcome::Done)
}

impl Service {
    /// Writes state and model, and says what came of it all.
    fn finish(&mut self) -> anyhow::Result<()> {
        self.finished = true;
        self.stream.finish()?;
        ui::tell(&self.stream.take_notes(), self.global);
        if let Some(path) = &self.output {
            // As the runs of a log that is read as a whole: without its folder.
            let run = Path::new(&self.name)
                .file_name()
                .map_or(Cow::Borrowed(self.name.as_str()), |name| name.to_string_lossy());
            let learned = adapt::learned(&self.model, self.stream.weights(), &[&run], &self.used)?;
            model::write(&learned, path)?;
        }
        if !self.global.quiet {
            eprintln!("{}", self.stream.summary());
        }
        Ok(())
    }
}
