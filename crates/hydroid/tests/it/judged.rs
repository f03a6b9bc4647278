//! Runs with known outputs, and their evaluation.

use std::ops::ControlFlow;

use hydroid::evaluate::{DesignRange, EvaluateError, Evaluation, Options, evaluate};
use hydroid::log::{Channel, Table, Trajectory};
use hydroid_core::predict::Predictor;

pub(crate) const DT: f64 = 0.5;

pub(crate) fn table(names: &[&str], unit: &str, rows: &[Vec<f64>]) -> Table {
    let channels: Vec<Channel> = names.iter().map(|n| Channel::new(*n, unit)).collect();
    Table::new(channels, rows.concat())
}

/// Outputs `u` and `v`; the input is the index of the sample, which gives test doubles access to the truth.
pub(crate) fn run(name: &str, outputs: &[Vec<f64>]) -> Trajectory {
    let numbers: Vec<Vec<f64>> = (0..outputs.len()).map(|k| vec![k as f64]).collect();
    Trajectory {
        name: name.to_owned(),
        t0: 100.0,
        dt: DT,
        outputs: table(&["u", "v"], "m/s", outputs),
        inputs: table(&["k"], "", &numbers),
        truth: None,
        heading: None,
        position: None,
    }
}

pub(crate) fn wave(samples: usize) -> Vec<Vec<f64>> {
    (0..samples).map(|k| vec![(0.3 * k as f64).sin() + 2.0, 0.5 * (0.17 * k as f64).cos()]).collect()
}

pub(crate) const RANGES: [DesignRange; 2] =
    [DesignRange { low: 0.0, high: 4.0 }, DesignRange { low: -1.0, high: 1.0 }];

pub(crate) fn options(horizon: usize) -> Options {
    Options { horizon, ..Options::default() }
}

pub(crate) fn judge(
    predictor: &dyn Predictor,
    runs: &[&Trajectory],
    options: &Options,
) -> Result<Evaluation, EvaluateError> {
    evaluate("double", predictor.fork().as_mut(), &RANGES, runs, options, &mut |_| ControlFlow::Continue(()))
}
