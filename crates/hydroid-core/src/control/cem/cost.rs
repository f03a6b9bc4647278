//! What a plan costs.

use alloc::vec::Vec;

use num_traits::Float;

use crate::actuator::Limits;
use crate::control::error::{ControlError, at_least};
use crate::guidance::Reference;

/// A limit on an output that plans may cross at a price.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftLimit {
    /// The output.
    pub output: usize,
    /// Lowest and highest value \[unit of the output\].
    pub range: [f64; 2],
    /// Price of crossing it by one unit, squared.
    pub weight: f64,
}

/// What a plan costs: with the pose that follows from predicted `u, v, r`, the mean over the horizon of
///
/// ```text
/// position |p - p_d|^2 + heading 2 (1 - cos(psi + beta - psi_d)) + speed (|nu| - U_d)^2
///   + sum_i effort_i (c_i / s_i)^2 + rate_i (dc_i / s_i)^2 + sum of weights times crossed limits squared
/// beta = asin(v / max(|nu|, U_d / 2, 0.1 m/s))
/// ```
///
/// `p` is a point `ahead` metres ahead of the origin; `psi_d` the course of the path at the reference, `U_d` its speed;
/// `s_i` half of the range of a command, `dc_i` its change from sample to sample. `beta` is the drift: it is the course over
/// ground that shall be the path's, as long as the vessel goes ahead. A vessel that turns, or crosses a current, has to head elsewhere, and a price on its
/// heading would hold it off the path. A plan whose prediction is no number costs infinity. The pose is integrated by the
/// midpoint rule: mean velocities, turned by the mean heading.
#[derive(Clone, Debug, PartialEq)]
pub struct Cost {
    /// Distance of the point ahead of the origin \[m\].
    pub ahead: f64,
    /// Price of a distance of 1 m.
    pub position: f64,
    /// Price of a small angle of 1 rad between course over ground and path.
    pub heading: f64,
    /// Price of 1 m/s.
    pub speed: f64,
    /// Price of each command at half of its range.
    pub effort: Vec<f64>,
    /// Price of a change of each command by half of its range in a sample.
    pub rate: Vec<f64>,
    /// Limits on outputs.
    pub soft_limits: Vec<SoftLimit>,
}

impl Cost {
    /// To be at the reference, smoothly, with so many commands: 1 for a metre, 0.2 for a radian, 0.2 for 1 m/s, 0.05 for
    /// changes.
    pub fn tracking(inputs: usize) -> Self {
        Self {
            ahead: 0.0,
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
            ("the price of the position", self.position),
            ("the price of the heading", self.heading),
            ("the price of the speed", self.speed),
        ] {
            at_least(what, value, 0.0)?;
        }
        if !self.ahead.is_finite() {
            let needed = "a number is needed";
            return Err(ControlError::Setting { what: "the point ahead", value: self.ahead, needed });
        }
        for prices in [&self.effort, &self.rate] {
            if prices.len() != inputs {
                return Err(ControlError::Count { expected: inputs, given: prices.len() });
            }
            for &price in prices {
                at_least("the price of a command", price, 0.0)?;
            }
        }
        for limit in &self.soft_limits {
            at_least("the price of a limit", limit.weight, 0.0)?;
            let [low, high] = limit.range;
            // NaN is in no order.
            if !matches!(low.partial_cmp(&high), Some(core::cmp::Ordering::Less | core::cmp::Ordering::Equal))
            {
                let needed = "its range must have two ends, the lower one first";
                return Err(ControlError::Setting { what: "the range of a limit", value: low, needed });
            }
            if limit.output >= outputs {
                let needed = "there are not so many outputs";
                let value = limit.output as f64;
                return Err(ControlError::Setting { what: "the output of a limit", value, needed });
            }
        }
        Ok(())
    }

    /// Of one candidate. `y` are its predicted outputs (`u, v, r` first), row by row; `last` the command before;
    /// `references` where to be after each of its samples.
    pub(super) fn of(&self, moment: &PlanningProblem<'_>, y: &[f64], commands: &[f64]) -> f64 {
        let mut sum = 0.0;
        let known = self.residuals(moment, y, commands, |residual| sum += residual * residual);
        // What is not told by any price may still be no number.
        if sum.is_finite() && known.is_finite() {
            sum / moment.references.len() as f64
        } else {
            f64::INFINITY
        }
    }

    /// Residuals of one sample at the most.
    pub(super) fn residuals_of_a_sample(&self, inputs: usize) -> usize {
        4 + self.soft_limits.len() + 2 * inputs
    }

    /// What the cost of a candidate is the mean square of, in an order that is the same for all candidates of a moment. Gives
    /// the sum of the last pose, which is no number where something on the way was none.
    pub(super) fn residuals(
        &self,
        moment: &PlanningProblem<'_>,
        y: &[f64],
        commands: &[f64],
        mut each: impl FnMut(f64),
    ) -> f64 {
        let PlanningProblem { pose, nu, outputs, last, limits, references, dt } = *moment;
        let inputs = limits.len();
        let [position, heading, speed] = [self.position, self.heading, self.speed].map(Float::sqrt);
        let ([mut north, mut east, mut psi], mut before) = (pose, nu);
        for (k, (row, reference)) in y.chunks_exact(outputs).zip(references).enumerate() {
            let now = [row[0], row[1], row[2]];
            let middle: [f64; 3] = core::array::from_fn(|i| 0.5 * (before[i] + now[i]));
            let (sin, cos) = Float::sin_cos(psi + 0.5 * dt * middle[2]);
            north += dt * (middle[0] * cos - middle[1] * sin);
            east += dt * (middle[0] * sin + middle[1] * cos);
            psi += dt * middle[2];
            before = now;
            if self.position > 0.0 {
                let (sin, cos) = if self.ahead == 0.0 { (0.0, 0.0) } else { Float::sin_cos(psi) };
                each(position * (north + self.ahead * cos - reference.position[0]));
                each(position * (east + self.ahead * sin - reference.position[1]));
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
                // A NaN is lost in the maximum.
                each(Float::sqrt(limit.weight) * beyond + 0.0 * value);
            }
            for i in 0..inputs {
                let half = 0.5 * (limits[i].high - limits[i].low);
                let command = commands[k * inputs + i];
                let previous = if k == 0 { last[i] } else { commands[(k - 1) * inputs + i] };
                each(Float::sqrt(self.effort[i]) * command / half);
                each(Float::sqrt(self.rate[i]) * (command - previous) / half);
            }
        }
        north + east + psi
    }
}

/// All that is the same for every candidate of a plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlanningProblem<'a> {
    /// `[x, y, psi]`.
    pub(super) pose: [f64; 3],
    /// `[u, v, r]` as the model has them.
    pub(super) nu: [f64; 3],
    /// Outputs of the model.
    pub(super) outputs: usize,
    /// The command before.
    pub(super) last: &'a [f64],
    pub(super) limits: &'a [Limits],
    /// Where to be after each sample of the horizon.
    pub(super) references: &'a [Reference],
    /// Sample time \[s\].
    pub(super) dt: f64,
}

/// Speed below which a vessel has no course \[m/s\].
const ADRIFT: f64 = 0.1;

/// Angle from the heading to the course over ground, `asin(v / U)` \[rad\]; it goes to zero where the vessel does not move as
/// fast as it shall, so that one at rest has its heading for a course.
fn drift(v: f64, speed: f64, wanted: f64) -> f64 {
    Float::asin((v / speed.max(0.5 * wanted).max(ADRIFT)).clamp(-1.0, 1.0))
}
