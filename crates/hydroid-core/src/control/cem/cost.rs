//! What a plan costs.

use alloc::vec::Vec;

use num_traits::Float;

use crate::control::channel::Limits;
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
/// position |p - p_d|^2 + heading 2 (1 - cos(psi - psi_d)) + speed (|nu| - U_d)^2
///   + sum_i effort_i (c_i / s_i)^2 + rate_i (dc_i / s_i)^2 + sum of weights times crossed limits squared
/// ```
///
/// `p` is a point `ahead` metres ahead of the origin; `psi_d` the course of the path at the reference, `U_d` its speed;
/// `s_i` half of the range of a command, `dc_i` its change from sample to sample. A plan whose prediction is no number
/// costs infinity. The pose is integrated by the midpoint rule: mean velocities, turned by the mean heading.
#[derive(Clone, Debug, PartialEq)]
pub struct Cost {
    /// Distance of the point ahead of the origin \[m\].
    pub ahead: f64,
    /// Price of a distance of 1 m.
    pub position: f64,
    /// Price of a small angle of 1 rad.
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
    #[allow(clippy::too_many_arguments)] // a loop's inner function: all of it changes from call to call
    pub(super) fn of(
        &self,
        pose: [f64; 3],
        nu: [f64; 3],
        y: &[f64],
        outputs: usize,
        commands: &[f64],
        last: &[f64],
        limits: &[Limits],
        references: &[Reference],
        dt: f64,
    ) -> f64 {
        let inputs = limits.len();
        let ([mut north, mut east, mut psi], mut before) = (pose, nu);
        let mut sum = 0.0;
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
                let x = north + self.ahead * cos - reference.position[0];
                let y = east + self.ahead * sin - reference.position[1];
                sum += self.position * (x * x + y * y);
            }
            if self.heading > 0.0 {
                sum += self.heading * 2.0 * (1.0 - Float::cos(psi - reference.course));
            }
            if self.speed > 0.0 {
                let off = Float::sqrt(now[0] * now[0] + now[1] * now[1]) - reference.speed;
                sum += self.speed * off * off;
            }
            for limit in &self.soft_limits {
                let value = row[limit.output];
                let beyond = (limit.range[0] - value).max(value - limit.range[1]).max(0.0);
                // A NaN is lost in the maximum.
                sum += limit.weight * beyond * beyond + 0.0 * value;
            }
            for i in 0..inputs {
                let half = 0.5 * (limits[i].high - limits[i].low);
                let command = commands[k * inputs + i];
                let previous = if k == 0 { last[i] } else { commands[(k - 1) * inputs + i] };
                let (effort, change) = (command / half, (command - previous) / half);
                sum += self.effort[i] * effort * effort + self.rate[i] * change * change;
            }
        }
        // What is not told by any price above may still be no number.
        let known = north + east + psi;
        if sum.is_finite() && known.is_finite() { sum / references.len() as f64 } else { f64::INFINITY }
    }
}
