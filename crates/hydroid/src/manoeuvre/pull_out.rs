//! The pull-out trial.

use serde::Serialize;

use super::approach::Approach;
use super::settling::{BLOCK, Settling};
use super::track::{Run, Track};
use super::turning_circle::turn;
use crate::plant::InputMap;

/// Results of pull-out trials from turns to both sides: the steering returns to that of the straight course. A directionally
/// stable vessel returns to a straight course; an unstable one goes on turning.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PullOut {
    /// Steering of the turns before: 1 is hard over.
    pub steering: f64,
    /// Yaw rate that remains after a turn to starboard and to port \[deg/s\].
    pub residual_deg_s: [Option<f64>; 2],
    /// Time in which the yaw rate falls to a tenth of that in the turn \[s\].
    pub decay_s: [Option<f64>; 2],
    /// Whether the vessel is directionally stable: less than 1 % of the yaw rate of the turns remains. `None` if a yaw rate
    /// does not become constant.
    pub stable: Option<bool>,
}

/// Share of the yaw rate in the turn below which the vessel no longer turns.
const STRAIGHT: f64 = 0.01;

/// Distance of the yaw rate from its limit, relative to that in the turn, at which it is constant.
const STEADY: f64 = 1e-4;

/// Simulates pull-outs from steady turns with the steering `s` to starboard and to port, each until the yaw rate is constant,
/// or for `longest_s`.
pub fn pull_out(approach: &Approach, map: &InputMap, s: f64, longest_s: f64) -> (PullOut, [Track; 2]) {
    let [starboard, port] = [s.abs(), -s.abs()].map(|s| Side::simulate(approach, map, s, longest_s));
    let straight = |side: &Side| side.residual.map(|rate| rate.abs() <= STRAIGHT * side.initial.abs());
    let result = PullOut {
        steering: s.abs(),
        residual_deg_s: [starboard.residual, port.residual].map(|rate| rate.map(f64::to_degrees)),
        decay_s: [starboard.decay_s, port.decay_s],
        stable: straight(&starboard).zip(straight(&port)).map(|(starboard, port)| starboard && port),
    };
    (result, [starboard.track, port.track])
}

/// A pull-out from a turn to one side.
struct Side {
    /// Yaw rate of the turn \[rad/s\].
    initial: f64,
    residual: Option<f64>,
    decay_s: Option<f64>,
    track: Track,
}

impl Side {
    fn simulate(approach: &Approach, map: &InputMap, s: f64, longest_s: f64) -> Self {
        let mut run = Run::new(approach, map, s, longest_s);
        turn(&mut run, s.signum());
        if run.track.not_valid.is_none() {
            run.track.execute = run.track.len() - 1;
        }
        run.steer(approach.steering);
        let initial = run.yaw_rate();
        let (mut residual, mut decay_s, mut settling) = (None, None, Settling::from(initial));
        while residual.is_none() && run.advance() {
            let (samples, rate) = (run.track.len() - 1 - run.track.execute, run.yaw_rate());
            if decay_s.is_none() && rate.abs() <= 0.1 * initial.abs() {
                decay_s = Some(samples as f64 * run.track.dt);
            }
            if samples.is_multiple_of(BLOCK) {
                residual = (settling.update(rate).abs() <= STEADY * initial.abs()).then_some(rate);
            }
        }
        Self { initial, residual, decay_s, track: run.track }
    }
}
