//! Steering on board: from each sample to a command.

use hydroid_core::actuator::Limits;
use hydroid_core::control::Status;
use hydroid_core::memory::Memory;

use super::controller::{ClosedLoopController, ModelSession};
use super::error::ClosedLoopError;
use super::guidance::{Guidance, Guided, Measured};
use super::options::ControllerOptions;
use super::track::Track;
use crate::key::key;

/// A controller on its track. It keeps the pose: a missing position or heading is predicted from the velocities for the
/// longest gap of the stream; without it the controller is blind.
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
    /// Times since the last measured position and heading \[s\].
    unmeasured_s: [f64; 2],
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
    /// Longest gap \[s\].
    pub max_gap_s: f64,
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
            unmeasured_s: [f64::INFINITY; 2],
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

    /// Brings the command to rest until the next sample.
    pub fn rest(&mut self) {
        self.command.copy_from_slice(&self.rest);
        self.guided = None;
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
            let unmeasured_s = &mut self.unmeasured_s[part];
            if seen.pose[range.clone()].iter().all(|x| x.is_finite()) {
                *unmeasured_s = 0.0;
                self.eta[range.clone()].copy_from_slice(&seen.pose[range]);
            } else {
                *unmeasured_s += elapsed_s;
                let known = *unmeasured_s <= seen.max_gap_s;
                for i in range {
                    self.eta[i] = if known { predicted[i] } else { f64::NAN };
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
        memory.numbers(&mut self.unmeasured_s);
        memory.numbers(&mut self.command);
        for flag in [&mut self.arrived, &mut self.on_track] {
            memory.flag(flag);
        }
    }
}
