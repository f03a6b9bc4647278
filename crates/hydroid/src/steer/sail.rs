//! The loop: measure, command, move.

use std::time::Instant;

use hydroid_core::control::{Limits, Status};
use hydroid_core::guidance::Reference;
use hydroid_core::vessel::{Command, State, VesselParams};
use rand_distr::{Distribution as _, StandardNormal};

use super::course::Course;
use super::error::{SteerError, at_least, positive};
use super::guide::Guide;
use super::helm::{Helm, Sight};
use super::moving::Moving;
use super::random::{Purpose, stream};
use super::sea::Conditions;
use crate::progress::Progress;

/// A vessel, a course, and how the vessel is put on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The true vessel.
    pub vessel: VesselParams,
    /// Where it is sent.
    pub course: Course,
    /// Limits of the commands, which the controller keeps and the loop counts.
    pub limits: [Limits; 2],
    /// Sample time \[s\].
    pub dt_s: f64,
    /// How long \[s\]; one that follows a path with an end stops there before.
    pub duration_s: f64,
    /// Where the point that is to be on the path is at the start, ahead along the path and to starboard \[m\].
    pub start: [f64; 2],
    /// Farther than this from the reference it is lost \[m\].
    pub tolerance: f64,
}

impl Scene {
    /// Samples of 0.1 s; two minutes, or half as long again as an open course takes, so that a vessel that follows it and is slow
    /// arrives; it begins on the path. Lost is farther than 2 m.
    pub fn new(vessel: VesselParams, course: Course) -> Self {
        let limits = hydroid_core::control::AffinePlant::limits(&vessel);
        let duration_s = course.duration_s().map_or(120.0, |duration| 1.5 * duration);
        Self { vessel, course, limits, dt_s: 0.1, duration_s, start: [0.0; 2], tolerance: 2.0 }
    }

    /// From when on errors count where nothing is said \[s\]: 40 s on a circle, else 10 s; a third of the voyage at the most,
    /// and half of what the course takes, after which a voyage may end.
    pub fn usual_from_s(&self) -> f64 {
        let usual = if self.course.path.is_closed() { 40.0_f64 } else { 10.0 };
        let course = self.course.duration_s().map_or(f64::INFINITY, |duration| 0.5 * duration);
        usual.min(self.duration_s / 3.0).min(course)
    }

    /// Whether a voyage has samples that count, if errors count from then on.
    ///
    /// # Errors
    /// If it is over before.
    pub fn check_from(&self, from_s: f64) -> Result<(), SteerError> {
        at_least("the time from which errors count", from_s, 0.0)?;
        if from_s < self.duration_s {
            return Ok(());
        }
        Err(SteerError::From { from_s, duration_s: self.duration_s })
    }
}

/// A sample of a voyage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Time \[s\].
    pub t: f64,
    /// The truth, with velocities over ground.
    pub state: State,
    /// `[u, v, r, P_f]` as measured, over ground.
    pub measured: [f64; 4],
    /// Where to be.
    pub reference: Reference,
    /// How far the point that is to be on the path is from its reference \[m\].
    pub distance: f64,
    /// How far it is to starboard of the path \[m\].
    pub cross_track: f64,
    /// Its speed over ground less the one asked for \[m/s\].
    pub speed_error: f64,
    /// The command, held until the next sample.
    pub command: [f64; 2],
    /// What the helm said of it.
    pub status: Status,
    /// Time that the helm took \[us\].
    pub time_us: f64,
}

/// What became of it, sample by sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Voyage {
    /// All samples.
    pub moments: Vec<Moment>,
    /// Sample time \[s\].
    pub dt_s: f64,
    /// Limits of the commands.
    pub limits: [Limits; 2],
    /// Farther than this is lost \[m\].
    pub tolerance: f64,
    /// Whether the end of the path was reached; none for a path without one.
    pub arrived: Option<bool>,
    /// Whether the true state stopped being a number.
    pub diverged: bool,
}

/// Samples between two calls of the progress callback.
const PROGRESS_EVERY: usize = 16;

/// More samples than a voyage can have: a slip in a unit.
const MOST_SAMPLES: f64 = 1e7;

/// Takes a helm along a course. The vessel begins under way, at the speed asked for (through the water), heading along the path.
///
/// # Errors
/// If conditions, times or vessel are not possible, or `progress` breaks off.
pub fn sail(
    scene: &Scene,
    conditions: &Conditions,
    helm: &mut dyn Helm,
    progress: Progress<'_>,
) -> Result<Voyage, SteerError> {
    conditions.check()?;
    positive("the duration", scene.duration_s)?;
    positive("the sample time", scene.dt_s)?;
    positive("the tolerance", scene.tolerance)?;
    for offset in scene.start {
        at_least("the offset of the start", offset.abs(), 0.0)?;
    }
    let dt = scene.dt_s;
    let samples = (scene.duration_s / dt).round();
    if !(1.0..=MOST_SAMPLES).contains(&samples) {
        let needed = "between one and ten million samples are needed";
        return Err(SteerError::Option { what: "the duration", value: scene.duration_s, needed });
    }
    // Bounded by the check.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let samples = samples as usize;
    let idle = scene.limits.map(|limits| 0.0_f64.clamp(limits.low, limits.high));
    let mut vessel = Moving::new(&scene.vessel, conditions, dt, Command { pp: idle[0], rd: idle[1] })?;
    let lead = helm.lead();
    vessel.place(start(scene, &vessel, lead));
    helm.reset();
    let mut guide = Guide::new(&scene.course, helm.timing());
    let (first, _) = guide.see([f64::NAN; 2]);
    let mut ahead = vec![first; helm.horizon()];
    let mut random = stream(conditions.seed, Purpose::Noise);
    let sigma = scene.vessel.noise;
    let sigma = [sigma.u, sigma.v, sigma.r, sigma.p_f];
    let mut voyage = Voyage {
        moments: Vec::with_capacity(samples.min(100_000)),
        dt_s: dt,
        limits: scene.limits,
        tolerance: scene.tolerance,
        arrived: scene.course.duration_s().map(|_| false),
        diverged: false,
    };
    for k in 0..samples {
        if k % PROGRESS_EVERY == 0 && progress(k as f64 / samples as f64).is_break() {
            return Err(SteerError::Cancelled);
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
        let (reference, cross_track) = guide.see(point);
        guide.ahead(dt, &mut ahead);
        let [u, v, r, force] = measured;
        let force = if scene.vessel.propeller.force_measured { force } else { f64::NAN };
        let sight = Sight {
            eta: [state.x, state.y, state.psi],
            nu: [u, v, r],
            force,
            reference: &reference,
            ahead: &ahead,
        };
        let mut command = [f64::NAN; 2];
        let begun = Instant::now();
        let status = helm.command(&sight, &mut command);
        let time_us = 1e6 * begun.elapsed().as_secs_f64();
        voyage.moments.push(Moment {
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
        guide.advance(dt);
        if !vessel.over_ground().is_finite() {
            voyage.diverged = true;
            break;
        }
        if guide.is_done() {
            voyage.arrived = Some(true);
            break;
        }
    }
    if progress(1.0).is_break() {
        return Err(SteerError::Cancelled);
    }
    Ok(voyage)
}

/// Under way at the start of the course, the point ahead where the scene has it.
fn start(scene: &Scene, vessel: &Moving, lead: f64) -> State {
    let Course { path, profile } = &scene.course;
    let (pose, (speed, _)) = (path.at(0.0), profile.at(0.0));
    let (sin, cos) = pose.course.sin_cos();
    let [along, aside] = [scene.start[0] - lead, scene.start[1]];
    State {
        x: pose.position[0] + along * cos - aside * sin,
        y: pose.position[1] + along * sin + aside * cos,
        psi: pose.course,
        u: speed,
        p_f: vessel.plant().holding_force(speed),
        ..State::REST
    }
}

/// Time of a sample; where a second is a whole number of samples, the number nearest to the decimal fraction.
fn time(k: usize, dt_s: f64) -> f64 {
    let rate = 1.0 / dt_s;
    if (rate - rate.round()).abs() < 1e-9 * rate { k as f64 / rate.round() } else { k as f64 * dt_s }
}
