//! `hydroid control MODEL .. -`: commands for a live stream.

use std::path::Path;

use anyhow::{Context, ensure};
use hydroid::atomic::Lock;
use hydroid::config::control::{ClosedLoopOptions, Setup};
use hydroid_live::black_box::{Recorder, Source};
use hydroid_live::stream::{Options, Position, Stream};
use serde_json::json;

use super::super::Outcome;
use super::super::adapt::{blackbox, stream};
use crate::args::{Control, Global};
use crate::{logs, outputs};

/// Refuses options that only a simulation has.
pub(super) fn check_options(args: &Control, options: &ClosedLoopOptions) -> anyhow::Result<()> {
    if args.stream.is_none() {
        let given = &args.service;
        ensure!(
            !given.answers.is_given() && given.black_box.is_none(),
            "--horizons, --state, --timing and --black-box apply to a live stream: add - for standard input"
        );
        return Ok(options.check_simulated()?);
    }
    for (option, is_given) in [("--plant", args.plant.is_some()), ("--output", args.output.is_some())] {
        ensure!(!is_given, "{option} belongs to a simulated run: leave it out with a live stream");
    }
    Ok(options.check_on_board()?)
}

pub(super) struct Steered<'a> {
    pub(super) stream: &'a Path,
    pub(super) file: &'a Path,
    pub(super) setup: &'a Setup,
}

pub(super) fn run(args: &Control, global: Global, steered: &Steered<'_>) -> anyhow::Result<Outcome> {
    let setup = steered.setup;
    let Setup { model, scenario, controller, origin_deg, .. } = setup;
    let model = &**model;
    let written = [
        ("--state", args.service.answers.state.as_deref()),
        ("--black-box", args.service.black_box.as_deref()),
    ];
    let read = args.training_log.iter().map(AsRef::as_ref);
    outputs::check(&written, &read.chain([steered.stream, steered.file]).collect::<Vec<&Path>>())?;
    let written = [&args.service.answers.state, &args.service.black_box];
    let locks = written.into_iter().flatten().map(|path| Lock::new(path)).collect::<Result<_, _>>()?;
    let source = stream::Lined::of(steered.stream);
    let reading = &model.description.reading;
    let learning = setup.learning();
    let (mut adapter, used) = setup
        .adapter()
        .context("the service follows the vessel with a model that can be adapted, and this one cannot")?;
    if controller.adapt.is_some() {
        let files = &args.training_log;
        let of = (steered.file, model);
        logs::training_logs(files, args.training_time.0, of, reading, global)?.remember(adapter.as_mut());
    }
    let pilot =
        setup.pilot(adapter.as_ref(), None).context("this controller cannot be used with this model")?;
    let given = &args.service;
    let recorder = match &given.black_box {
        Some(path) => {
            ensure!(controller.adapt.is_some(), "--black-box records what a model learns: add --adapt");
            let settings = blackbox::recording(path, given.black_box_minutes, steered.file)?;
            let described = json!({ "learning": used, "reading": reading });
            let source = Source::Stream(&source.name);
            Some(Recorder::new(&settings, model, adapter.as_mut(), &learning, &described, source)?)
        }
        None => None,
    };
    let options = Options {
        name: source.name.clone(),
        reading: reading.clone(),
        horizons: given.answers.horizons(),
        timing: given.answers.timing,
    };
    let mut live = Stream::new(model, adapter, options)?;
    live.steer(pilot, Position { origin_deg: *origin_deg })?;
    if let Some(path) = &given.answers.state {
        let settings = json!({
            "adaptation": used,
            "guard": learning.guard,
            "controller": setup.description(),
            "task": {
                "path": setup.task,
                "pace": setup.pace,
                "dt_s": scenario.dt_s,
                "tolerance_m": scenario.tolerance,
                "limits": format!("{:?}", scenario.limits),
                "origin_deg": origin_deg,
            },
            "seed": args.options.seed,
        });
        let fingerprint = stream::model_fingerprint(steered.file, model)?;
        stream::persist(&mut live, path, fingerprint, &settings, global)?;
    }
    if let Some(recorder) = recorder {
        live.record(recorder);
    }
    let reader = source.open()?;
    let service = stream::Service {
        stream: live,
        model: model.clone(),
        learning,
        used,
        is_live: source.is_piped(),
        name: source.name,
        output: None,
        global,
        finished: false,
        locks,
    };
    stream::serve(reader, service)
}
