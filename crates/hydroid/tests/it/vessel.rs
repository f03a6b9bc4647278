//! A synthetic vessel with two outputs, and runs of it.

use hydroid::evaluate::DesignRange;
use hydroid::log::{Channel, Table, Trajectory};

pub(crate) const OUTPUTS: [DesignRange; 2] =
    [DesignRange { low: -1.5, high: 1.5 }, DesignRange { low: -1.0, high: 1.0 }];
pub(crate) const INPUTS: [DesignRange; 1] = [DesignRange { low: -1.0, high: 1.0 }];

/// Its run under a command and a measurement by sample.
pub(crate) fn sail(
    name: &str,
    samples: usize,
    mut command: impl FnMut(usize) -> f64,
    mut measure: impl FnMut(usize, [f64; 2]) -> [f64; 2],
) -> Trajectory {
    let (mut u, mut v) = (0.0, 0.0);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for k in 0..samples {
        let c = command(k);
        inputs.push(c);
        outputs.extend(measure(k, [u, v]));
        (u, v) = (u + 0.1 * (c - u - 0.5 * v * v), v + 0.1 * (0.8 * u - 1.5 * v));
    }
    let outputs = measured(outputs);
    let inputs = Table::new([Channel::new("n", "1/s")], inputs);
    Trajectory {
        name: name.to_owned(),
        t0: 0.0,
        dt: 0.1,
        outputs,
        inputs,
        truth: None,
        heading: None,
        position: None,
    }
}

pub(crate) fn measured(values: Vec<f64>) -> Table {
    Table::new([Channel::new("u", "m/s"), Channel::new("v", "m/s")], values)
}

pub(crate) fn sines(phase: f64) -> impl FnMut(usize) -> f64 {
    move |k| {
        let t = 0.1 * k as f64 + phase;
        0.6 * (0.7 * t).sin() + 0.4 * (1.9 * t).sin()
    }
}

/// A run under a sum of sines, without noise.
pub(crate) fn smooth(name: &str, samples: usize, phase: f64) -> Trajectory {
    sail(name, samples, sines(phase), |_, y| y)
}

/// A run with missing values in both outputs.
pub(crate) fn with_gaps(name: &str, samples: usize, phase: f64) -> Trajectory {
    let missing = |k: usize, every: usize, y: f64| if k % every == every - 1 { f64::NAN } else { y };
    sail(name, samples, sines(phase), |k, [u, v]| [missing(k, 61, u), missing(k, 83, v)])
}
