//! Simulation of the closed loop: measure, compute the command, advance the plant.

use std::time::Instant;

use hydroid_core::actuator::Limits;
use hydroid_core::control::Status;
use hydroid_core::guidance::Reference;
use hydroid_core::vessel::{Command, State, VesselParams};
use rand_distr::{Distribution as _, StandardNormal};

use super::controller::{ClosedLoopController, Observation};
use super::disturbance::Conditions;
use super::error::{ClosedLoopError, at_least, positive};
use super::plant::PerturbedPlant;
use super::random::{Purpose, stream};
use super::reference::ReferenceGenerator;
use super::track::Track;
use crate::progress::Progress;

/// Plant, reference track, and initial state of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// The true vessel.
    pub vessel: VesselParams,
    /// Reference track.
    pub track: Track,
    /// Command limits. The controller must keep them; the metrics count violations.
    pub limits: [Limits; 2],
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
    pub fn new(vessel: VesselParams, track: Track) -> Self {
        let limits = hydroid_core::control::AffinePlant::limits(&vessel);
        let duration_s = track.duration_s().map_or(120.0, |duration| 1.5 * duration);
        Self { vessel, track, limits, dt_s: 0.1, duration_s, start: [0.0; 2], tolerance: 2.0 }
    }

    /// Default start of the evaluation \[s\]: 40 s on a closed path, else 10 s; at most a third of the run and half of
    /// the track.
    pub fn default_from_s(&self) -> f64 {
        let usual = if self.track.path.is_closed() { 40.0_f64 } else { 10.0 };
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
    /// True state, with velocities over ground.
    pub state: State,
    /// Measured `[u, v, r, P_f]`, velocities over ground.
    pub measured: [f64; 4],
    /// Reference of this sample.
    pub reference: Reference,
    /// Distance of the controlled point from its reference \[m\].
    pub distance: f64,
    /// Cross-track error of the controlled point \[m\], positive to starboard of the path.
    pub cross_track: f64,
    /// Speed over ground of the controlled point minus the reference speed \[m/s\].
    pub speed_error: f64,
    /// Command `[propeller, rudder]`, held until the next sample.
    pub command: [f64; 2],
    /// Status of the controller.
    pub status: Status,
    /// Computing time of the controller \[us\].
    pub time_us: f64,
}

/// A simulated run.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// All samples.
    pub samples: Vec<Sample>,
    /// Sample time \[s\].
    pub dt_s: f64,
    /// Command limits.
    pub limits: [Limits; 2],
    /// Distance from the reference beyond which the vessel is lost \[m\].
    pub tolerance: f64,
    /// Whether the end of the path was reached; `None` for a closed path.
    pub arrived: Option<bool>,
    /// Whether the true state became non-finite.
    pub diverged: bool,
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
    let idle = scenario.limits.map(|limits| 0.0_f64.clamp(limits.low, limits.high));
    let mut vessel =
        PerturbedPlant::new(&scenario.vessel, conditions, dt, Command { pp: idle[0], rd: idle[1] })?;
    let lead = controller.lead();
    vessel.place(start(scenario, &vessel, lead));
    controller.reset();
    let mut generator = ReferenceGenerator::new(&scenario.track, controller.timing());
    let (first, _) = generator.update([f64::NAN; 2]);
    let mut preview = vec![first; controller.horizon()];
    let mut random = stream(conditions.seed, Purpose::Noise);
    let sigma = scenario.vessel.noise;
    let sigma = [sigma.u, sigma.v, sigma.r, sigma.p_f];
    let mut run = Run {
        samples: Vec::with_capacity(samples.min(100_000)),
        dt_s: dt,
        limits: scenario.limits,
        tolerance: scenario.tolerance,
        arrived: scenario.track.duration_s().map(|_| false),
        diverged: false,
    };
    for k in 0..samples {
        if k % PROGRESS_EVERY == 0 && progress(k as f64 / samples as f64).is_break() {
            return Err(ClosedLoopError::Cancelled);
        }
        let state = vessel.over_ground();
        let measured = {
            let truth = [state.u, state.v, state.r, state.p_f];
            let mut noisy = |i: usize| {
                let white: f64 = StandardNormal.sample(&mut random);
                truth[i] + conditions.noise * sigma[i] * white
            };
            [noisy(0), noisy(1), noisy(2), noisy(3)]
        };
        let (sin, cos) = state.psi.sin_cos();
        let point = [state.x + lead * cos, state.y + lead * sin];
        let (reference, cross_track) = generator.update(point);
        generator.preview(dt, &mut preview);
        let [u, v, r, force] = measured;
        let force = if scenario.vessel.propeller.force_measured { force } else { f64::NAN };
        let observation = Observation {
            eta: [state.x, state.y, state.psi],
            nu: [u, v, r],
            force,
            reference: &reference,
            preview: &preview,
        };
        let mut command = [f64::NAN; 2];
        let begun = Instant::now();
        let status = controller.command(&observation, &mut command);
        let time_us = 1e6 * begun.elapsed().as_secs_f64();
        run.samples.push(Sample {
            t: time(k, dt),
            state,
            measured,
            reference,
            distance: (point[0] - reference.position[0]).hypot(point[1] - reference.position[1]),
            cross_track,
            speed_error: state.u.hypot(state.v + lead * state.r) - reference.speed,
            command,
            status,
            time_us,
        });
        vessel.advance(Command { pp: command[0], rd: command[1] });
        generator.advance(dt);
        if !vessel.over_ground().is_finite() {
            run.diverged = true;
            break;
        }
        if generator.is_done() {
            run.arrived = Some(true);
            break;
        }
    }
    if progress(1.0).is_break() {
        return Err(ClosedLoopError::Cancelled);
    }
    Ok(run)
}

/// Initial state, with the controlled point at the offset `scenario.start`.
fn start(scenario: &Scenario, vessel: &PerturbedPlant, lead: f64) -> State {
    let Track { path, profile } = &scenario.track;
    let (pose, (speed, _)) = (path.at(0.0), profile.at(0.0));
    let (sin, cos) = pose.course.sin_cos();
    let [along, aside] = [scenario.start[0] - lead, scenario.start[1]];
    State {
        x: pose.position[0] + along * cos - aside * sin,
        y: pose.position[1] + along * sin + aside * cos,
        psi: pose.course,
        u: speed,
        p_f: vessel.plant().holding_force(speed),
        ..State::REST
    }
}

/// Time of sample `k` \[s\], rounded to the nearest decimal fraction if the sample rate is a whole number.
fn time(k: usize, dt_s: f64) -> f64 {
    let rate = 1.0 / dt_s;
    if (rate - rate.round()).abs() < 1e-9 * rate { k as f64 / rate.round() } else { k as f64 * dt_s }
}
