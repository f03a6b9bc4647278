//! Constants of the sensors that the measurements determine.
//!
//! A constant that is estimated where the measurements do not determine it takes up the error of something else, with a small
//! standard deviation. The same constant is therefore estimated from each half of the measurements, too. The standard
//! deviation of the whole is multiplied by the largest difference of the estimates in joint standard deviations, if it exceeds
//! one (Birge, Phys. Rev. 40 (1932) 207). With this standard deviation, a constant must increase the log-likelihood by half the
//! logarithm of the number of measurements (Schwarz, Ann. Statist. 6 (1978) 461); else it is zero.
//!
//! Without accelerations, the delay of the GNSS is never determined: positions that are late by `T` are, in a turn, those of a
//! vessel whose sway velocity is larger by `T u r`, and the sway in proportion to `u r` is not known. Its standard deviation is that
//! of the prior.

use hydroid_core::navigation::{Prior, State};

use super::fit::{CONSTANTS, Fitted, count, fit};
use super::measurements::{Kind, Runs, Sensor, Statistics};
use super::smoother;
use crate::progress::{Cancelled, Progress, silent};

/// Constants of the sensors. Those of the vessel are states of the smoother.
pub const CALIBRATED: [State; 2] = [State::Delay, State::Misalignment];
/// Share of the search with all measurements, for the progress.
const WHOLE: f64 = 0.7;

/// A constant of the sensors as all measurements and their halves show it: values and standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// The constant.
    pub state: State,
    /// From all measurements.
    pub whole: (f64, f64),
    /// From each half.
    pub halves: [(f64, f64); 2],
    /// Whether the measurements determine a value other than zero.
    pub is_determined: bool,
}

impl Calibration {
    /// The largest difference of the estimates in joint standard deviations; one at least.
    pub fn contradiction(&self) -> f64 {
        let [a, b] = self.halves;
        let apart = |(x, sx): (f64, f64), (y, sy): (f64, f64)| (x - y).abs() / f64::hypot(sx, sy);
        // The whole contains each half: its own deviation is no part of the difference.
        let (value, _) = self.whole;
        let all = [apart(a, b), apart(a, (value, 0.0)), apart(b, (value, 0.0))];
        all.into_iter().filter(|x| x.is_finite()).fold(1.0, f64::max)
    }

    /// Standard deviation of the estimate from all measurements, with the disagreement of the halves.
    pub fn deviation(&self) -> f64 {
        self.whole.1 * self.contradiction()
    }

    /// The value that is used, and its standard deviation.
    pub fn used(&self) -> (f64, f64) {
        let (value, deviation) = (self.whole.0, self.deviation());
        if self.is_determined { (value, deviation) } else { (0.0, value.hypot(deviation)) }
    }

    /// Whether the measurements leave most of the prior, so that the constant is open.
    pub fn is_open(&self) -> bool {
        self.deviation() > 0.5 * Prior::default().deviation[self.state as usize]
    }
}

/// [`fit`], with what all measurements and their halves show of each of the constants [`CALIBRATED`] that is measured.
///
/// # Errors
/// If the callback cancels.
///
/// # Panics
/// Without a first guess.
pub fn calibrate(
    runs: &Runs,
    halves: &[Runs; 2],
    guesses: &[Statistics],
    progress: Progress<'_>,
) -> Result<(Fitted, Vec<Calibration>), Cancelled> {
    let whole = fit(runs, guesses, &mut |share| progress(WHOLE * share))?;
    let guess = std::slice::from_ref(&whole.statistics);
    let of = |half: &Runs, progress: Progress<'_>| {
        fit(half, guess, progress).map(|fitted| constants(half, &fitted))
    };
    let [first, second] = halves;
    let mut other = None;
    let one = rayon::in_place_scope(|scope| {
        scope.spawn(|_| other = Some(of(second, &mut silent())));
        of(first, &mut |share| progress(WHOLE + (1.0 - WHOLE) * share))
    })?;
    let (all, other) = (constants(runs, &whole), other.expect("the scope waits for its tasks")?);
    let has_accelerations = runs.sensors.iter().any(|sensor| sensor.kind == Kind::SpecificForce);
    let of = |state: State| {
        let i = CONSTANTS.iter().position(|of| *of == state)?;
        let mut found =
            Calibration { state, whole: all[i], halves: [one[i], other[i]], is_determined: false };
        if state == State::Delay && !has_accelerations {
            found.whole.1 = Prior::default().deviation[state as usize];
            found.halves = [found.whole; 2];
            return Some(found);
        }
        let increase = 0.5 * (found.whole.0 / found.deviation()).powi(2);
        Some(Calibration { is_determined: increase > 0.5 * (count(runs).max(1) as f64).ln(), ..found })
    };
    let found = calibrated(&runs.sensors).filter_map(of).collect();
    Ok((whole, found))
}

/// The constants of some sensors that are calibrated.
pub fn calibrated(sensors: &[Sensor]) -> impl Iterator<Item = State> + '_ {
    let has = |kinds: &[Kind]| sensors.iter().any(|sensor| kinds.contains(&sensor.kind));
    CALIBRATED.into_iter().filter(move |state| match state {
        State::Delay => has(&[Kind::Position, Kind::Velocity]),
        _ => has(&[Kind::Heading]),
    })
}

/// Constants of a fit, and the standard deviations that the measurements leave. An extended Kalman filter that estimates them
/// beside the other states can converge to other values.
fn constants(runs: &Runs, fitted: &Fitted) -> [(f64, f64); CONSTANTS.len()] {
    let mut runs = runs.clone();
    runs.runs.iter_mut().for_each(|run| run.prior = fitted.prior(&run.prior));
    let deviations = smoother::constant_deviations(&runs, &fitted.statistics);
    std::array::from_fn(|i| (fitted.constants[i], deviations[i]))
}
