//! Closed loops on the true plants: commands held over samples of 0.1 s, RK4 steps of 10 ms, noisy velocities, exact
//! pose.

use hydroid_core::control::{Controller, Estimate, Status};
use hydroid_core::craft::Craft;
use hydroid_core::guidance::{Path, PathReference, SpeedProfile, TimedReference};
use hydroid_core::vessel::{Command, State};

use crate::plant::Plant;

pub(crate) const DT: f64 = 0.1;

/// White Gaussian noise from a seed: Box-Muller on `SplitMix64`.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn normal(&mut self) -> f64 {
        let (a, b) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }
}

pub(crate) enum Mover {
    Clock(TimedReference),
    Vessel(PathReference),
}

pub(crate) struct Sea<'a> {
    pub(crate) vessel: &'a Craft,
    pub(crate) path: &'a Path,
    pub(crate) profile: &'a SpeedProfile,
    pub(crate) duration_s: f64,
    pub(crate) noise: f64,
    pub(crate) seed: u64,
    /// Acceleration by wind, north and east \[m/s^2\].
    pub(crate) wind: [f64; 2],
    /// Whether the force is measured.
    pub(crate) force: bool,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    pub(crate) t: f64,
    pub(crate) state: State,
    /// Distance of the lookahead point from its reference \[m\].
    pub(crate) error: f64,
    /// Cross-track error of the point, to starboard \[m\].
    pub(crate) cross_track: f64,
    pub(crate) speed: f64,
    pub(crate) status: Status,
    pub(crate) command: [f64; 2],
}

/// Root mean square after `from` seconds.
pub(crate) fn rms(run: &[Moment], from: f64, of: impl Fn(&Moment) -> f64) -> f64 {
    let late: Vec<f64> = run.iter().filter(|m| m.t >= from).map(|m| of(m).powi(2)).collect();
    (late.iter().sum::<f64>() / late.len() as f64).sqrt()
}

/// A run from a state. The path is for the point `ahead` metres ahead of the origin.
pub(crate) fn sail(
    sea: &Sea<'_>,
    controller: &mut dyn Controller,
    mut mover: Mover,
    start: State,
    ahead: f64,
) -> Vec<Moment> {
    let plant = Plant::new(sea.vessel);
    let mut noise = Noise(sea.seed);
    let sigma = sea.vessel.noise;
    let mut state = start;
    let mut run = Vec::new();
    let mut foot = PathReference::new(0.0, 5.0);
    let mut k = 0_u32;
    while f64::from(k) * DT < sea.duration_s - 0.5 * DT {
        let nu = [
            state.u + sea.noise * sigma[0] * noise.normal(),
            state.v + sea.noise * sigma[1] * noise.normal(),
            state.r + sea.noise * sigma[2] * noise.normal(),
        ];
        let force = [
            state.p_f + sea.noise * sea.vessel.thrusters[0].force_noise.unwrap_or(0.0) * noise.normal(),
            f64::NAN,
        ];
        let actuators = if sea.force { &force[..] } else { &[] };
        let estimate = Estimate { eta: [state.x, state.y, state.psi], nu, current: [0.0; 2], actuators };
        let point = [state.x + ahead * state.psi.cos(), state.y + ahead * state.psi.sin()];
        let reference = match &mut mover {
            Mover::Clock(walker) => walker.reference(sea.path, sea.profile),
            Mover::Vessel(follower) => follower.reference(sea.path, sea.profile, point),
        };
        let mut command = [0.0; 2];
        let status = controller.command(&estimate, &reference, &mut command);
        let error = (point[0] - reference.position[0]).hypot(point[1] - reference.position[1]);
        let cross_track = foot.project(sea.path, point).cross_track;
        let t = f64::from(k) * DT;
        run.push(Moment { t, state, error, cross_track, speed: reference.speed, status, command });
        k += 1;
        let held = Command { pp: command[0], rd: command[1] };
        for _ in 0..10 {
            state = plant.advance(&state, &held, 0.01);
            let (sin, cos) = state.psi.sin_cos();
            state.u += 0.01 * (sea.wind[0] * cos + sea.wind[1] * sin);
            state.v += 0.01 * (sea.wind[1] * cos - sea.wind[0] * sin);
        }
        if let Mover::Clock(walker) = &mut mover {
            walker.advance(sea.profile, DT);
        }
    }
    run
}

/// A state at the reference speed whose point is `off` metres outside of the start of the path.
pub(crate) fn under_way(vessel: &Craft, path: &Path, profile: &SpeedProfile, ahead: f64, off: f64) -> State {
    let (pose, (speed, _)) = (path.at(0.0), profile.at(0.0));
    let (sin, cos) = pose.course.sin_cos();
    let plant = Plant::new(vessel);
    State {
        x: pose.position[0] - ahead * cos - off * sin,
        y: pose.position[1] - ahead * sin + off * cos,
        psi: pose.course,
        u: speed,
        p_f: plant.dynamics.holding_force(speed),
        ..State::REST
    }
}
