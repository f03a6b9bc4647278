//! Comparison of channels with the rates of the pose, for each unit, sign and assignment.

use super::super::super::units::Unit;
use super::windows::{Body, Window};

/// Largest share of the energy of a pose rate that a reading may leave unexplained and still be called right, or the
/// correction. Noise, filters and calibrations of the real logs leave less than 0.06.
const EXPLAINED: f64 = 0.1;
/// Smallest share that a wrong reading leaves unexplained. The smallest one, of metres per second read as knots, is
/// (1 - 0.514)^2 = 0.24.
const WRONG: f64 = 0.2;

/// Units that are tried.
const SPEEDS: &[&str] = &["m/s", "kn", "km/h", "cm/s", "mm/s", "ft/s"];
const ROTATIONS: &[&str] = &["rad/s", "deg/s", "deg/min"];

/// A motion in the body frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Motion {
    Surge,
    Sway,
    Yaw,
}

impl Motion {
    /// The motion of an output.
    pub(super) fn of(name: &str) -> Option<Self> {
        match name {
            "u" => Some(Self::Surge),
            "v" => Some(Self::Sway),
            "r" => Some(Self::Yaw),
            _ => None,
        }
    }

    fn units(self) -> &'static [&'static str] {
        if self == Self::Yaw { ROTATIONS } else { SPEEDS }
    }

    /// Unit of the values without a stated one.
    pub(super) fn si(self) -> &'static str {
        self.units()[0]
    }
}

/// A reading that the pose supports: `sign * unit.factor / unit of the channel` times the channel as read.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// The channel that shows the motion.
    pub(super) channel: usize,
    pub(super) unit: &'static str,
    pub(super) negative: bool,
    /// Factor on the channel as read.
    pub(super) factor: f64,
    /// Fitted factor.
    pub(super) found: f64,
    /// Unexplained share of the energy.
    pub(super) residual: f64,
}

/// Result for one motion.
#[derive(Clone, Debug)]
pub(super) enum Verdict {
    /// The channel agrees with the pose; its unexplained share.
    Right(f64),
    /// The pose shows neither that the channel is right nor what is wrong.
    Unknown,
    /// The pose contradicts the channel and supports another reading.
    Wrong(Fit),
}

impl Verdict {
    pub(super) fn is_right(&self) -> bool {
        matches!(self, Self::Right(_))
    }

    pub(super) fn fit(&self) -> Option<&Fit> {
        if let Self::Wrong(fit) = self { Some(fit) } else { None }
    }
}

/// Sums of products of a pose rate `y` and a channel `x`: `[yy, xy, xx]`, for each length of the windows.
pub(super) struct Products(Vec<[f64; 3]>);

impl Products {
    /// Unexplained share with a factor, at the length of the windows at which it is smallest.
    fn residual(&self, factor: f64) -> f64 {
        let share = |[yy, xy, xx]: &[f64; 3]| (yy - 2.0 * factor * xy + factor * factor * xx) / yy;
        self.0.iter().map(share).filter(|x| x.is_finite()).fold(f64::INFINITY, f64::min)
    }

    /// Fitted factor at the length at which the given one fits best.
    fn fitted(&self, factor: f64) -> f64 {
        let share = |[yy, xy, xx]: &[f64; 3]| (yy - 2.0 * factor * xy + factor * factor * xx) / yy;
        let best = self.0.iter().min_by(|a, b| share(a).total_cmp(&share(b)));
        best.map_or(f64::NAN, |[_, xy, xx]| xy / xx)
    }

    pub(super) fn as_read_is_right(&self) -> Option<f64> {
        Some(self.residual(1.0)).filter(|residual| *residual < WRONG)
    }

    /// The unit and sign with which a channel explains the pose.
    pub(super) fn best(&self, motion: Motion, channel: usize, unit_factor: f64) -> Option<Fit> {
        let fits = motion.units().iter().flat_map(|&unit| {
            [false, true].map(|negative| {
                let factor = Unit::parse(unit).map_or(1.0, |u| u.factor) / unit_factor;
                let factor = if negative { -factor } else { factor };
                Fit { channel, unit, negative, factor, found: f64::NAN, residual: self.residual(factor) }
            })
        });
        let mut best = fits.min_by(|a, b| a.residual.total_cmp(&b.residual))?;
        best.found = self.fitted(best.factor);
        (best.residual <= EXPLAINED).then_some(best)
    }
}

/// Products for the yaw rate.
pub(super) fn yaw(windows: &[Vec<Window>], channel: usize) -> Products {
    Products(windows.iter().map(|all| sums(all.iter().map(|w| (w.turn, w.mean[channel])))).collect())
}

/// Frame of the path: the order of its axes, and its angle against the heading.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Frame {
    pub(super) axes: usize,
    pub(super) angle: f64,
}

impl Frame {
    /// Velocity of the path over a window.
    fn path(self, window: &Window) -> Body {
        let (sin, cos) = self.angle.sin_cos();
        let [x, y] = window.path[self.axes];
        [cos * x + sin * y, cos * y - sin * x]
    }
}

/// Products for the surge velocity.
pub(super) fn surge(windows: &[Vec<Window>], channel: usize, frame: Frame) -> Products {
    let row = |w: &Window| (frame.path(w)[0], w.forward[channel][0]);
    Products(windows.iter().map(|all| sums(all.iter().map(row))).collect())
}

/// Products for the sway velocity. The surge velocity, its channel and factor, contributes while the vessel turns. The
/// lever arm of the position sensor and a small misalignment of the compass are fitted: parts in proportion to the
/// lateral lever and to the forward velocity are removed from both sides.
pub(super) fn sway(
    windows: &[Vec<Window>],
    channel: usize,
    frame: Frame,
    surge: Option<(usize, f64)>,
) -> Products {
    let row = |w: &Window| {
        let turning = surge.map_or(0.0, |(channel, factor)| factor * w.forward[channel][1]);
        let path = frame.path(w);
        [path[1] - turning, w.forward[channel][0], w.lever[1], path[0]]
    };
    Products(windows.iter().map(|all| without_nuisance(all.iter().map(row).collect())).collect())
}

fn sums(pairs: impl Iterator<Item = (f64, f64)>) -> [f64; 3] {
    pairs.fold([0.0; 3], |[yy, xy, xx], (y, x)| [yy + y * y, xy + x * y, xx + x * x])
}

/// Products of the first two columns after projection on the complement of the last two.
fn without_nuisance(mut rows: Vec<[f64; 4]>) -> [f64; 3] {
    for (nuisance, others) in [(3, 0..3), (2, 0..2)] {
        let norm: f64 = rows.iter().map(|row| row[nuisance] * row[nuisance]).sum();
        if norm > 0.0 {
            for other in others {
                let slope = rows.iter().map(|row| row[nuisance] * row[other]).sum::<f64>() / norm;
                for row in &mut rows {
                    row[other] -= slope * row[nuisance];
                }
            }
        }
    }
    sums(rows.iter().map(|row| (row[0], row[1])))
}
