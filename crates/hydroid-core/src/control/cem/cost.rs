//! The cost function of model predictive control.

use alloc::vec::Vec;

use num_traits::Float;

use crate::actuator::{Limits, clamp_to_limits};
use crate::control::error::{ControlError, at_least};
use crate::guidance::Reference;
use crate::predict::{Predictor, Workspace};

/// A soft limit on an output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftLimit {
    /// The output.
    pub output: usize,
    /// Minimum and maximum \[unit of the output\].
    pub range: [f64; 2],
    /// Cost weight of the squared excess \[1/unit^2\].
    pub weight: f64,
}

/// Cost of a plan: with the pose integrated from the predicted `u, v, r`, the mean over the ends of its commands of
///
/// ```text
/// position |p - p_d|^2 + heading 2 (1 - cos(psi + beta - psi_d)) + speed (|nu| - U_d)^2
///   + sum_i effort_i ((c_i - c_i0) / s_i)^2 + rate_i (dc_i / s_i)^2 + sum of soft limits, weight times squared excess
/// beta = asin(v / max(|nu|, U_d / 2, 0.1 m/s))
/// ```
///
/// `p` is the point `lookahead` metres ahead of the origin; `psi_d` and `U_d` are course and speed of the path at the
/// reference; `s_i` is half of the range of a command, `c_i0` its value at rest and `dc_i` its change from the command before. With
/// the drift angle `beta`, the heading term acts on the course over ground; at a reference at rest, `U_d = 0`, it acts on the
/// heading, `beta = 0`. The pose is integrated by the midpoint rule. A plan whose
/// prediction is not finite has an infinite cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Cost {
    /// Distance of the lookahead point from the origin \[m\].
    pub lookahead: f64,
    /// Weight of the squared distance \[1/m^2\].
    pub position: f64,
    /// Weight of the squared angle between course over ground and path (small angles) \[1/rad^2\].
    pub heading: f64,
    /// Weight of the squared speed error \[s^2/m^2\].
    pub speed: f64,
    /// Weight of each command.
    pub effort: Vec<f64>,
    /// Weight of the change of each command.
    pub rate: Vec<f64>,
    /// Soft limits on outputs.
    pub soft_limits: Vec<SoftLimit>,
}

impl Cost {
    /// Weights for tracking with `inputs` commands: 1 for the position, 0.2 for heading and speed, 0.05 for changes.
    pub fn tracking(inputs: usize) -> Self {
        Self {
            lookahead: 0.0,
            position: 1.0,
            heading: 0.2,
            speed: 0.2,
            effort: alloc::vec![0.0; inputs],
            rate: alloc::vec![0.05; inputs],
            soft_limits: Vec::new(),
        }
    }

    pub(super) fn check(&self, inputs: usize, outputs: usize) -> Result<(), ControlError> {
        for (what, value) in [
            ("the weight of the position", self.position),
            ("the weight of the heading", self.heading),
            ("the weight of the speed", self.speed),
        ] {
            at_least(what, value, 0.0)?;
        }
        if !self.lookahead.is_finite() {
            let needed = "a number is needed";
            return Err(ControlError::Setting {
                what: "the lookahead distance",
                value: self.lookahead,
                needed,
            });
        }
        for weights in [&self.effort, &self.rate] {
            if weights.len() != inputs {
                return Err(ControlError::Count { expected: inputs, given: weights.len() });
            }
            for &weight in weights {
                at_least("the weight of a command", weight, 0.0)?;
            }
        }
        for limit in &self.soft_limits {
            at_least("the weight of a limit", limit.weight, 0.0)?;
            let [low, high] = limit.range;
            // NaN has no order.
            if !matches!(low.partial_cmp(&high), Some(core::cmp::Ordering::Less | core::cmp::Ordering::Equal))
            {
                let needed = "its range must have two ends, the lower one first";
                return Err(ControlError::Setting { what: "the range of a limit", value: low, needed });
            }
            if limit.output >= outputs {
                let needed = "the model has fewer outputs";
                let value = limit.output as f64;
                return Err(ControlError::Setting { what: "the output of a limit", value, needed });
            }
        }
        Ok(())
    }

    pub(super) fn of(&self, moment: &PlanningProblem<'_>, y: &[f64], commands: &[f64]) -> f64 {
        let mut sum = 0.0;
        let known = self.residuals(moment, y, commands, |residual| sum += residual * residual);
        // A term without weight may be infinite or NaN.
        if sum.is_finite() && known.is_finite() {
            sum / moment.references.len() as f64
        } else {
            f64::INFINITY
        }
    }

    pub(super) fn residuals_of_a_sample(&self, inputs: usize) -> usize {
        4 + self.soft_limits.len() + 2 * inputs
    }

    /// Residuals whose mean square is the cost. Returns the sum of the last pose: not finite if the prediction is not.
    pub(super) fn residuals(
        &self,
        moment: &PlanningProblem<'_>,
        y: &[f64],
        commands: &[f64],
        mut each: impl FnMut(f64),
    ) -> f64 {
        let PlanningProblem { pose, nu, outputs, last, limits, references, dt, hold } = *moment;
        let inputs = limits.len();
        let [position, heading, speed] = [self.position, self.heading, self.speed].map(Float::sqrt);
        let ([mut north, mut east, mut psi], mut before) = (pose, nu);
        for (sample, row) in y.chunks_exact(outputs).enumerate() {
            let now = [row[0], row[1], row[2]];
            let middle: [f64; 3] = core::array::from_fn(|i| 0.5 * (before[i] + now[i]));
            let (sin, cos) = Float::sin_cos(psi + 0.5 * dt * middle[2]);
            north += dt * (middle[0] * cos - middle[1] * sin);
            east += dt * (middle[0] * sin + middle[1] * cos);
            psi += dt * middle[2];
            before = now;
            if !(sample + 1).is_multiple_of(hold) {
                continue;
            }
            let k = sample / hold;
            let reference = &references[k];
            if self.position > 0.0 {
                let (sin, cos) = if self.lookahead == 0.0 { (0.0, 0.0) } else { Float::sin_cos(psi) };
                each(position * (north + self.lookahead * cos - reference.position[0]));
                each(position * (east + self.lookahead * sin - reference.position[1]));
            }
            let over_ground = Float::sqrt(now[0] * now[0] + now[1] * now[1]);
            if self.heading > 0.0 {
                let off = psi + drift(now[1], over_ground, reference.speed) - reference.course;
                each(heading * 2.0 * Float::sin(0.5 * off));
            }
            if self.speed > 0.0 {
                each(speed * (over_ground - reference.speed));
            }
            for limit in &self.soft_limits {
                let value = row[limit.output];
                let beyond = (limit.range[0] - value).max(value - limit.range[1]).max(0.0);
                // The maximum drops a NaN.
                each(Float::sqrt(limit.weight) * beyond + 0.0 * value);
            }
            for i in 0..inputs {
                if limits[i].are_held() {
                    each(0.0);
                    each(0.0);
                    continue;
                }
                let half = limits[i].half();
                let command = commands[k * inputs + i];
                let previous = if k == 0 { last[i] } else { commands[(k - 1) * inputs + i] };
                each(Float::sqrt(self.effort[i]) * (command - limits[i].rest) / half);
                each(Float::sqrt(self.rate[i]) * (command - previous) / half);
            }
        }
        north + east + psi
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct PlanningProblem<'a> {
    pub(super) pose: [f64; 3],
    pub(super) nu: [f64; 3],
    pub(super) outputs: usize,
    pub(super) last: &'a [f64],
    pub(super) limits: &'a [Limits],
    /// References at the ends of the commands of a plan.
    pub(super) references: &'a [Reference],
    pub(super) dt: f64,
    /// Samples for which a command is held.
    pub(super) hold: usize,
}

impl PlanningProblem<'_> {
    /// Clamps plans to limits, and to rate limits over the time of a command.
    pub(super) fn clamp(&self, plan: &mut [f64]) {
        clamp_to_limits(plan, self.last, self.limits, self.dt * self.hold as f64);
    }

    /// Number of outputs of a rollout.
    pub(super) const fn rows(&self) -> usize {
        self.references.len() * self.hold * self.outputs
    }

    /// Rolls out `count` plans. Each command is held, after a ramp with the limit of its rate.
    pub(super) fn roll_out(&self, simulator: &mut Simulator<'_>, count: usize, plans: &[f64], y: &mut [f64]) {
        let Simulator { session, work, samples } = simulator;
        if self.hold == 1 {
            session.rollout_batch(count, plans, work, y);
            return;
        }
        let inputs = self.limits.len();
        let len = self.references.len() * inputs;
        samples.clear();
        for plan in plans.chunks_exact(len).take(count) {
            let start = samples.len();
            for command in plan.chunks_exact(inputs) {
                (0..self.hold).for_each(|_| samples.extend_from_slice(command));
            }
            clamp_to_limits(&mut samples[start..], self.last, self.limits, self.dt);
        }
        session.rollout_batch(count, samples, work, y);
    }
}

/// A model for rollouts, and their memory.
pub(super) struct Simulator<'a> {
    pub(super) session: &'a dyn Predictor,
    pub(super) work: &'a mut Workspace,
    /// Commands of all samples of a batch.
    pub(super) samples: &'a mut Vec<f64>,
}

/// Minimum speed in the drift angle \[m/s\].
const ADRIFT: f64 = 0.1;

/// Drift angle from the heading to the course over ground \[rad\]; zero at low speed, where the course is undefined, and for
/// a reference at rest.
fn drift(v: f64, speed: f64, wanted: f64) -> f64 {
    if wanted == 0.0 {
        return 0.0;
    }
    Float::asin((v / speed.max(0.5 * wanted).max(ADRIFT)).clamp(-1.0, 1.0))
}
