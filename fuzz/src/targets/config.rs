//! Configuration files of the identification.

use std::path::Path;

use hydroid::identify::{
    GivenRanges, Job, Method, MotionOption, NetworkOptions, NetworkTrainingOptions, RateLimitOption,
    SindyOptions, identify,
};
use hydroid::log::{ChannelSpec, Split, Trajectory, Wind};
use hydroid::model::Reading;
use hydroid::progress::silent;
use hydroid::toml_file::parse;
use hydroid::train::{CellKind, TrainOptions, train};
use serde::Deserialize;

use crate::{exercise, models};

/// The sections of the file that the library reads.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Config {
    log: Log,
    identify: Identify,
    sindy: SindyOptions,
    network: NetworkOptions,
    lstm: NetworkOptions,
    gru: NetworkOptions,
    rnn: NetworkOptions,
    direct: NetworkOptions,
    affine: NetworkOptions,
    ranges: GivenRanges,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Log {
    outputs: Vec<ChannelSpec>,
    inputs: Vec<ChannelSpec>,
    wind: Option<Wind>,
    heading: Option<ChannelSpec>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Identify {
    motion: Option<MotionOption>,
    rate_limit: Option<RateLimitOption>,
}

/// What is read as a configuration is used for a small job.
pub fn config(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(config) = parse::<Config>(text, Path::new("hydroid.toml")) else { return };
    let Log { outputs, inputs, wind, heading } = config.log;
    let specs = outputs.iter().chain(&inputs).chain(&heading).map(ToString::to_string);
    let specs = specs.collect::<Vec<_>>().join(",");
    if !(specs.is_empty() || specs.matches(',').count() + 1 > outputs.len() + inputs.len() + 1) {
        ChannelSpec::parse_list(&specs).expect("a printed channel is read");
    }
    let _ = wind;
    let run = exercise::run(&models::model("equations"));
    searched(&config.sindy, &run);
    let networks = NetworkTrainingOptions {
        all: config.network,
        lstm: config.lstm,
        gru: config.gru,
        rnn: config.rnn,
        direct: config.direct,
        affine: config.affine,
        ..NetworkTrainingOptions::default()
    };
    for cell in [CellKind::Lstm, CellKind::Gru, CellKind::Rnn, CellKind::Direct, CellKind::Affine] {
        trained(networks.settings(cell, 1), &run);
    }
    let part = |from, to| vec![run.slice(from, to)];
    let split = Split { train: part(0, 8), validation: Vec::new(), test: part(8, 12), notes: Vec::new() };
    // Without terms to search, the fit is short.
    let is_short = !config.sindy.terms.is_empty() || config.sindy.degree == Some(1);
    let job = Job {
        methods: vec![Method::Sindy],
        split,
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon: 2,
        origin_stride: 1,
        seed: 1,
        ranges: config.ranges,
        motion: config.identify.motion.unwrap_or_default(),
        rate_limits: config.identify.rate_limit.unwrap_or_default(),
        allow_feedback: Vec::new(),
        sindy: config.sindy,
        networks,
        vessel: None,
    };
    if is_short {
        let _ = identify(&job, &mut silent());
    }
}

fn searched(options: &SindyOptions, run: &Trajectory) {
    if options.check().is_err() {
        return;
    }
    let _ = (options.lags(run), options.gate(&[run]));
    if let Ok(libraries) = options.libraries(run) {
        let _ = options.grid(&[run], 4, &libraries, &[], true);
    }
}

/// Trains a network of a few weights for an epoch.
fn trained(options: TrainOptions, run: &Trajectory) {
    let outputs = run.outputs.width();
    if options.check(outputs).is_err() {
        return;
    }
    let (inputs, spans) = (run.inputs.width(), options.spans(run.dt));
    let _ = (options.network(inputs, outputs), options.perceptron(inputs, outputs, spans));
    let _ = options.control_affine(inputs, outputs);
    let options = TrainOptions {
        hidden: options.hidden.min(2),
        layers: options.layers.map(|layers| layers.min(2)),
        epochs: options.epochs.min(1),
        restarts: options.restarts.min(1),
        refit: false,
        ..options
    };
    let ranges = vec![hydroid::evaluate::DesignRange { low: -1.0, high: 1.0 }; 2];
    let runs = [run];
    let job = hydroid::train::Job {
        runs: &runs,
        validation: &runs,
        outputs: &ranges,
        inputs: &ranges,
        horizon: 2,
        equations: None,
    };
    let _ = train(&job, &options, None, &mut |_| std::ops::ControlFlow::Continue(()));
}
