//! Steering on board: from each sample to a command.

use std::f64::consts::TAU;

use hydroid_core::actuator::Limits;
use hydroid_core::control::{
    DeadReckoning, Liveness, Mode, Place, Status, Stop, Supervisor, SupervisorLimits,
};
use hydroid_core::memory::Memory;

use super::controller::{ClosedLoopController, ModelSession};
use super::error::ClosedLoopError;
use super::guidance::{Guidance, Guided, Measured};
use super::options::ControllerOptions;
use super::repeats::Repeats;
use super::track::Track;
use crate::key::key;

/// What a command depends on: position, heading and the body velocities over ground.
pub const QUANTITIES: [&str; 5] = ["position", "heading", "u", "v", "r"];

/// A controller on its way to a task and along it, under a [`Supervisor`]. It keeps the pose: a missing position or heading is
/// predicted from the velocities; one that [contradicts](DeadReckoning) them counts as missing. While a [quantity](QUANTITIES) is
/// older than the limit, the commands have their neutral values, and the controller is blind.
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
    repeats: Repeats,
    /// Time for which commands other than the neutral ones have been in force \[s\].
    pushing_s: f64,
    /// Time without a change of a position that is stuck \[s\]; 0 otherwise.
    stuck_s: f64,
    /// Longest time for which a sensor may be wrong, or the reference stand still \[s\].
    stall_s: f64,
    /// `None` for an estimated pose.
    reckoning: Option<DeadReckoning>,
    /// Time constant of the filter of a measured pose \[s\].
    smoothing_s: f64,
    /// What the measured velocities leave out, as a current or the bias of a gyro: north, east \[m/s\] and yaw \[rad/s\].
    drift: [f64; 3],
    supervisor: Supervisor,
    /// Radius of the turns on the way to the task \[m\].
    turning_radius: f64,
    /// Distance from a station at which the vessel set out for it \[m\].
    set_out: f64,
    /// The command in force.
    command: Vec<f64>,
    /// Time since the last sample in which the commands have moved already \[s\].
    moved_s: f64,
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
        // What the task asks for, the vessel can sail.
        let sharpest = track.path.pieces().iter().map(|piece| piece.curvature.abs()).fold(0.0, f64::max);
        let turning_radius = options.turning_radius.min(1.0 / sharpest);
        let limits = SupervisorLimits::new(options.max_age_s, options.tolerance, track.cruise);
        let track_speed = track.cruise;
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
            moved_s: 0.0,
            limits: options.limits.clone(),
            rest,
            eta: [f64::NAN; 3],
            nu: [0.0; 3],
            liveness: Liveness::new(options.max_age_s),
            repeats: Repeats::default(),
            pushing_s: 0.0,
            stuck_s: 0.0,
            stall_s: limits.stall_s,
            reckoning: Some(DeadReckoning::new(track_speed, limits.stall_s)),
            smoothing_s: options.tolerance / track_speed,
            drift: [0.0; 3],
            supervisor: Supervisor::new(limits),
            turning_radius,
            set_out: 0.0,
            guided: None,
        })
    }

    /// The pilot for poses that are not measured but estimated: whether sensors contradict each other is for the estimate to say.
    #[must_use]
    pub fn of_estimates(self) -> Self {
        Self { reckoning: None, smoothing_s: 0.0, ..self }
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

    /// Distances of the measured position \[m\] and heading \[rad\] from those to which the velocities have led, where they
    /// [contradict](DeadReckoning) each other and do not count as measured; 0 otherwise.
    pub fn contradicted(&self) -> [f64; 2] {
        self.reckoning.as_ref().map_or([0.0; 2], DeadReckoning::off)
    }

    /// Time passes \[s\] without a sample; infinite if it is not known how much. The commands come to rest if it is too long.
    pub fn pass(&mut self, seconds: f64) {
        self.liveness.pass(seconds);
        if !self.liveness.is_alive() {
            self.rest(seconds);
            self.moved_s += if seconds.is_finite() { seconds } else { self.dt_s };
        }
    }

    /// Time to the next step of commands on their way to the neutral values, a sample \[s\]; `None` if they are there.
    pub fn rests_in_s(&self) -> Option<f64> {
        (self.command != self.rest).then_some(self.dt_s)
    }

    /// Time off its way after which a new way is planned \[s\].
    pub const fn patience_s(&self) -> f64 {
        self.supervisor.patience_s()
    }

    /// The vessel does not answer to its commands: it is stopped.
    pub const fn stop_unanswered(&mut self) {
        self.supervisor.stop(Stop::Unanswered);
    }

    /// Status of the command.
    pub fn status(&self) -> &'static str {
        match self.supervisor.mode() {
            Mode::Arrived => "arrived",
            Mode::Stopped => "stopped",
            _ => self.guided.map_or(Status::Blind, |guided| guided.status).name(),
        }
    }

    /// What the vessel does with its task.
    pub const fn mode(&self) -> Mode {
        self.supervisor.mode()
    }

    /// Why the vessel was stopped.
    pub const fn stop(&self) -> Option<Stop> {
        self.supervisor.cause()
    }

    /// What is left of the way to the task \[m\]; 0 on the task.
    pub fn approach_m(&self) -> f64 {
        self.guidance.approach_m()
    }

    /// The planned command of a later sample; the command in force without a plan.
    pub fn planned(&self, later: usize) -> &[f64] {
        if self.mode().steers() { self.law.planned(later).unwrap_or(&self.command) } else { &self.command }
    }

    /// Computes the command of a sample.
    pub fn steer(&mut self, elapsed: Elapsed, seen: &Seen<'_>) {
        let elapsed_s = match elapsed {
            Elapsed::Start => f64::INFINITY,
            Elapsed::Steps(steps) => steps as f64 * self.dt_s,
            Elapsed::Gap(gap_s) => gap_s,
        };
        let mut pose = seen.pose;
        self.leave_stuck(elapsed, elapsed_s, &mut pose);
        if let Some(reckoning) = &mut self.reckoning {
            if !matches!(elapsed, Elapsed::Steps(_)) {
                reckoning.reset();
            }
            reckoning.take(elapsed_s, self.nu, &mut pose);
            // What a wrong sensor has taught is forgotten.
            for (part, range) in [0..2, 2..3].into_iter().enumerate() {
                if reckoning.off()[part] > 0.0 {
                    self.drift[range].fill(0.0);
                }
            }
        }
        let [x, y, psi] = pose.map(f64::is_finite);
        let [u, v, r] = self.motion.map(|place| !seen.outputs[place].is_nan());
        self.liveness.take(elapsed_s, [x && y, psi, u, v, r]);
        if !matches!(elapsed, Elapsed::Steps(_)) {
            // A new run begins: the pose is believed.
            (self.eta, self.drift) = ([f64::NAN; 3], [0.0; 3]);
        }
        self.locate(elapsed_s, pose);
        for (nu, place) in self.nu.iter_mut().zip(self.motion) {
            let measured = seen.outputs[place];
            *nu = if measured.is_nan() { seen.estimate[place] } else { measured };
        }
        match elapsed {
            Elapsed::Gap(gap_s) => {
                self.law.reset();
                self.guidance.resume(gap_s, [self.eta[0], self.eta[1]]);
                self.supervisor.lose();
            }
            Elapsed::Steps(steps) if self.mode().steers() => {
                (0..steps).for_each(|_| self.guidance.advance());
            }
            Elapsed::Start | Elapsed::Steps(_) => {}
        }
        if self.guidance.track().fence.margin([self.eta[0], self.eta[1]]) < 0.0 {
            self.supervisor.stop(Stop::Outside);
        }
        if self.reckoning.as_ref().is_some_and(DeadReckoning::is_unsettled) {
            self.supervisor.stop(Stop::Contradiction);
        }
        if self.stuck_s > self.stall_s {
            self.supervisor.stop(Stop::Stuck);
        }
        if self.supervisor.begin(self.liveness.is_alive(), elapsed_s) {
            if let Some([left_m, duration_s]) = self.guidance.plan(self.eta, self.nu, self.turning_radius) {
                self.set_out = left_m;
                self.supervisor.planned(left_m, duration_s);
                self.guidance.pace(1.0);
            } else {
                self.supervisor.stop(Stop::NoWay);
            }
        }
        let moving_s = (elapsed_s - std::mem::take(&mut self.moved_s)).max(0.0);
        if !self.mode().steers() {
            self.rest(moving_s);
            return;
        }
        let before = self.command.clone();
        let outputs: Vec<f64> = seen
            .outputs
            .iter()
            .zip(seen.estimate)
            .map(|(y, estimate)| if y.is_nan() { *estimate } else { *y })
            .collect();
        let measured =
            Measured { eta: self.eta, nu: self.nu, outputs: &outputs, session: Some(seen.session) };
        let guided = self.guidance.command(self.law.as_mut(), &measured, &mut self.command);
        self.guided = Some(guided);
        let near = guided.distance <= self.tolerance;
        // The reference waits for a vessel that is off its way, and slows down before (scaling of a trajectory in time: Dahl and
        // Nielsen, IEEE Trans. Robotics and Automation 6 (1990) 554): one that stands and runs in turn would keep the vessel at
        // the tolerance.
        self.guidance.pace(if near {
            (2.0 - 2.0 * guided.lag / self.tolerance).clamp(0.0, 1.0)
        } else {
            0.0
        });
        let done = self.guidance.is_done();
        let place = if self.guidance.track().is_station {
            let is_coming = self.mode() == Mode::Approach && guided.distance <= self.set_out + self.tolerance;
            Place { within: near || is_coming, joined: near, done, along_m: f64::INFINITY }
        } else {
            let joined = self.guidance.approach_m() == 0.0;
            Place { within: near, joined, done, along_m: guided.reference.s }
        };
        self.supervisor.judge(&place);
        let finite = self.command.iter().all(|c| c.is_finite());
        if !finite {
            self.law.reset();
        }
        if !self.mode().steers() || !finite {
            self.command.copy_from_slice(&self.rest);
        }
        self.keep_rates(&before, moving_s);
    }

    /// A measured position that does not change to the last digit while commands push the vessel counts as missing until it changes,
    /// or a new run begins. From rest, the vessel has the time of its tolerance at the speed of the task.
    fn leave_stuck(&mut self, elapsed: Elapsed, elapsed_s: f64, pose: &mut [f64; 3]) {
        if self.reckoning.is_none() {
            return;
        }
        if !matches!(elapsed, Elapsed::Steps(_)) {
            (self.repeats, self.pushing_s, self.stuck_s) = (Repeats::default(), 0.0, 0.0);
        }
        let elapsed_s = if elapsed_s.is_finite() { elapsed_s } else { 0.0 };
        self.pushing_s = if self.command == self.rest { 0.0 } else { self.pushing_s + elapsed_s };
        if pose[..2].iter().any(|x| x.is_nan()) {
            return;
        }
        if self.repeats.take(elapsed_s, [pose[0], pose[1]]) {
            self.stuck_s = 0.0;
        } else if self.stuck_s > 0.0 {
            self.stuck_s += elapsed_s;
        } else if let Some(stuck_s) = self.repeats.stuck_s(self.pushing_s - self.smoothing_s) {
            self.stuck_s = stuck_s;
        }
        if self.stuck_s > 0.0 {
            pose[..2].fill(f64::NAN);
        }
    }

    /// Time for which the position has not changed, where it is stuck and counts as missing \[s\]; 0 otherwise.
    pub const fn stuck_s(&self) -> f64 {
        self.stuck_s
    }

    /// Keeps the limits of the rates from the command before: the law does not know those at rest. A time that is not known counts
    /// as one sample.
    fn keep_rates(&mut self, before: &[f64], moving_s: f64) {
        let moving_s = if moving_s.is_finite() { moving_s } else { self.dt_s };
        for ((command, before), limits) in self.command.iter_mut().zip(before).zip(&self.limits) {
            if limits.rate.is_finite() {
                let change = limits.rate * moving_s;
                *command = command.max(before - change).min(before + change);
            }
        }
    }

    /// Brings the commands to their neutral values, within the limits of their rates; from these values the law continues.
    fn rest(&mut self, moving_s: f64) {
        let before = self.command.clone();
        self.command.copy_from_slice(&self.rest);
        self.keep_rates(&before, moving_s);
        self.law.reset();
        self.guided = None;
        if !self.liveness.is_alive() {
            self.supervisor.lose();
        }
    }

    /// Takes the measured pose, or predicts missing parts with the last velocities.
    ///
    /// A measured pose corrects the predicted one by the fading-memory filter of degree one (N. Morrison, *Introduction to
    /// Sequential Smoothing and Prediction*, 1969, chapter 13), so that its noise is not steered with: with the time constant `tau`,
    ///
    /// ```text
    /// eta = eta_p + (1 - theta^2) e,   drift = drift + (1 - theta)^2 e / dt,   e = eta_measured - eta_p,   theta = exp(-dt / tau)
    /// ```
    ///
    /// and `eta_p` predicted with velocities and drift. A constant error of the velocities leads to no error of the pose. The
    /// time constant is that in which the vessel sails its tolerance: where a velocity changes its error by a part of the speed,
    /// the pose is off by that part of the tolerance.
    fn locate(&mut self, elapsed_s: f64, pose: [f64; 3]) {
        let [x, y, psi] = self.eta;
        let [u, v, r] = self.nu;
        let [to_north, to_east, yaw] = self.drift;
        let turned = (r + yaw) * elapsed_s;
        let (sin, cos) = (psi + 0.5 * turned).sin_cos();
        let predicted = [
            x + elapsed_s * (u * cos - v * sin + to_north),
            y + elapsed_s * (u * sin + v * cos + to_east),
            psi + turned,
        ];
        let theta = if self.smoothing_s > 0.0 { (-elapsed_s / self.smoothing_s).exp() } else { 0.0 };
        for (part, range) in [0..2, 2..3].into_iter().enumerate() {
            if pose[range.clone()].iter().all(|x| x.is_finite()) {
                let is_known = predicted[range.clone()].iter().all(|x| x.is_finite());
                for i in range {
                    // A heading keeps the turn that is measured.
                    let turns = if i == 2 { TAU * ((pose[i] - predicted[i]) / TAU).round() } else { 0.0 };
                    let apart = pose[i] - turns - predicted[i];
                    if is_known && theta > 0.0 && elapsed_s > 0.0 {
                        self.eta[i] = predicted[i] + turns + (1.0 - theta * theta) * apart;
                        self.drift[i] += (1.0 - theta).powi(2) / elapsed_s * apart;
                    } else {
                        (self.eta[i], self.drift[i]) = (pose[i], 0.0);
                    }
                }
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
        memory.numbers(&mut self.drift);
        memory.numbers(&mut self.nu);
        self.liveness.visit_state(memory);
        self.repeats.visit_state(memory);
        memory.number(&mut self.pushing_s);
        memory.number(&mut self.stuck_s);
        if let Some(reckoning) = &mut self.reckoning {
            reckoning.visit_state(memory);
        }
        memory.numbers(&mut self.command);
        for (command, Limits { low, high, rest, .. }) in self.command.iter_mut().zip(&self.limits) {
            if !(*low..=*high).contains(command) {
                *command = *rest;
            }
        }
        memory.number(&mut self.moved_s);
        self.supervisor.visit_state(memory);
        memory.number(&mut self.set_out);
    }
}
