//! Simulation: commands, integration, noise.

use std::ops::ControlFlow;

use hydroid_core::craft::{Craft, Posed};
use hydroid_core::current::in_body;
use hydroid_core::vessel::{Command, State};
use rand_distr::{Distribution as _, StandardNormal};

use super::error::SimulateError;
use super::options::{Counts, Options};
use super::path_controller::PathController;
use super::plan;
use super::record::Simulated;
use crate::excitation::{self, Envelope, Excitation, PropellerRudder, Purpose, stream};

const PROGRESS_EVERY: usize = 512;

/// Simulates a vessel and its measurements.
///
/// # Errors
/// Invalid options, vessel or excitation, divergence (see [`SimulateError`]), or cancellation by `progress`.
pub fn simulate(
    options: &Options,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Simulated, SimulateError> {
    let counts = options.counts()?;
    let vessel = &PropellerRudder::new(&options.vessel)?;
    let (seed, dt, n) = (options.seed, options.dt_s, counts.samples);
    let mut runner = Runner { options, counts, vessel, progress };

    let (commands, states) = match &options.excitation {
        Excitation::Mixed => runner.open_loop(&excitation::mixed(vessel, seed, dt, n)?)?,
        Excitation::Given(rows) => runner.open_loop(&excitation::held(rows, vessel, dt, n)?)?,
        Excitation::LowSpeed(low) => {
            let commands = excitation::low_speed(vessel, *low, seed, dt, n)?;
            runner.governed(&commands, excitation::low_speed_ceiling(vessel, low.ceiling))?
        }
        Excitation::LawnMower(plan) => {
            let envelope = Envelope::new(vessel)?;
            let legs = plan::lawn_mower(plan, vessel, &envelope, seed, options.duration_s)?;
            let mut controller = PathController::new(vessel, &envelope, legs, dt);
            runner.run(|k, state| controller.command(&over_ground(options, k, state)))?
        }
        Excitation::Circle(plan) => {
            let envelope = Envelope::new(vessel)?;
            let mut controller = PathController::new(vessel, &envelope, plan::circle(plan, &envelope)?, dt);
            runner.run(|k, state| controller.command(&over_ground(options, k, state)))?
        }
    };
    let states: Vec<State> =
        states.iter().enumerate().map(|(k, state)| over_ground(options, k, state)).collect();
    let measured = measure(&states, &options.vessel, options.noise_scale, options.seed);
    Ok(Simulated::new(options, vessel, commands, states, measured))
}

/// A state at sample `k`, given in the water: a frame that drifts with a constant current is an inertial frame (T. I.
/// Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2nd edition, 2021, property 10.1).
fn over_ground(options: &Options, k: usize, state: &State) -> State {
    let t = k as f64 * options.dt_s;
    let [north, east] = options.current;
    let [surge, sway] = in_body(options.current, state.psi);
    State { x: state.x + north * t, y: state.y + east * t, u: state.u + surge, v: state.v + sway, ..*state }
}

struct Runner<'a> {
    options: &'a Options,
    counts: Counts,
    vessel: &'a PropellerRudder,
    progress: &'a mut dyn FnMut(f64) -> ControlFlow<()>,
}

impl Runner<'_> {
    fn open_loop(&mut self, commands: &[Command]) -> Result<(Vec<Command>, Vec<State>), SimulateError> {
        self.run(|k, _| commands.get(k).copied())
    }

    /// Open loop without propeller force just below the ceiling: in turns the Coriolis force can accelerate.
    fn governed(
        &mut self,
        commands: &[Command],
        ceiling: f64,
    ) -> Result<(Vec<Command>, Vec<State>), SimulateError> {
        let idle = self.vessel.propeller().neutral;
        let (commands, states) = self.run(|k, state| {
            let command = commands.get(k)?;
            let pp = if state.u > 0.95 * ceiling { command.pp.min(idle) } else { command.pp };
            Some(Command { pp, ..*command })
        })?;
        match states.iter().position(|state| state.u >= ceiling) {
            None => Ok((commands, states)),
            Some(k) => Err(SimulateError::NotSlow {
                t_s: k as f64 * self.options.dt_s,
                reached: states[k].u,
                ceiling,
            }),
        }
    }

    fn state(&self, Posed { eta: [x, y, psi], nu, positions }: &Posed) -> State {
        let thrust = self.vessel.dynamics().thrusts(*nu, positions).next().unwrap_or_default();
        let [u, v, r] = *nu;
        State { x: *x, y: *y, psi: *psi, u, v, r, p_f: thrust }
    }

    /// From rest in the water to the end of the duration or of the commands, in the frame of the water. Row `k` holds the
    /// state before command `k` acts.
    fn run(
        &mut self,
        mut command: impl FnMut(usize, &State) -> Option<Command>,
    ) -> Result<(Vec<Command>, Vec<State>), SimulateError> {
        let Counts { samples, substeps } = self.counts;
        let h = self.options.dt_s / f64::from(substeps);
        let mut commands = Vec::with_capacity(samples);
        let mut states = Vec::with_capacity(samples);
        let dynamics = self.vessel.dynamics();
        let mut posed = Posed { eta: [0.0; 3], nu: [0.0; 3], positions: vec![0.0; dynamics.servos()] };
        let rest = self.vessel.craft().commands.iter().map(|command| command.neutral).collect::<Vec<f64>>();
        dynamics.settle(&rest, &mut posed.positions);
        for k in 0..samples {
            if k % PROGRESS_EVERY == 0 && (self.progress)(k as f64 / samples as f64).is_break() {
                return Err(SimulateError::Cancelled);
            }
            let state = self.state(&posed);
            let Some(held) = command(k, &state) else { break };
            commands.push(held);
            states.push(state);
            let row = self.vessel.row(held);
            dynamics.advance_pose(&mut posed, &row, h, substeps as usize, [0.0; 2], [0.0; 2]);
            if !self.state(&posed).is_finite() {
                return Err(SimulateError::Diverged {
                    t_s: (k + 1) as f64 * self.options.dt_s,
                    step_s: self.options.step_s,
                });
            }
        }
        if (self.progress)(1.0).is_break() {
            return Err(SimulateError::Cancelled);
        }
        Ok((commands, states))
    }
}

/// `[u, v, r, P_f]` with white Gaussian noise, drawn in the order of samples: a shorter record has the same noise.
fn measure(states: &[State], vessel: &Craft, scale: f64, seed: u64) -> Vec<[f64; 4]> {
    let [u, v, r] = vessel.noise;
    let force = vessel.thrusters[0].force_noise.unwrap_or(0.0);
    let deviations = [u, v, r, force].map(|std| std * scale);
    let mut rng = stream(seed, Purpose::Noise);
    let noisy = |state: &State| {
        let mut row = [state.u, state.v, state.r, state.p_f];
        for (value, std) in row.iter_mut().zip(deviations) {
            let unit: f64 = StandardNormal.sample(&mut rng);
            *value += std * unit;
        }
        row
    };
    states.iter().map(noisy).collect()
}
