//! Steering on board: from each sample to a command.

use hydroid_core::actuator::Limits;
use hydroid_core::control::{Liveness, Status};
use hydroid_core::memory::Memory;

use super::controller::{ClosedLoopController, ModelSession};
use super::error::ClosedLoopError;
use super::guidance::{Guidance, Guided, Measured};
use super::options::ControllerOptions;
use super::track::Track;
use crate::key::key;

/// What a command depends on: position, heading and the body velocities over ground.
pub const QUANTITIES: [&str; 5] = ["position", "heading", "u", "v", "r"];

/// A controller on its track. It keeps the pose: a missing position or heading is predicted from the velocities. While a
/// [quantity](QUANTITIES) is older than the limit, the commands have their neutral values, and the controller is blind.
pub struct Pilot {
    law: Box<dyn ClosedLoopController>,
    guidance: Guidance,
    adapts: bool,
    /// Places of `u`, `v` and `r` among the outputs of the model.
    motion: [usize; 3],
    tolerance: f64,
    dt_s: f64,
    limits: Vec<Limits>,
    rest: Vec<f64>,
    eta: [f64; 3],
    nu: [f64; 3],
    liveness: Liveness<5>,
    /// The command in force.
    command: Vec<f64>,
    /// Whether the end of the path has been reached.
    arrived: bool,
    /// Whether the vessel was within the tolerance at the last sample.
    on_track: bool,
    guided: Option<Guided>,
}

/// Default of the longest gap of a run with samples of `dt` seconds \[s\].
pub fn longest_gap(dt: f64) -> f64 {
    (10.0 * dt).max(1.0)
}

/// The way from the last sample to the present one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Elapsed {
    /// The first sample of a stream.
    Start,
    /// Steps of the model.
    Steps(usize),
    /// A gap \[s\] after which a new run begins.
    Gap(f64),
}

/// A sample with the state of the model.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// Pose `[x, y, psi]` in north, east \[m\] and clockwise from north \[rad\]; NaN is missing.
    pub pose: [f64; 3],
    /// Measured outputs of the model; NaN is missing.
    pub outputs: &'a [f64],
    /// Estimate of the outputs.
    pub estimate: &'a [f64],
    /// Session of the model after this measurement.
    pub session: ModelSession<'a>,
}

impl Pilot {
    /// A controller at the start of a track. Its model is that of the stream; `weights` is the number of weights of an
    /// adapter that learns.
    ///
    /// # Errors
    /// If the options do not fit the model.
    pub fn new(
        options: &ControllerOptions,
        track: Track,
        seed: u64,
        weights: Option<usize>,
    ) -> Result<Self, ClosedLoopError> {
        let law = options.law(seed, weights)?;
        let guidance = Guidance::new(track, law.as_ref(), options.dt_s);
        let measured = &options.instruments.measured;
        let place = |name: &str| measured.iter().position(|channel| channel.name == name);
        let [Some(u), Some(v), Some(r)] = ["u", "v", "r"].map(place) else {
            let outputs = key("outputs").is("u,v,r");
            let why = format!("control needs the outputs u, v and r; identify with {outputs}");
            return Err(ClosedLoopError::Channels(why));
        };
        let rest: Vec<f64> = options.limits.iter().map(|limits| limits.rest).collect();
        Ok(Self {
            law,
            guidance,
            adapts: weights.is_some(),
            motion: [u, v, r],
            tolerance: options.tolerance,
            dt_s: options.dt_s,
            command: rest.clone(),
            limits: options.limits.clone(),
            rest,
            eta: [f64::NAN; 3],
            nu: [0.0; 3],
            liveness: Liveness::new(options.max_age_s),
            arrived: false,
            on_track: false,
            guided: None,
        })
    }

    /// Whether the weights of the model change.
    pub fn adapts(&self) -> bool {
        self.adapts
    }

    /// Limits of the actuators.
    pub fn limits(&self) -> &[Limits] {
        &self.limits
    }

    /// The command in force.
    pub fn command(&self) -> &[f64] {
        &self.command
    }

    /// Reference, errors and status of the last sample; `None` before the first one and at rest.
    pub fn guided(&self) -> Option<&Guided> {
        self.guided.as_ref()
    }

    /// The pose, measured or predicted; NaN is unknown.
    pub fn eta(&self) -> [f64; 3] {
        self.eta
    }

    /// Places of `u`, `v` and `r` among the outputs of the model.
    pub fn motion(&self) -> [usize; 3] {
        self.motion
    }

    /// Age of each of the [`QUANTITIES`] \[s\], and their limit.
    pub const fn liveness(&self) -> &Liveness<5> {
        &self.liveness
    }

    /// The quantities that are older than the limit, with their ages \[s\].
    pub fn lost(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let ages = QUANTITIES.into_iter().zip(self.liveness.ages_s());
        ages.filter(|(_, age)| self.liveness.is_beyond(*age))
    }

    /// Time passes \[s\] without a sample; infinite if it is not known how much. The commands come to rest if it is too long.
    pub fn pass(&mut self, seconds: f64) {
        self.liveness.pass(seconds);
        if !self.liveness.is_alive() {
            self.rest();
        }
    }

    /// Status of the command.
    pub fn status(&self) -> &'static str {
        if self.arrived {
            "arrived"
        } else {
            self.guided.map_or(Status::Blind, |guided| guided.status).name()
        }
    }

    /// The planned command of a later sample; the command in force without a plan.
    pub fn planned(&self, later: usize) -> &[f64] {
        if self.arrived { &self.rest } else { self.law.planned(later).unwrap_or(&self.command) }
    }

    /// Computes the command of a sample.
    pub fn steer(&mut self, elapsed: Elapsed, seen: &Seen<'_>) {
        let elapsed_s = match elapsed {
            Elapsed::Start => f64::INFINITY,
            Elapsed::Steps(steps) => steps as f64 * self.dt_s,
            Elapsed::Gap(gap_s) => gap_s,
        };
        let [x, y, psi] = seen.pose.map(f64::is_finite);
        let [u, v, r] = self.motion.map(|place| !seen.outputs[place].is_nan());
        self.liveness.take(elapsed_s, [x && y, psi, u, v, r]);
        self.locate(elapsed_s, seen);
        for (nu, place) in self.nu.iter_mut().zip(self.motion) {
            let measured = seen.outputs[place];
            *nu = if measured.is_nan() { seen.estimate[place] } else { measured };
        }
        match elapsed {
            Elapsed::Gap(gap_s) => {
                self.law.reset();
                self.guidance.resume(gap_s, [self.eta[0], self.eta[1]]);
            }
            // The reference waits for a vessel that is lost or not seen.
            Elapsed::Steps(steps) if self.on_track => {
                (0..steps).for_each(|_| self.guidance.advance());
            }
            Elapsed::Start | Elapsed::Steps(_) => {}
        }
        if !self.liveness.is_alive() {
            self.rest();
            return;
        }
        let outputs: Vec<f64> = seen
            .outputs
            .iter()
            .zip(seen.estimate)
            .map(|(y, estimate)| if y.is_nan() { *estimate } else { *y })
            .collect();
        let measured =
            Measured { eta: self.eta, nu: self.nu, outputs: &outputs, session: Some(seen.session) };
        let guided = self.guidance.command(self.law.as_mut(), &measured, &mut self.command);
        self.on_track = guided.distance <= self.tolerance;
        self.guided = Some(guided);
        self.arrived |= self.guidance.is_done();
        let finite = self.command.iter().all(|c| c.is_finite());
        if !finite {
            self.law.reset();
        }
        if self.arrived || !finite {
            self.command.copy_from_slice(&self.rest);
        }
    }

    /// Brings the commands to their neutral values, from which the law continues.
    fn rest(&mut self) {
        self.command.copy_from_slice(&self.rest);
        self.law.reset();
        (self.guided, self.on_track) = (None, false);
    }

    /// Takes the measured pose, or predicts missing parts with the last velocities.
    fn locate(&mut self, elapsed_s: f64, seen: &Seen<'_>) {
        let [x, y, psi] = self.eta;
        let [u, v, r] = self.nu;
        let turned = r * elapsed_s;
        let (sin, cos) = (psi + 0.5 * turned).sin_cos();
        let predicted =
            [x + elapsed_s * (u * cos - v * sin), y + elapsed_s * (u * sin + v * cos), psi + turned];
        for (part, range) in [0..2, 2..3].into_iter().enumerate() {
            if seen.pose[range.clone()].iter().all(|x| x.is_finite()) {
                self.eta[range.clone()].copy_from_slice(&seen.pose[range]);
            } else {
                let is_lost = self.liveness.is_beyond(self.liveness.ages_s()[part]);
                for i in range {
                    self.eta[i] = if is_lost { f64::NAN } else { predicted[i] };
                }
            }
        }
    }

    /// Visits all numbers from which the pilot continues.
    pub fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.law.visit_state(memory);
        self.guidance.visit_state(memory);
        memory.numbers(&mut self.eta);
        memory.numbers(&mut self.nu);
        self.liveness.visit_state(memory);
        memory.numbers(&mut self.command);
        for flag in [&mut self.arrived, &mut self.on_track] {
            memory.flag(flag);
        }
    }
}
