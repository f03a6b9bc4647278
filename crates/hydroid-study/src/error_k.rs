//! The error measure of the thesis (section 4.2), Error(k), of a model and of C0.
//!
//! For each output, `Error(k)` is the mean absolute error over 10 windows of 20 steps; window `m` starts at sample `k +
//! 20 m`, and `k = 3, 203, 403, ..`, so that windows are consecutive. Models with a longer warm-up start at a later
//! `k`. Rollouts start from measurements and are compared with the truth. For comparison: C0, the perfect model of low
//! speed, from the true state with the true propeller force; and the noise floor, the true plant from the measured
//! velocities with the true force.

use hydroid_core::craft::{Craft, Dynamics};
use hydroid_core::predict::{Predictor, Workspace};
use serde::{Deserialize, Serialize};

use super::StudyError;
use hydroid::log::Trajectory;
use hydroid::simulate::Simulated;
use hydroid_report::figure::{Figure, Key, Line, Mark, Panel, Stroke};
use hydroid_report::style;

/// Steps of a window.
pub(super) const STEPS: usize = 20;
/// Windows of an `Error(k)`.
pub(super) const WINDOWS: usize = 10;
const FIRST: usize = 3;
/// Speed of the change of mode of the hydrofoil \[m/s\].
pub(super) const TRANSITION: f64 = 2.5;
/// Origin stride for the noise floor.
const STRIDE: usize = 5;
/// Integration step of a plant \[s\].
const INTERNAL_S: f64 = 0.01;
/// Smaller errors are drawn at this value.
const LEAST: f64 = 1e-4;

const OUTPUTS: usize = 3;

/// Speed ranges of the blocks, see [`is`].
pub(super) const PLACES: [&str; 3] = ["all", "below the transition", "mean u above it"];

/// Mean absolute errors of `u`, `v`, `r`.
pub(super) type Errors = [f64; OUTPUTS];

/// A log with quantities that only a simulation provides.
#[derive(Clone, Debug)]
pub(super) struct Record {
    /// Outputs `u`, `v`, `r`, and the commands of propeller and rudder.
    pub(super) run: Trajectory,
    /// True outputs, row by row.
    pub(super) truth: Vec<f64>,
    /// True force of the propeller \[N\].
    pub(super) force: Vec<f64>,
}

/// One block of Error(k).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Block {
    pub(super) k: usize,
    /// Mean true speed \[m/s\].
    pub(super) mean_u: f64,
    /// Largest true speed \[m/s\].
    pub(super) max_u: f64,
    /// Errors of the model.
    pub(super) model: Errors,
    /// Errors of C0.
    pub c0: Errors,
}

/// Whether a block lies in a speed range of [`PLACES`].
pub(super) fn is(block: &Block, place: usize) -> bool {
    match place {
        1 => block.max_u < TRANSITION,
        2 => block.mean_u > TRANSITION,
        _ => true,
    }
}

impl Record {
    /// The record of a simulation.
    ///
    /// # Errors
    /// If the simulation lacks an output `u`, `v` or `r`.
    pub(super) fn of(simulated: &Simulated) -> Result<Self, StudyError> {
        let run = simulated.to_trajectory(&["u", "v", "r"])?;
        let states = simulated.states();
        let truth = states.iter().flat_map(|state| [state.u, state.v, state.r]).collect();
        Ok(Self { run, truth, force: states.iter().map(|state| state.p_f).collect() })
    }

    /// True outputs at a sample.
    pub(super) fn truth(&self, k: usize) -> Errors {
        std::array::from_fn(|c| self.truth[k * OUTPUTS + c])
    }

    fn error(&self, k: usize, y: &[f64]) -> Errors {
        let truth = self.truth(k);
        std::array::from_fn(|c| (y[c] - truth[c]).abs())
    }

    /// Mean absolute error of a plant over a window.
    pub(super) fn of_plant(&self, plant: &Dynamics, from: Errors, origin: usize) -> Errors {
        // The order of the propeller is its force, and the rudder follows at once.
        let (mut nu, mut positions) = (from, [self.force[origin], 0.0]);
        let mut sums = [0.0; OUTPUTS];
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and positive")]
        let steps = (self.run.dt / INTERNAL_S).round().max(1.0) as usize;
        for k in origin..origin + STEPS {
            let c = self.run.inputs.row(k);
            plant.advance(&mut nu, &mut positions, c, self.run.dt / steps as f64, steps);
            add(&mut sums, self.error(k + 1, &nu), STEPS);
        }
        sums
    }
}

/// Adds errors to a mean of `of` values.
pub(super) fn add(sums: &mut Errors, errors: Errors, of: usize) {
    for (sum, error) in sums.iter_mut().zip(errors) {
        *sum += error / of as f64;
    }
}

/// Mean errors of the model over the window from each origin; `None` without a window.
fn windows(record: &Record, session: &mut dyn Predictor) -> Vec<Option<Errors>> {
    let run = &record.run;
    let (mut work, mut y) = (Workspace::new(), [0.0; STEPS * OUTPUTS]);
    let first = session.warm_up().max(FIRST + 1) - 1;
    session.reset();
    let mut windows = Vec::with_capacity(run.len());
    for k in 0..run.len() {
        session.observe(run.outputs.row(k));
        windows.push((k >= first && k + STEPS < run.len()).then(|| {
            session.rollout(run.inputs.rows(k, k + STEPS), &mut work, &mut y);
            let mut sums = [0.0; OUTPUTS];
            for (j, y) in y.chunks_exact(OUTPUTS).enumerate() {
                add(&mut sums, record.error(k + j + 1, y), STEPS);
            }
            sums
        }));
        session.advance(run.inputs.row(k));
    }
    windows
}

/// All blocks of a model over a record.
pub(super) fn blocks(record: &Record, session: &mut dyn Predictor) -> Vec<Block> {
    let c0 = Dynamics::new(&Craft::hydrofoil_low_speed());
    let windows = windows(record, session);
    let span = STEPS * WINDOWS;
    let mut blocks = Vec::new();
    for k in (FIRST..record.run.len().saturating_sub(span)).step_by(span) {
        let starts = || (0..WINDOWS).map(|m| k + STEPS * m);
        let Some(errors) = starts().map(|k| windows[k]).collect::<Option<Vec<Errors>>>() else { continue };
        let (mut model, mut low) = ([0.0; OUTPUTS], [0.0; OUTPUTS]);
        for (k, error) in starts().zip(errors) {
            add(&mut model, error, WINDOWS);
            add(&mut low, record.of_plant(&c0, record.truth(k), k), WINDOWS);
        }
        let speeds = || (k..=k + span).map(|k| record.truth(k)[0]);
        let mean_u = speeds().sum::<f64>() / (span + 1) as f64;
        blocks.push(Block { k, mean_u, max_u: speeds().fold(f64::MIN, f64::max), model, c0: low });
    }
    blocks
}

/// Mean error over 20 steps of the true plant from the measured velocities.
pub(super) fn noise_floor(record: &Record) -> Errors {
    let plant = Dynamics::new(&Craft::hydrofoil());
    let origins: Vec<usize> = (FIRST..record.run.len().saturating_sub(STEPS)).step_by(STRIDE).collect();
    let mut sums = [0.0; OUTPUTS];
    for &k in &origins {
        let measured = std::array::from_fn(|c| record.run.outputs.row(k)[c]);
        add(&mut sums, record.of_plant(&plant, measured, k), origins.len());
    }
    sums
}

/// Speed (upper panel) and errors on logarithmic axes.
pub(super) fn figure(blocks: &[Block], name: &str, stroke: Stroke, dt: f64) -> Figure {
    let time = |block: &Block| block.k as f64 * dt;
    let line = |value: &dyn Fn(&Block) -> f64, stroke: Stroke| {
        Mark::Line(Line::new(blocks.iter().map(|block| (time(block), value(block))).collect(), stroke))
    };
    let logarithm = |error: f64| error.max(LEAST).log10();
    let mut figure =
        Figure::new("Error(k) of the predictor and of C0 along a run in both modes", "time of k [s]")
            .key(Key::Line(stroke), name)
            .key(Key::Line(style::PERSISTENCE_LINE), "C0, the perfect model of low speed")
            .panel(
                Panel::new("u, mean over the 200 samples [m/s] (dotted: change of mode)")
                    .mark(Mark::Level { at: TRANSITION, stroke: style::VALIDATION_LINE })
                    .mark(line(&|block| block.mean_u, style::MEASURED_LINE)),
            );
    for (c, label) in
        ["Error(k) of u [m/s]", "Error(k) of v [m/s]", "Error(k) of r [rad/s]"].iter().enumerate()
    {
        figure = figure.panel(
            Panel::new(*label)
                .decades()
                .range(LEAST.log10(), 0.3)
                .mark(line(&|block| logarithm(block.c0[c]), style::PERSISTENCE_LINE))
                .mark(line(&|block| logarithm(block.model[c]), stroke)),
        );
    }
    figure
}
