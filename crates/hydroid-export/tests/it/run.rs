//! A run of a model and its predictions by hydroid.

use hydroid::model::Model;
use hydroid_core::predict::{Predictor, Workspace};
use serde::Serialize;

use crate::models::{commands, drawn, first_outputs};

/// Samples with measurements, and of the rollout after them: a multiple of the horizon of the direct predictors.
pub(crate) const ALONG: usize = 40;
pub(crate) const AHEAD: usize = 1002;

/// Samples that are predicted one by one.
const STEPPED: usize = 20;

/// A steady motion, a run with measurements, and a rollout. Tables are flat, row by row.
#[derive(Serialize)]
pub(crate) struct Run {
    /// Outputs and command of the steady motion.
    pub(crate) first: Vec<f64>,
    pub(crate) held: Vec<f64>,
    /// Commands and measurements; NaN (null in JSON) is a missing value.
    pub(crate) along: Vec<f64>,
    pub(crate) measured: Vec<f64>,
    /// Commands of the rollout, and the predictions.
    pub(crate) ahead: Vec<f64>,
    pub(crate) predicted: Vec<f64>,
    /// Outputs after the first 20 commands, one by one.
    pub(crate) stepped: Vec<f64>,
}

/// A session in a steady motion. The actuators of a vessel that the motion does not place are at the order of the command.
pub(crate) fn steady(model: &Model, y: &[f64], c: &[f64]) -> Box<dyn Predictor> {
    let mut session = model.frozen().session();
    for _ in 1..session.warm_up() {
        session.observe(y);
        session.advance(c);
    }
    session.observe(y);
    if model.craft().is_some() {
        let [mut placed, mut settled] = [(); 2].map(|()| vec![0.0; session.snapshot_len()]);
        session.snapshot(&mut placed);
        session.advance(c);
        session.snapshot(&mut settled);
        for (placed, settled) in placed.iter_mut().zip(settled) {
            *placed = if placed.is_nan() { settled } else { *placed };
        }
        session.restore(&placed);
    }
    session
}

pub(crate) fn rollout(session: &dyn Predictor, commands: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; commands.len() / session.inputs() * session.outputs()];
    session.rollout(commands, &mut Workspace::new(), &mut y);
    y
}

/// Measurements around a steady motion, one row; some rows have a missing value.
pub(crate) fn measured(y: &[f64], k: usize) -> Vec<f64> {
    let n = y.len();
    let mut row: Vec<f64> =
        y.iter().zip(drawn(n, k as f64)).map(|(y, noise)| y * (1.0 + 0.02 * noise)).collect();
    if k % 5 == 3 {
        row[k % n] = f64::NAN;
    }
    row
}

/// Largest difference, relative to the largest magnitude of each output.
pub(crate) fn difference(a: &[f64], b: &[f64], outputs: usize) -> f64 {
    assert_eq!(a.len(), b.len());
    assert!(a.iter().chain(b).all(|x| x.is_finite()), "not finite");
    let of = |output: usize| {
        let pairs = || a.iter().zip(b).skip(output).step_by(outputs);
        let scale = pairs().map(|(a, b)| a.abs().max(b.abs())).fold(1e-3, f64::max);
        pairs().map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / scale
    };
    (0..outputs).map(of).fold(0.0, f64::max)
}

impl Run {
    pub(crate) fn of(model: &Model) -> Self {
        let (first, held) = (first_outputs(model), commands(model, 1, 0.4));
        let (along, ahead) = (commands(model, ALONG, 2.0), commands(model, AHEAD, 1.0));
        let (n, m) = (first.len(), held.len());
        let mut session = steady(model, &first, &held);
        let mut rows = Vec::new();
        for (k, c) in along.chunks_exact(m).enumerate() {
            let row = measured(&first, k);
            session.advance(c);
            session.observe(&row);
            rows.extend(row);
        }
        let predicted = rollout(&*session, &ahead);
        let stepped = if model.direct().is_some() {
            // Step by step, the command of a step stands for all of the horizon.
            ahead[..STEPPED * m].chunks_exact(m).for_each(|c| session.advance(c));
            let mut y = vec![0.0; n];
            session.output(&mut y);
            y
        } else {
            predicted[(STEPPED - 1) * n..STEPPED * n].to_vec()
        };
        Self { first, held, along, measured: rows, ahead, predicted, stepped }
    }
}
