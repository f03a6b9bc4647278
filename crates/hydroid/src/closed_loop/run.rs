//! Simulation of the closed loop: measure, compute the command, advance the plant.

use hydroid_core::actuator::Limits;
use hydroid_core::control::Status;
use hydroid_core::guidance::Reference;
use rand_distr::{Distribution as _, StandardNormal};
use web_time::Instant;

use super::controller::ClosedLoopController;
use super::disturbance::Conditions;
use super::error::{ClosedLoopError, at_least, positive};
use super::guidance::{Guidance, Guided, Measured};
use super::plant::{PlantInMotion, TruePlant};
use super::random::{Purpose, stream};
use super::track::Track;
use crate::log::{Channel, Table, Trajectory};
use crate::progress::Progress;

/// Plant, reference track, and initial state of a run.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// The true vessel.
    pub plant: TruePlant,
    /// Reference track.
    pub track: Track,
    /// Command limits. The controller must keep them; the metrics count violations.
    pub limits: Vec<Limits>,
    /// Sample time \[s\].
    pub dt_s: f64,
    /// Duration \[s\]. A run on an open path stops earlier at its end.
    pub duration_s: f64,
    /// Initial offset of the controlled point: along the path and to starboard \[m\].
    pub start: [f64; 2],
    /// Distance from the reference beyond which the vessel is lost \[m\].
    pub tolerance: f64,
}

impl Scenario {
    /// Start on the path, sample time 0.1 s, tolerance 2 m, duration 120 s (closed path) or 1.5 times the track's.
    pub fn new(plant: impl Into<TruePlant>, track: Track) -> Self {
        let plant = plant.into();
        let limits = plant.limits();
        let duration_s = track.duration_s().map_or(120.0, |duration| 1.5 * duration);
        Self { plant, track, limits, dt_s: 0.1, duration_s, start: [0.0; 2], tolerance: 2.0 }
    }

    /// Default start of the evaluation \[s\]: 40 s on a closed path, else 10 s, or the time of 15 or 4 tolerances at the
    /// cruising speed if that is longer; at most a third of the run and half of the track.
    pub fn default_from_s(&self) -> f64 {
        let tolerance_s = self.tolerance / self.track.cruise;
        let (least, tolerances) = if self.track.path.is_closed() { (40.0_f64, 15.0) } else { (10.0, 4.0) };
        let usual = least.max(tolerances * tolerance_s);
        let track = self.track.duration_s().map_or(f64::INFINITY, |duration| 0.5 * duration);
        usual.min(self.duration_s / 3.0).min(track)
    }

    /// Checks that the run has samples after the start of the evaluation.
    ///
    /// # Errors
    /// If the run ends before `from_s`.
    pub fn check_from(&self, from_s: f64) -> Result<(), ClosedLoopError> {
        at_least("the time from which errors count", from_s, 0.0)?;
        if from_s < self.duration_s {
            return Ok(());
        }
        Err(ClosedLoopError::EvaluationStart { from_s, duration_s: self.duration_s })
    }
}

/// One sample of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time \[s\].
    pub t: f64,
    /// True pose `[x, y, psi]`.
    pub eta: [f64; 3],
    /// True velocities `[u, v, r]` over ground.
    pub nu: [f64; 3],
    /// Reference of this sample.
    pub reference: Reference,
    /// Distance of the controlled point from its reference \[m\].
    pub distance: f64,
    /// Cross-track error of the controlled point \[m\], positive to starboard of the path.
    pub cross_track: f64,
    /// Speed over ground of the controlled point minus the reference speed \[m/s\].
    pub speed_error: f64,
    /// Status of the controller.
    pub status: Status,
    /// Computing time of reference and controller \[us\].
    pub time_us: f64,
}

/// A simulated run.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// All samples.
    pub samples: Vec<Sample>,
    /// Names and units of the commands.
    pub inputs: Vec<Channel>,
    /// Names and units of the outputs; those that are not measured are the last ones.
    pub outputs: Vec<Channel>,
    /// Number of measured outputs.
    pub measured_outputs: usize,
    /// Commands, row by row; each is held until the next sample.
    pub commands: Vec<f64>,
    /// Outputs with measurement noise, row by row, with velocities over ground.
    pub measured: Vec<f64>,
    /// Outputs without noise, row by row, with velocities over ground.
    pub truth: Vec<f64>,
    /// Sample time \[s\].
    pub dt_s: f64,
    /// Command limits.
    pub limits: Vec<Limits>,
    /// Distance from the reference beyond which the vessel is lost \[m\].
    pub tolerance: f64,
    /// Whether the end of the path was reached; `None` for a closed path.
    pub arrived: Option<bool>,
    /// Whether the true state became non-finite.
    pub diverged: bool,
}

impl Run {
    /// Commands of a sample.
    ///
    /// # Panics
    /// If there is no such sample.
    pub fn command(&self, sample: usize) -> &[f64] {
        &self.commands[sample * self.inputs.len()..][..self.inputs.len()]
    }

    /// Measured outputs of a sample.
    ///
    /// # Panics
    /// If there is no such sample.
    pub fn measured(&self, sample: usize) -> &[f64] {
        &self.measured[sample * self.outputs.len()..][..self.measured_outputs]
    }

    /// Outputs of a sample without noise.
    ///
    /// # Panics
    /// If there is no such sample.
    pub fn truth(&self, sample: usize) -> &[f64] {
        &self.truth[sample * self.outputs.len()..][..self.outputs.len()]
    }

    /// The run as a log with the measured outputs.
    pub fn trajectory(&self) -> Trajectory {
        let n = self.measured_outputs;
        let rows =
            |all: &[f64]| all.chunks_exact(self.outputs.len()).flat_map(|row| row[..n].to_vec()).collect();
        let outputs = &self.outputs[..n];
        Trajectory {
            name: String::from("closed loop"),
            t0: 0.0,
            dt: self.dt_s,
            outputs: Table::new(outputs.to_vec(), rows(&self.measured)),
            inputs: Table::new(self.inputs.clone(), self.commands.clone()),
            truth: Some(Table::new(outputs.to_vec(), rows(&self.truth))),
            heading: Some(self.samples.iter().map(|sample| sample.eta[2]).collect()),
            position: Some(self.samples.iter().map(|sample| [sample.eta[0], sample.eta[1]]).collect()),
        }
    }
}

const PROGRESS_EVERY: usize = 16;

const MAX_SAMPLES: f64 = 1e7;

/// Simulates a scenario. At the start the vessel heads along the path at the reference speed through the water.
///
/// # Errors
/// If conditions, times or vessel are invalid, or `progress` cancels.
pub fn run(
    scenario: &Scenario,
    conditions: &Conditions,
    controller: &mut dyn ClosedLoopController,
    progress: Progress<'_>,
) -> Result<Run, ClosedLoopError> {
    conditions.check()?;
    positive("the duration", scenario.duration_s)?;
    positive("the sample time", scenario.dt_s)?;
    positive("the tolerance", scenario.tolerance)?;
    for offset in scenario.start {
        at_least("the offset of the start", offset.abs(), 0.0)?;
    }
    let dt = scenario.dt_s;
    let samples = (scenario.duration_s / dt).round();
    if !(1.0..=MAX_SAMPLES).contains(&samples) {
        let needed = "between one and ten million samples are needed";
        return Err(ClosedLoopError::Option { what: "the duration", value: scenario.duration_s, needed });
    }
    // Bounded by the check.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let samples = samples as usize;
    let plant = &scenario.plant;
    let idle: Vec<f64> = scenario.limits.iter().map(|limits| limits.rest).collect();
    let mut vessel = PlantInMotion::new(plant, conditions, dt, &idle)?;
    let lead = controller.lead();
    place(scenario, &mut vessel, lead);
    controller.reset();
    let mut guidance = Guidance::new(scenario.track.clone(), controller, dt);
    let mut random = stream(conditions.seed, Purpose::Noise);
    let sigma = plant.noise();
    let capacity = samples.min(100_000);
    let mut run = Run {
        samples: Vec::with_capacity(capacity),
        inputs: plant.commands(),
        outputs: plant.outputs(),
        measured_outputs: plant.measured().len(),
        commands: Vec::with_capacity(capacity * idle.len()),
        measured: Vec::with_capacity(capacity * sigma.len()),
        truth: Vec::with_capacity(capacity * sigma.len()),
        dt_s: dt,
        limits: scenario.limits.clone(),
        tolerance: scenario.tolerance,
        arrived: scenario.track.duration_s().map(|_| false),
        diverged: false,
    };
    let motion = ["u", "v", "r"].map(|name| run.outputs.iter().position(|channel| channel.name == name));
    let (mut truth, mut measured) = (vec![0.0; sigma.len()], vec![0.0; sigma.len()]);
    let mut command = idle.clone();
    for k in 0..samples {
        if k % PROGRESS_EVERY == 0 && progress(k as f64 / samples as f64).is_break() {
            return Err(ClosedLoopError::Cancelled);
        }
        let (eta, nu) = (vessel.eta(), vessel.nu());
        vessel.write_outputs(&mut truth);
        for ((measured, truth), sigma) in measured.iter_mut().zip(&truth).zip(&sigma) {
            let white: f64 = StandardNormal.sample(&mut random);
            *measured = truth + conditions.noise * sigma * white;
        }
        let measurement = Measured {
            eta,
            nu: motion.map(|place| place.map_or(0.0, |place| measured[place])),
            outputs: &measured[..run.measured_outputs],
            session: None,
        };
        command.fill(f64::NAN);
        let begun = Instant::now();
        let guided = guidance.command(controller, &measurement, &mut command);
        let time_us = 1e6 * begun.elapsed().as_secs_f64();
        let Guided { reference, distance, cross_track, status, .. } = guided;
        run.samples.push(Sample {
            t: time(k, dt),
            eta,
            nu,
            reference,
            distance,
            cross_track,
            speed_error: nu[0].hypot(nu[1] + lead * nu[2]) - reference.speed,
            status,
            time_us,
        });
        run.commands.extend_from_slice(&command);
        run.measured.extend_from_slice(&measured);
        run.truth.extend_from_slice(&truth);
        vessel.advance(&command);
        guidance.advance();
        if !vessel.eta().iter().chain(&vessel.nu()).all(|x| x.is_finite()) {
            run.diverged = true;
            break;
        }
        if guidance.is_done() {
            run.arrived = Some(true);
            break;
        }
    }
    if progress(1.0).is_break() {
        return Err(ClosedLoopError::Cancelled);
    }
    Ok(run)
}

/// Places the vessel with the controlled point at the offset `scenario.start`, on the course of the path.
fn place(scenario: &Scenario, vessel: &mut PlantInMotion, lead: f64) {
    let (pose, speed) = (scenario.track.path.at(0.0), scenario.track.start_speed());
    let (sin, cos) = pose.course.sin_cos();
    let [along, aside] = [scenario.start[0] - lead, scenario.start[1]];
    let [x, y] = pose.position;
    vessel.place([x + along * cos - aside * sin, y + along * sin + aside * cos, pose.course], speed);
}

/// Time of sample `k` \[s\], rounded to the nearest decimal fraction if the sample rate is a whole number.
fn time(k: usize, dt_s: f64) -> f64 {
    let rate = 1.0 / dt_s;
    if (rate - rate.round()).abs() < 1e-9 * rate { k as f64 / rate.round() } else { k as f64 * dt_s }
}
