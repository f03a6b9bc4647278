//! Speed profiles along a path.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::error::{PathError, positive};
use super::path::Path;
use crate::vessel::kinematics::wrap;

/// Limits of a vessel along a path. Infinite means no limit; the two accelerations must be finite.
///
/// `lateral_acceleration` and `yaw_rate` come from turning circles at the same speed, with a quarter of the rudder as a
/// reserve for the controller; `acceleration` and `deceleration` from starts and crash stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedLimits {
    /// Speed where nothing else limits it \[m/s\].
    pub cruise: f64,
    /// Largest `U^2 |kappa|` \[m/s^2\].
    pub lateral_acceleration: f64,
    /// Largest `U |kappa|` \[rad/s\].
    pub yaw_rate: f64,
    /// Speed over corners, where the course jumps \[m/s\].
    pub corner: f64,
    /// Largest `dU/dt` \[m/s^2\].
    pub acceleration: f64,
    /// Largest `-dU/dt` \[m/s^2\].
    pub deceleration: f64,
    /// Speed at the start of an open path \[m/s\].
    pub start: f64,
    /// Speed at the end of an open path \[m/s\]; 0 to stop there.
    pub end: f64,
}

impl SpeedLimits {
    /// A constant speed, with no limits except 0.2 m/s^2 on its changes.
    pub const fn cruise(speed: f64) -> Self {
        Self {
            cruise: speed,
            lateral_acceleration: f64::INFINITY,
            yaw_rate: f64::INFINITY,
            corner: f64::INFINITY,
            acceleration: 0.2,
            deceleration: 0.2,
            start: f64::INFINITY,
            end: f64::INFINITY,
        }
    }

    /// Speed in a turn \[m/s\]: `min(cruise, sqrt(a / |kappa|), r / |kappa|)`.
    fn at(&self, curvature: f64) -> f64 {
        let kappa = curvature.abs();
        if kappa == 0.0 {
            return self.cruise;
        }
        self.cruise.min(Float::sqrt(self.lateral_acceleration / kappa)).min(self.yaw_rate / kappa)
    }

    fn check(&self) -> Result<(), PathError> {
        positive("the cruising speed", self.cruise)?;
        positive("the acceleration", self.acceleration)?;
        positive("the deceleration", self.deceleration)?;
        for (what, value) in [
            ("the lateral acceleration", self.lateral_acceleration),
            ("the yaw rate", self.yaw_rate),
            ("the speed over corners", self.corner),
        ] {
            if value.is_nan() || value <= 0.0 {
                return Err(PathError::NotPositive { what, value });
            }
        }
        for (what, value) in [("the speed at the start", self.start), ("the speed at the end", self.end)] {
            if value.is_nan() || value < 0.0 {
                return Err(PathError::NotPositive { what, value });
            }
        }
        Ok(())
    }
}

/// A section of constant acceleration `dU/dt` along the path; metres and seconds. `end` is exact where it is 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Phase {
    pub(super) s: f64,
    pub(super) length: f64,
    pub(super) speed: f64,
    pub(super) end: f64,
    pub(super) acceleration: f64,
}

impl Phase {
    /// Speed `d` metres from the start: `U^2 = U_0^2 + 2 a d`.
    pub(super) fn speed_at(&self, d: f64) -> f64 {
        Float::sqrt((self.speed * self.speed + 2.0 * self.acceleration * d).max(0.0))
    }
}

/// The time-optimal speed along a path within [`SpeedLimits`], as sections of constant acceleration.
///
/// Turns limit the speed of each piece; a forward pass limits acceleration and a backward pass deceleration (J. E.
/// Bobrow, S. Dubowsky, J. S. Gibson, *Time-optimal control of robotic manipulators along specified paths*, 1985). The
/// speed is continuous; its rate and the lateral acceleration jump.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedProfile {
    phases: Vec<Phase>,
    length: f64,
    closed: bool,
}

impl SpeedProfile {
    /// The profile of a path.
    ///
    /// # Errors
    /// If a limit is not positive (start and end may be 0), or an acceleration is not finite.
    pub fn new(path: &Path, limits: &SpeedLimits) -> Result<Self, PathError> {
        limits.check()?;
        let pieces = path.pieces();
        let count = pieces.len();
        let own: Vec<f64> = pieces.iter().map(|piece| limits.at(piece.curvature)).collect();
        // Speeds at the joints of pieces; node k is the start of piece k.
        let mut nodes = vec![0.0; count + 1];
        for k in 0..=count {
            let inner = path.is_closed() || (k > 0 && k < count);
            nodes[k] = if inner {
                let (before, after) = ((k + count - 1) % count, k % count);
                let end = pieces[before].at(pieces[before].length).course;
                let corner = wrap(pieces[after].course - end).abs() > 1e-6;
                let over = if corner { limits.corner } else { f64::INFINITY };
                own[before].min(own[after]).min(over)
            } else if k == 0 {
                own[0].min(limits.start)
            } else {
                own[count - 1].min(limits.end)
            };
        }
        let reach = |from: f64, a: f64, length: f64| Float::sqrt(from * from + 2.0 * a * length);
        // On a closed path the limits of the first lap act on the second.
        for _ in 0..if path.is_closed() { 2 } else { 1 } {
            for k in 0..count {
                nodes[k + 1] = nodes[k + 1].min(reach(nodes[k], limits.acceleration, pieces[k].length));
            }
            for k in (0..count).rev() {
                nodes[k] = nodes[k].min(reach(nodes[k + 1], limits.deceleration, pieces[k].length));
            }
            if path.is_closed() {
                let joint = nodes[0].min(nodes[count]);
                (nodes[0], nodes[count]) = (joint, joint);
            }
        }
        let mut phases = Vec::with_capacity(3 * count);
        let mut s = 0.0;
        for (k, piece) in pieces.iter().enumerate() {
            phases_of(s, piece.length, [nodes[k], own[k], nodes[k + 1]], limits, &mut phases);
            s += piece.length;
        }
        Ok(Self { phases, length: path.length(), closed: path.is_closed() })
    }

    /// Speed \[m/s\] and its rate \[m/s^2\] at arc length `s`; beyond the ends of an open path, end speed and rate 0.
    pub fn at(&self, s: f64) -> (f64, f64) {
        let s = if self.closed { s - Float::floor(s / self.length) * self.length } else { s };
        let index = self.phases.partition_point(|phase| phase.s <= s).saturating_sub(1);
        let Some(phase) = self.phases.get(index) else { return (0.0, 0.0) };
        let d = s - phase.s;
        let inside = (0.0..=phase.length).contains(&d);
        let speed = phase.speed_at(d.clamp(0.0, phase.length));
        (speed, if inside { phase.acceleration } else { 0.0 })
    }

    /// Duration from start to end, of one lap for a closed path \[s\].
    pub fn duration(&self) -> f64 {
        // (U_0 + U_1) / 2 is the mean over time of a constant acceleration.
        self.phases.iter().map(|p| 2.0 * p.length / (p.speed + p.end)).sum()
    }

    pub(super) fn phases(&self) -> &[Phase] {
        &self.phases
    }

    pub(super) fn length(&self) -> f64 {
        self.length
    }

    pub(super) fn is_closed(&self) -> bool {
        self.closed
    }
}

/// Accelerates, holds and brakes over `length` metres from `s`: from `speeds[0]` to `speeds[2]`, at most `speeds[1]`.
fn phases_of(s: f64, length: f64, speeds: [f64; 3], limits: &SpeedLimits, into: &mut Vec<Phase>) {
    let [first, most, last] = speeds;
    let (a, b) = (limits.acceleration, limits.deceleration);
    // Speed at which accelerating from one end meets braking to the other.
    let meeting = Float::sqrt((2.0 * a * b * length + b * first * first + a * last * last) / (a + b));
    let peak = most.min(meeting).max(first).max(last);
    let up = ((peak * peak - first * first) / (2.0 * a)).min(length);
    let down = ((peak * peak - last * last) / (2.0 * b)).min(length - up);
    let mut at = s;
    let sections =
        [(up, [first, peak], a), (length - up - down, [peak, peak], 0.0), (down, [peak, last], -b)];
    for (length, [speed, end], acceleration) in sections {
        if length > 1e-12 {
            into.push(Phase { s: at, length, speed, end, acceleration });
        }
        at += length;
    }
}
