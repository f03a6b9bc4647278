//! `hydroid control MODEL .. -`: commands for a live stream.

use std::path::Path;

use anyhow::{Context, ensure};
use hydroid::adapt;
use hydroid::atomic::Lock;
use hydroid::closed_loop::{ControllerOptions, Scenario};
use hydroid::model::Model;
use hydroid_live::black_box::{Recorder, Source};
use hydroid_live::stream::{Options, Pilot, Position, Stream};
use serde_json::{Value, json};

use super::super::Outcome;
use super::super::adapt::{blackbox, stream};
use crate::args::{Control, Global};
use crate::{logs, outputs};

/// Refuses options that only a simulation has.
pub(super) fn check_options(args: &Control) -> anyhow::Result<()> {
    if args.stream.is_none() {
        let given = &args.service;
        ensure!(
            !given.answers.is_given() && given.black_box.is_none(),
            "--horizons, --state, --timing and --black-box apply to a live stream: add - for standard input"
        );
        return Ok(());
    }
    let unknown = &args.disturbances;
    let refused = [
        ("--plant", args.plant.is_some()),
        ("--output", args.output.is_some()),
        ("--runs", args.monte_carlo.runs != 1),
        ("--duration", args.task.duration.is_some()),
        ("--start", args.task.start.is_some()),
        ("--evaluate-from", args.controller.evaluate_from.is_some()),
        ("--noise", unknown.noise != 1.0),
        ("--process-noise", unknown.process_noise != 0.0),
        ("--current", unknown.current.0 != [0.0; 2]),
        ("--wind", unknown.wind.0 != [0.0; 2]),
        ("--gusts", unknown.gusts.0[0] != 0.0),
        ("--mass", unknown.mass != 1.0),
        ("--delay", unknown.delay != 0.0),
        ("--onset", unknown.onset.is_some()),
    ];
    for (option, is_given) in refused {
        ensure!(!is_given, "{option} belongs to a simulated run: leave it out with a live stream");
    }
    Ok(())
}

pub(super) struct Steered<'a> {
    pub(super) stream: &'a Path,
    pub(super) file: &'a Path,
    pub(super) model: &'a Model,
    pub(super) scene: &'a Scenario,
    pub(super) steering: &'a ControllerOptions,
    pub(super) controller: &'a Value,
    pub(super) task: &'a Value,
    pub(super) origin_deg: Option<[f64; 2]>,
}

pub(super) fn run(args: &Control, global: Global, steered: &Steered<'_>) -> anyhow::Result<Outcome> {
    let Steered { model, scene, steering, .. } = *steered;
    let written = [
        ("--state", args.service.answers.state.as_deref()),
        ("--black-box", args.service.black_box.as_deref()),
    ];
    let read = args.adaptation.training_log.iter().map(AsRef::as_ref);
    outputs::check(&written, &read.chain([steered.stream, steered.file]).collect::<Vec<&Path>>())?;
    let written = [&args.service.answers.state, &args.service.black_box];
    let locks = written.into_iter().flatten().map(|path| Lock::new(path)).collect::<Result<_, _>>()?;
    let source = stream::Lined::of(steered.stream);
    let reading = &model.description.reading;
    let learning = steering.adapt.clone().unwrap_or_else(|| adapt::Options::of(model));
    let (mut adapter, used) = adapt::adapter(model, &learning, &[])
        .context("the service follows the vessel with a model that can be adapted, and this one cannot")?;
    let weights = if steering.adapt.is_some() {
        let files = &args.adaptation.training_log;
        let of = (steered.file, model);
        logs::training_logs(files, args.adaptation.training_time.0, of, reading, global)?
            .remember(adapter.as_mut());
        Some(adapter.guard().map_or_else(|| adapter.weights(), |guard| guard.active_weights()).len())
    } else {
        adapter.freeze(true);
        None
    };
    let pilot = Pilot::new(steering, scene.track.clone(), args.disturbances.seed, weights)
        .context("this controller cannot be used with this model")?;
    let given = &args.service;
    let recorder = match &given.black_box {
        Some(path) => {
            ensure!(steering.adapt.is_some(), "--black-box records what a model learns: add --adapt");
            let settings = blackbox::recording(path, given.black_box_minutes, steered.file)?;
            let described = json!({ "learning": used, "reading": reading });
            let source = Source::Stream(&source.name);
            Some(Recorder::new(&settings, model, adapter.as_ref(), &learning, &described, source)?)
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
    live.steer(pilot, Position { origin_deg: steered.origin_deg })?;
    if let Some(path) = &given.answers.state {
        let settings = json!({
            "adaptation": used,
            "guard": learning.guard,
            "controller": steered.controller,
            "task": steered.task,
            "seed": args.disturbances.seed,
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
        used,
        name: source.name,
        output: None,
        global,
        finished: false,
        locks,
    };
    stream::serve(reader, service)
}
